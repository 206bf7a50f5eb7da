//! Unsolicited mail: kept until the application takes it, bounded, with a count of dropped mail.

use alloc::vec::Vec;

use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;

use super::bounded_queue::BoundedQueue;
use crate::time::Instant;

/// Number of emergencies kept.
const EMERGENCIES: usize = 32;
/// Number of Ethernet fragments kept: a frame of 1,518 bytes in the smallest fragments, and some more.
const ETHERNET: usize = 64;
/// Number of mails kept of each other kind.
const OTHERS: usize = 32;

/// Kinds of unsolicited mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
pub struct Unclaimed {
    /// Its protocol.
    pub protocol: Protocol,
    /// The data after the mailbox header.
    pub payload: Vec<u8>,
}

/// Queues of unsolicited mail: emergencies, and one queue per kind.
#[derive(Debug)]
pub(super) struct UnsolicitedQueues {
    emergencies: BoundedQueue<(Instant, Emergency)>,
    rings: [BoundedQueue<Unclaimed>; 5],
}

impl UnsolicitedQueues {
    pub(super) fn new() -> UnsolicitedQueues {
        let capacity = |kind| if kind == Unsolicited::Ethernet { ETHERNET } else { OTHERS };
        let kinds = [Unsolicited::Ethernet, Unsolicited::Soe, Unsolicited::Aoe, Unsolicited::Voe, Unsolicited::Other];
        UnsolicitedQueues {
            emergencies: BoundedQueue::new(EMERGENCIES),
            rings: kinds.map(|kind| BoundedQueue::new(capacity(kind))),
        }
    }

    pub(super) fn emergencies(&mut self) -> &mut BoundedQueue<(Instant, Emergency)> {
        &mut self.emergencies
    }

    pub(super) fn of_kind(&mut self, kind: Unsolicited) -> &mut BoundedQueue<Unclaimed> {
        &mut self.rings[kind as usize]
    }
}
