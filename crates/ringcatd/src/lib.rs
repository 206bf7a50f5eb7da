//! The daemon of RingCAT: it drives segments while no application does, and hands them over.
//!
//! * [`conf`]: the configuration file; [`setup`]: what the daemon is to do, from the file and from options; [`check`]:
//!   what of it was understood, in text; [`up_down`]: interfaces that are switched on and off with the daemon;
//! * [`source`]: the links of a master as an option names them; [`device`]: a network interface, and where it is;
//!   [`wires`]: opened anew for each owner; [`opened`]: as long as a process has them; [`opener`]: packet sockets from
//!   a process of its own;
//! * [`segment_process`]: a simulated segment in a process of its own;
//! * [`master`]: a master with its links; [`driver`]: the process that drives it; [`driving`]: this daemon while it
//!   does; [`others`]: another MainDevice that does; [`installed`]: one that is installed on this host;
//! * [`ethernet`]: network interfaces of EoE, which outlast applications; [`debug_interfaces`]: those with all frames
//!   of a master;
//! * [`owner`]: queries to an application that drives a master; [`tenure`]: its time, and what ends it;
//!   [`process_state`]: what the kernel shows of its process; [`owner_lock`]: what of it outlives the daemon;
//! * [`listening`], [`session`], [`rights`]: clients, their requests and permissions;
//! * [`daemon`]: all of it; [`running`]: from its start to its end; [`service_manager`]: messages to that; [`log`]:
//!   lines for the operator;
//! * [`service_control`]: the program `ethercatctl`.
//!
//! A thread serves each client, so one that is slow or hostile keeps nothing but its own thread. Decisions 0074 to
//! 0076.
#![forbid(unsafe_code)]

pub mod check;
pub mod conf;
pub mod daemon;
pub mod debug_interfaces;
pub mod device;
pub mod driver;
pub mod driving;
pub mod ethernet;
pub mod installed;
pub mod listening;
pub mod log;
pub mod master;
pub mod opened;
pub mod opener;
pub mod others;
pub mod owner;
pub mod owner_lock;
pub mod process_state;
pub mod rights;
pub mod running;
pub mod segment_process;
pub mod service_control;
pub mod service_manager;
pub mod session;
pub mod setup;
pub mod source;
pub mod tenure;
pub mod up_down;
pub mod wires;
