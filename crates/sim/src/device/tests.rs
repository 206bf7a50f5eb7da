//! Devices through their controller's EtherCAT side: frames in, reactions out.

mod bench;
mod images;
mod mailbox;
mod process_data;
mod robustness;
mod state_machine;
