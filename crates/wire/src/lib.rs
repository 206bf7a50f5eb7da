//! The EtherCAT codec: frames, registers, SII and mailbox messages, without state, policy, allocation, clock or I/O.
//!
//! * [`frame`]: Ethernet, VLAN and UDP encapsulation, the EtherCAT header, reading and building frames;
//! * [`datagram`], [`command`]: one EtherCAT command and its header;
//! * [`source_address`]: the two encodings of ring and standby marks in the source MAC address;
//! * [`register`]: the register table of a SubDevice controller and typed views of its registers;
//! * [`al`]: states of the EtherCAT state machine and AL status codes;
//! * [`sii`]: SubDevice information (EEPROM), reader and writer;
//! * [`mailbox`]: the mailbox header, CoE, FoE, EoE, SoE, AoE, VoE, messages of a mailbox gateway;
//! * `master_frame` (feature `standby`): what the two MainDevices of a ring send each other in each cycle;
//! * [`memory_write`]: a write into the memory of a SubDevice that must not be cut off;
//! * [`time`], [`address`]: newtypes.
//!
//! # Panic contract
//!
//! Decoding any bytes never panics: a malformed part is an error that contains the expected and the received value.
//! Unknown codes are kept, so that decode and encode are inverse.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod address;
pub mod al;
mod bytes;
pub mod command;
pub mod datagram;
pub mod frame;
pub mod mailbox;
#[cfg(feature = "standby")]
pub mod master_frame;
pub mod memory_write;
pub mod register;
pub mod sii;
pub mod source_address;
pub mod time;
