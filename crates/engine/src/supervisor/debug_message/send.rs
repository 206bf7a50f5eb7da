//! Sends debug messages in the window of acyclic frames.

use alloc::vec::Vec;
use core::time::Duration;

use crate::link::Link;
use crate::supervisor::shared::Shared;

/// A frame that fits no send window is sent after this time nevertheless.
const STARVED: Duration = Duration::from_millis(10);

impl Shared {
    /// Sends debug messages within a budget. Returns the bytes sent per link.
    pub(in crate::supervisor) fn send_debug_messages(
        &mut self,
        budget: usize,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> usize {
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
