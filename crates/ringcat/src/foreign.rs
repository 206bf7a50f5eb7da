//! Another MainDevice on the links: detected before anything is sent.
//!
//! Two MainDevices on one segment disturb each other: a scan brings all SubDevices to INIT, and reading a register such
//! as 0x0110 clears what the other one waits for.

use std::fmt;
use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_wire::frame::{ETHERNET_HEADER_LEN, MacAddress};

use crate::text::address;

mod listening;
mod quiet;

pub use listening::{ListeningPhase, ListeningSockets, ListeningState};
pub use quiet::QuietLinks;

/// How long frames are to be listened for: longer than the cycle of all but the slowest MainDevices.
pub const LISTEN: Duration = Duration::from_millis(250);
/// What comes before may still be the frames of a MainDevice that has just ended.
pub const LAST_FRAMES: Duration = Duration::from_millis(25);
/// EtherType, and a VLAN tag before it.
const ETHERCAT: [u8; 2] = [0x88, 0xA4];
const VLAN: [u8; 2] = [0x81, 0x00];
const TAG: usize = 4;
/// Type of the EtherCAT header that commands for SubDevices have; others are network variables and mailboxes
/// (ETG.1000.4, EtherCAT header).
const COMMANDS: u8 = 1;

/// A frame of another MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ForeignFrame {
    /// The link that it arrived on.
    pub arrived_on: Link,
    /// Its source address.
    pub source: MacAddress,
}

impl fmt::Display for ForeignFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ForeignFrame { arrived_on, source } = self;
        let source = address(*source);
        write!(f, "another MainDevice controls this segment: its frames, from {source}, arrive on {arrived_on}")
    }
}

/// Whether a frame holds datagrams for SubDevices.
pub fn has_commands(frame: &[u8]) -> bool {
    let tag = if frame.get(12..14) == Some(&VLAN) { TAG } else { 0 };
    let header_at = ETHERNET_HEADER_LEN + tag;
    frame.get(header_at - 2..header_at) == Some(&ETHERCAT)
        && frame.get(header_at + 1).is_some_and(|high| high >> 4 == COMMANDS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(ether_type: &[u8], high: u8) -> Vec<u8> {
        let mut frame = vec![0xff; 12];
        frame.extend(ether_type);
        frame.extend([0x0e, high]);
        frame.resize(60, 0);
        frame
    }

    // covers: other-main-device
    #[test]
    fn only_frames_with_commands_show_a_main_device() {
        assert!(has_commands(&frame(&ETHERCAT, 0x10)));
        assert!(has_commands(&frame(&[0x81, 0x00, 0x00, 0x05, 0x88, 0xa4], 0x10)));
        assert!(!has_commands(&frame(&ETHERCAT, 0x40)), "network variables");
        assert!(!has_commands(&frame(&[0x08, 0x00], 0x10)), "IP");
        (0..16).for_each(|length| assert!(!has_commands(&frame(&ETHERCAT, 0x10)[..length.min(15)])));
    }
}
