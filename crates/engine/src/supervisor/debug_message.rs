//! Ethernet debug messages: frames that are not EtherCAT, as marks in captures (Master Redundancy 10.8). SubDevices
//! destroy them, or pass them on (protocol 2.6).

mod send;

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::frame::{ETHERNET_HEADER_LEN, MIN_FRAME, MacAddress};

use crate::time::Instant;

/// Debug messages that may wait.
pub(crate) const MOST_WAITING: usize = 16;

/// Frames that wait to be sent, one for each link, and since when.
#[derive(Debug, Default)]
pub(crate) struct DebugMessages(pub(super) VecDeque<([Option<Vec<u8>>; 2], Instant)>);

impl DebugMessages {
    /// Whether frames wait.
    pub(super) fn are_waiting(&self) -> bool {
        !self.0.is_empty()
    }

    /// Queues a message from the addresses of the links, with a text of at most one frame; false if too many wait.
    pub(crate) fn queue(
        &mut self,
        sources: [Option<MacAddress>; 2],
        ethertype: u16,
        text: &[u8],
        now: Instant,
    ) -> bool {
        if self.0.len() >= MOST_WAITING {
            return false;
        }
        self.0.push_back((sources.map(|source| Some(frame(source?, ethertype, text))), now));
        true
    }
}

fn frame(source: MacAddress, ethertype: u16, text: &[u8]) -> Vec<u8> {
    let mut frame = vec![0; (ETHERNET_HEADER_LEN + text.len()).max(MIN_FRAME)];
    frame[..6].fill(0xFF);
    frame[6..12].copy_from_slice(&source.0);
    frame[12..14].copy_from_slice(&ethertype.to_be_bytes());
    frame[ETHERNET_HEADER_LEN..ETHERNET_HEADER_LEN + text.len()].copy_from_slice(text);
    frame
}
