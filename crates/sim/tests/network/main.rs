//! Tests of the network through its public API: paths of frames, arrival times, effects of faults (protocol 2, 9.4,
//! 11.3).

mod any_frames;
mod clocks;
mod determinism;
mod devices_page;
mod examples;
mod fast_path;
mod faults;
mod mail;
mod operation;
mod random_walks;
mod real_images;
mod timing;
mod vectors;
mod wiring;
