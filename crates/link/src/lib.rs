//! The part of RingCAT that calls the Linux kernel for network interfaces and time.
//!
//! * [`packet_socket`]: sending and receiving frames on an interface: `AF_PACKET` with a memory-mapped receive ring;
//! * [`descriptors`]: sockets that another process has opened, passed over a Unix socket;
//! * [`frame_pipe`]: frames over a pair of Unix sockets, to a simulated segment in another process;
//! * [`process`]: the peer of a Unix socket, the end of a process; [`heartbeat`]: whether a process runs;
//! * [`private_file`]: files for this user only;
//! * [`filter`]: frames that the kernel puts into that ring;
//! * [`listener`]: frames of one sender on interfaces where they are not expected;
//! * [`waiting`]: sleeping or spinning until a frame arrives or a time is reached; [`wake_up`]: ending such a wait from
//!   another thread;
//! * [`interface`], [`carrier`]: the interfaces of the host, their other users, their carrier;
//! * [`host_files`]: files and variables of the host; [`foreign`]: another MainDevice that is installed on it;
//! * [`tap`]: TAP interfaces, network interfaces whose other end is this process;
//! * [`monotonic`], [`realtime`]: the host's clock, scheduling, memory locking, processor latency;
//! * [`operator`]: lines on the standard error and in the journal, without waiting;
//! * [`terminal`]: its size, and keys one by one; [`job`]: signals that stop and continue a program in it;
//! * [`mod@print`]: lines whose reader may leave;
//! * [`visible`]: text for a terminal, with hidden characters as escape sequences;
//! * [`signals`]: signals that request the end of a program;
//! * [`pcapng`]: captures for Wireshark; [`recorder`]: writing captures during operation; [`sniffer`]: capturing an
//!   interface passively.
//!
//! Frames are bytes without FCS. This crate evaluates only the EtherType and the class bit of the first datagram's Idx.
//! `docs/links.md` describes how to write another back end and which permissions the kernel requires. `unsafe` is
//! allowed in this crate; each block states why it is sound.
#![deny(unsafe_op_in_unsafe_fn)]

pub mod capabilities;
pub mod carrier;
pub mod descriptors;
mod error;
pub mod filter;
pub mod foreign;
pub mod frame_pipe;
pub mod heartbeat;
pub mod host_files;
pub mod interface;
pub mod job;
mod kernel;
pub mod listener;
pub mod monotonic;
pub mod operator;
pub mod packet_socket;
pub mod pcapng;
mod permission;
pub mod print;
pub mod private_file;
pub mod process;
pub mod realtime;
mod receive_mode;
pub mod recorder;
mod rx_ring;
pub mod signals;
pub mod sniffer;
mod system_call;
pub mod tap;
pub mod terminal;
pub mod visible;
pub mod waiting;
pub mod wake_up;

pub use carrier::{Carrier, CarrierWatch};
pub use error::LinkError;
pub use filter::ClassFilter;
pub use frame_pipe::{FramePipe, wait_pipes};
pub use listener::{Listener, Sender};
pub use packet_socket::binding::{PresentInterface, revoke};
pub use packet_socket::handed::HandedSocket;
pub use packet_socket::{LinkCounters, PacketOptions, PacketSocket, SendingSide};
pub use permission::{may_write, setcap_command};
pub use receive_mode::ReceiveMode;
pub use recorder::{AlreadyRead, FrameNote, FrameReader, Recorder, RecorderError, Tap, Taps};
pub use signals::{HeldSignals, Signal};
pub use sniffer::Sniffer;
pub use tap::{TapError, TapInterface};
pub use waiting::{UsualReturn, wait, wait_from, wait_or_wake};
pub use wake_up::WakeUp;
