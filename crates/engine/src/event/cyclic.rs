//! Events of the exchange, which reach the acyclic half as words in a queue.

#[cfg(feature = "standby")]
use alloc::format;

use super::Event;
#[cfg(feature = "standby")]
use super::standby::CyclicStandbyEvent;
use crate::domain::{DomainId, DomainState, DomainStatus};
use crate::queue::WORDS;

/// Events of the exchange, which are packed into words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CyclicEvent {
    /// The state of a domain changed.
    Domain {
        /// Number of the domain.
        domain: u16,
        /// The new state.
        status: DomainStatus,
        /// Incomplete cycles of this interruption so far, or of the one that has ended.
        incomplete: u64,
    },
    /// A domain was due while its previous frames were still on the wire.
    Skipped {
        /// Number of the domain.
        domain: u16,
    },
    /// The differences of the clocks entered or left the sync window.
    SyncWindow {
        /// True: within the sync window.
        inside: bool,
        /// OR of all magnitudes in nanoseconds.
        spread_ns: u32,
    },
    /// An event of MainDevice redundancy.
    #[cfg(feature = "standby")]
    Standby(CyclicStandbyEvent),
}

const KIND_DOMAIN: u64 = 1;
const KIND_SKIPPED: u64 = 2;
const KIND_SYNC_WINDOW: u64 = 3;

impl CyclicEvent {
    /// As words: kind 8 bits, state 7, whether a frame returned 1, domain 16, skipped cycles 32; then the working
    /// counters; then the incomplete cycles.
    pub const fn pack(self) -> [u64; WORDS] {
        match self {
            CyclicEvent::Domain { domain, status, incomplete } => {
                let state = match status.state {
                    DomainState::Zero => 0,
                    DomainState::Incomplete => 1,
                    DomainState::Complete => 2,
                };
                [
                    KIND_DOMAIN
                        | state << 8
                        | (status.returned as u64) << 15
                        | (domain as u64) << 16
                        | (status.skipped << 32),
                    status.wkc as u64 | (status.expected as u64) << 32,
                    incomplete,
                ]
            }
            CyclicEvent::Skipped { domain } => [KIND_SKIPPED | (domain as u64) << 16, 0, 0],
            CyclicEvent::SyncWindow { inside, spread_ns } => {
                [KIND_SYNC_WINDOW | (inside as u64) << 8, spread_ns as u64, 0]
            }
            #[cfg(feature = "standby")]
            CyclicEvent::Standby(event) => event.pack(),
        }
    }

    /// Unpacks words; `None` for words that [`CyclicEvent::pack`] does not make.
    pub const fn unpack(words: [u64; WORDS]) -> Option<CyclicEvent> {
        let domain = (words[0] >> 16) as u16;
        match words[0] & 0xFF {
            KIND_DOMAIN => {
                let state = match (words[0] >> 8) & 0x7F {
                    0 => DomainState::Zero,
                    1 => DomainState::Incomplete,
                    2 => DomainState::Complete,
                    _ => return None,
                };
                let status = DomainStatus {
                    wkc: words[1] as u32,
                    expected: (words[1] >> 32) as u32,
                    state,
                    returned: words[0] >> 15 & 1 != 0,
                    pending: false,
                    skipped: words[0] >> 32,
                };
                Some(CyclicEvent::Domain { domain, status, incomplete: words[2] })
            }
            KIND_SKIPPED => Some(CyclicEvent::Skipped { domain }),
            KIND_SYNC_WINDOW => {
                Some(CyclicEvent::SyncWindow { inside: words[0] >> 8 & 1 != 0, spread_ns: words[1] as u32 })
            }
            #[cfg(feature = "standby")]
            _ => match CyclicStandbyEvent::unpack(words) {
                Some(event) => Some(CyclicEvent::Standby(event)),
                None => None,
            },
            #[cfg(not(feature = "standby"))]
            _ => None,
        }
    }

    /// The event as the application receives it.
    pub fn event(self) -> Event {
        match self {
            CyclicEvent::Domain { domain, status, incomplete } => {
                Event::Domain { domain: DomainId(domain.into()), status, incomplete }
            }
            CyclicEvent::Skipped { domain } => Event::Skipped { domain: DomainId(domain.into()) },
            CyclicEvent::SyncWindow { inside, spread_ns } => Event::SyncWindow { inside, spread_ns },
            #[cfg(feature = "standby")]
            CyclicEvent::Standby(event) => Event::Standby(event.event(|number| format!("item {number}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cyclic_events_survive_the_words() {
        let status = DomainStatus {
            wkc: 3,
            expected: 70_000,
            state: DomainState::Incomplete,
            returned: true,
            skipped: 9,
            ..DomainStatus::default()
        };
        let window = CyclicEvent::SyncWindow { inside: true, spread_ns: u32::MAX };
        let change = CyclicEvent::Domain { domain: 7, status, incomplete: u64::MAX };
        for event in [change, CyclicEvent::Skipped { domain: 65_535 }, window] {
            assert_eq!(CyclicEvent::unpack(event.pack()), Some(event));
        }
        assert_eq!(CyclicEvent::unpack([0xFF, 0, 0]), None);
    }
}
