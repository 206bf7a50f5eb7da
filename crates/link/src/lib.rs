//! Everything of RingCAT that talks to the Linux kernel about network interfaces and time.
//!
//! * [`packet_socket`]: frames in and out of an interface: `AF_PACKET` with a memory-mapped receive ring;
//! * [`filter`]: which frames the kernel puts into that ring;
//! * [`listener`]: frames of one sender on all interfaces where they are not expected;
//! * [`waiting`]: sleeping or spinning until a frame or a moment comes;
//! * [`interface`], [`carrier`]: the interfaces of the host, their other users, whether a cable is plugged in;
//! * [`tap`]: network interfaces of the host whose other end is this process;
//! * [`monotonic`], [`realtime`]: the host's clock, scheduling, memory locking, processor latency;
//! * [`signals`]: those that ask a program to end;
//! * [`pcapng`]: captures that Wireshark reads; [`recorder`]: writing them while frames go on; [`sniffer`]: seeing what
//!   passes on an interface without taking part.
//!
//! Frames go in and out as bytes without FCS. Of EtherCAT only the EtherType and the class bit of the first datagram's
//! Idx are known here. `docs/links.md` tells how another back end is written and what the kernel wants to be granted.
//! `unsafe` is allowed in this crate, each block says why it is sound.
#![deny(unsafe_op_in_unsafe_fn)]

pub mod carrier;
mod error;
pub mod filter;
pub mod interface;
mod kernel;
pub mod listener;
pub mod monotonic;
pub mod packet_socket;
pub mod pcapng;
mod permission;
pub mod realtime;
mod receive_mode;
pub mod recorder;
mod rx_ring;
pub mod signals;
pub mod sniffer;
pub mod tap;
pub mod waiting;

pub use carrier::{Carrier, CarrierWatch};
pub use error::LinkError;
pub use filter::ClassFilter;
pub use listener::{Listener, Sender};
pub use packet_socket::{LinkCounters, PacketOptions, PacketSocket};
pub use receive_mode::ReceiveMode;
pub use recorder::{Recorder, RecorderError, Tap};
pub use signals::{HeldSignals, Signal};
pub use sniffer::Sniffer;
pub use tap::{TapError, TapInterface};
pub use waiting::wait;
