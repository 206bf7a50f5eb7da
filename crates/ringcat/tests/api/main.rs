//! The public API as an application uses it, on the embedded simulator.

mod declarations;
mod demo;
mod ethernet;
mod exit_codes;
mod gateway;
mod junctions;
mod names;
mod services;
mod states;
mod stop;
mod threads;
mod triggers;
