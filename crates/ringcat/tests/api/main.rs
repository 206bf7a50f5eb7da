//! The public API as an application uses it, on the embedded simulator.

mod declarations;
mod errors;
mod ethernet;
mod gateway;
mod jobs;
mod junctions;
mod mailbox;
mod names;
#[cfg(feature = "standby")]
mod partner_interface;
mod process_data;
mod protocols;
mod readiness;
#[cfg(feature = "standby")]
mod remote;
mod services;
#[cfg(feature = "standby")]
mod standby;
mod states;
mod stop;
mod subdevices;
mod threads;
mod triggers;
