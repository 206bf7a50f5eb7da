//! Messages between the daemon `ringcatd`, the application that drives a segment (its owner), and clients.
//!
//! * [`message`]: their contents;
//! * [`information`]: the present state of a segment;
//! * [`tool`]: data of a master, its SubDevices and its application;
//! * [`settings`]: settings of a master, for the daemon and for applications;
//! * [`refusal`]: why a request is refused, in one sentence;
//! * [`wire`]: messages as bytes, and any bytes as a message or an error;
//! * [`connection`]: messages and descriptors over a Unix socket;
//! * [`arriving`]: a message of which a part has arrived;
//! * [`remote`]: messages of one of two MainDevices for remote access, over TCP;
//! * [`client`]: queries to a daemon; [`socket`]: where it listens.
//!
//! A client sends [`Content::Hello`], then queries. An application that drives a master sends [`Content::Take`] and
//! receives the descriptors of its links with the known data of the segment; from then on the daemon sends queries on
//! this connection. The order is in decision 0074.
#![forbid(unsafe_code)]

pub mod arriving;
pub mod client;
pub mod connection;
pub mod information;
pub mod message;
mod owner;
mod receive_error;
pub mod refusal;
pub mod remote;
pub mod settings;
pub mod socket;
pub mod tool;
pub mod wire;

pub use arriving::Arriving;
pub use client::Client;
pub use connection::{Connection, ReceiveError};
pub use message::{
    Answer, Content, EventLine, HandedBus, HandedLink, HandedLinks, MasterState, Message, Numbered, Owner, Query, Right,
};
pub use refusal::{Refusal, ServiceFault};
pub use ringcat_link::process::wait_readable;
pub use ringcat_link::visible::{is_hidden, visible};
pub use settings::{BusSettings, DebugRing};
pub use socket::DEFAULT_SOCKET;
pub use wire::{Limits, VERSION, WireError};
