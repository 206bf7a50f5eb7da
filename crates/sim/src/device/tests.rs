//! Devices through their controller's EtherCAT side: frames in, reactions out.

mod bench;
mod client;
mod coe;
mod images;
mod mail_faults;
mod mailbox;
mod process_data;
mod robustness;
mod state_machine;
