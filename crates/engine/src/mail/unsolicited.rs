//! Unsolicited mail: kept until the application takes it, bounded, with a count of dropped mail.

use alloc::vec::Vec;

use ringcat_wire::mailbox::Protocol;

use super::bounded_queue::BoundedQueue;

/// Number of Ethernet fragments kept: a frame of 1,518 bytes in the smallest fragments, and some more.
const ETHERNET: usize = 64;
/// Number of mails kept of each other kind.
const OTHERS: usize = 32;

/// Kinds of unsolicited mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unsolicited {
    /// Fragments of Ethernet frames (EoE).
    Ethernet,
    /// Notifications and emergencies of drives (SoE).
    Soe,
    /// Notifications and requests (AoE).
    Aoe,
    /// Messages of the vendor protocol (VoE).
    Voe,
    /// All other mail, including late answers.
    Other,
}

/// An unsolicited mail.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Unclaimed {
    /// Its protocol.
    pub protocol: Protocol,
    /// The data after the mailbox header.
    pub payload: Vec<u8>,
}

/// Queues of unsolicited mail, one per kind. Emergencies have a ring of their own.
#[derive(Debug)]
pub(super) struct UnsolicitedQueues {
    rings: [BoundedQueue<Unclaimed>; 5],
}

impl UnsolicitedQueues {
    pub(super) fn new() -> UnsolicitedQueues {
        let capacity = |kind| if kind == Unsolicited::Ethernet { ETHERNET } else { OTHERS };
        let kinds = [Unsolicited::Ethernet, Unsolicited::Soe, Unsolicited::Aoe, Unsolicited::Voe, Unsolicited::Other];
        UnsolicitedQueues { rings: kinds.map(|kind| BoundedQueue::new(capacity(kind))) }
    }

    pub(super) fn of_kind(&mut self, kind: Unsolicited) -> &mut BoundedQueue<Unclaimed> {
        &mut self.rings[kind as usize]
    }
}
