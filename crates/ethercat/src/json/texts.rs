//! What `version --json`, `eoe --json`, and commands print whose output is for other programs: `graph`, `xml`,
//! `cstruct`.

use ringcat_control::tool::EthernetLine;
use serde::Serialize;

use super::values::List;

/// Versions.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Version {
    /// The release of the IgH EtherCAT Master whose commands the tool has
    pub igh_version: &'static str,
    /// The version of RingCAT
    pub ringcat_version: &'static str,
}

/// An output for another program.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Text<'a> {
    /// Number of the master
    pub master: u32,
    /// The output as it is without --json
    pub text: &'a str,
}

/// Network interfaces of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ethernet<'a> {
    /// Number of the master
    pub master: u32,
    /// Its network interfaces of Ethernet over EtherCAT
    pub interfaces: List<'a, EthernetLine, (), Interface<'a>>,
}

/// A network interface.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Interface<'a> {
    /// Name of the interface
    pub interface: &'a str,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Whether frames can pass
    pub up: bool,
    /// Bytes from the SubDevice
    pub received_bytes: u64,
    /// Of these, bytes in the last second
    pub received_bytes_per_s: u64,
    /// Bytes to the SubDevice
    pub sent_bytes: u64,
    /// Of these, bytes in the last second
    pub sent_bytes_per_s: u64,
    /// Frames that wait to be sent
    pub queued_frames: u32,
    /// The most that may wait
    pub queue_frames: u32,
}

impl<'a> Ethernet<'a> {
    /// The interfaces of a master.
    pub fn new(master: u32, all: &'a [EthernetLine]) -> Ethernet<'a> {
        Ethernet { master, interfaces: List { all, context: (), make: Interface::new } }
    }
}

impl<'a> Interface<'a> {
    fn new(_: usize, line: &'a EthernetLine, _: ()) -> Interface<'a> {
        let ([received_bytes, sent_bytes], [received_bytes_per_s, sent_bytes_per_s]) = (line.bytes, line.rates);
        let [queued_frames, queue_frames] = line.queue;
        Interface {
            interface: &line.name,
            position: line.position,
            up: line.is_up,
            received_bytes,
            received_bytes_per_s,
            sent_bytes,
            sent_bytes_per_s,
            queued_frames,
            queue_frames,
        }
    }
}
