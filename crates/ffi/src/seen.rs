//! What a broadcast shows of all SubDevices now. It asks the acyclic half, and waits for its answer.

use ringcat::wire::command::Command;
use ringcat::wire::datagram::Target;
use ringcat::wire::register::map;
use ringcat::{RawDatagram, Services, SupervisorThread};

/// The bits of AL states in AL status.
const AL_STATES: u8 = 0x0F;

/// What a broadcast read of the AL status shows now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// SubDevices that processed the copy on the main link, and on the redundant link.
    pub counts: [u16; 2],
    /// Their AL states, ORed.
    pub al_states: u8,
    /// Which links are up.
    pub is_up: [bool; 2],
}

impl Seen {
    /// SubDevices on both links.
    pub fn responding(&self) -> u16 {
        self.counts[0].saturating_add(self.counts[1])
    }
}

/// Reads the AL status of all SubDevices; `None` if the acyclic half has ended.
pub fn look(supervisor: &SupervisorThread) -> Option<Seen> {
    let ring = supervisor.with(|engine| engine.ring_status()).ok()?;
    let read = RawDatagram::new(Command::Brd, Target::Broadcast(map::AL_STATUS), [0; 2]);
    let replies = supervisor.datagrams(vec![read.with_resend(true)]).unwrap_or_default();
    let mut seen = Seen::default();
    if let Some(Ok(reply)) = replies.first() {
        seen.counts = [reply.main.0, reply.redundant.0];
        seen.al_states = reply.data.first().copied().unwrap_or(0) & AL_STATES;
    }
    for (number, link) in ring.links.iter().enumerate() {
        seen.is_up[number] = link.carrier.unwrap_or(seen.counts[number] > 0);
    }
    Some(seen)
}
