//! The public API as an application uses it, on the embedded simulator.

mod declarations;
mod ethernet;
mod gateway;
mod jobs;
mod junctions;
mod names;
mod services;
mod states;
mod stop;
mod threads;
mod triggers;
