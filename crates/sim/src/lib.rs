//! A register-accurate simulator of EtherCAT segments in virtual time.
//!
//! * [`controller`]: one SubDevice controller: ports, processing unit, FMMUs, SyncManagers, SII interface, clock;
//! * [`device`], [`application`], [`description`], [`sii_image`], [`catalogue`]: devices behind a controller;
//! * [`network`], [`cable`], [`host`], [`fault`]: cables, events, hosts and faults;
//! * [`segment`]: segments from files;
//! * [`time`], [`frame`]: virtual time and frames.
//!
//! No wall clock and no unseeded randomness: the same input gives the same run, bit for bit.
#![forbid(unsafe_code)]

pub mod application;
pub mod cable;
pub mod catalogue;
pub mod controller;
pub mod data_type;
pub mod description;
pub mod device;
pub mod fault;
pub mod frame;
pub mod host;
pub mod network;
mod queue;
pub mod segment;
pub mod sii_image;
pub mod time;
