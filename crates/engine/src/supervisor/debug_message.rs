//! Ethernet debug messages: frames that are not EtherCAT, as marks in captures (Master Redundancy 10.8). SubDevices
//! destroy them, or pass them on (protocol 2.6).

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::frame::{ETHERNET_HEADER_LEN, MIN_FRAME, MacAddress};

use super::shared::Shared;
use crate::link::Link;
use crate::time::Instant;

/// Debug messages that may wait.
pub(crate) const MOST_WAITING: usize = 16;
/// A frame that fits no send window is sent after this time nevertheless.
const STARVED: Duration = Duration::from_millis(10);

/// Frames that wait to be sent, one for each link, and since when.
#[derive(Debug, Default)]
pub(crate) struct DebugMessages(VecDeque<([Option<Vec<u8>>; 2], Instant)>);

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

impl Shared {
    /// Sends debug messages within a budget. Returns the bytes sent per link.
    pub(super) fn send_debug_messages(&mut self, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        let mut used = 0;
        while let Some((frames, since)) = self.debug_messages.0.front() {
            let length = frames.iter().flatten().map(Vec::len).max().unwrap_or(0);
            let fits = used + length <= budget || (used == 0 && self.now.since(*since) >= STARVED);
            if !fits || self.alone.is_held() {
                break;
            }
            for link in Link::ALL {
                let Some(frame) = &frames[link.index()] else { continue };
                self.events.messages().sent(self.now, link, frame);
                transmit(link, frame);
            }
            used += length;
            self.outbox.hand_over(length, self.now);
            self.debug_messages.0.pop_front();
        }
        used
    }
}
