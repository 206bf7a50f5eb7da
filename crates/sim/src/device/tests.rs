//! Tests of devices through the EtherCAT side of their controller.

mod aoe;
mod bench;
mod client;
mod coe;
mod eoe;
mod foe;
mod images;
mod mail_faults;
mod mailbox;
mod process_data;
mod robustness;
mod servo;
mod servo_objects;
mod soe;
mod state_machine;
mod voe;
