//! The network of the simulator, driven through its public API: what way frames take, when they arrive, what faults do
//! to them (protocol 2, 9.4, 11.3; issue 2, part 3).

mod any_frames;
mod clocks;
mod determinism;
mod examples;
mod faults;
mod flights;
mod mail;
mod operation;
mod random_walks;
mod real_images;
mod timing;
mod vectors;
mod wiring;
