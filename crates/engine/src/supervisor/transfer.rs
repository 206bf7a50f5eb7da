//! Datagrams that procedures asked for, from the request to the reply.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD, Target};
use ringcat_wire::register::map;

use super::reply::{BusError, Reply};
use super::task::TaskId;
use crate::time::Instant;

/// What is asked of the bus.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub command: Command,
    pub target: Target,
    /// Data to send; zeros for reads.
    pub data: Vec<u8>,
    /// Data of the redundant copy, where it is not the same; of the same length.
    pub redundant: Option<Vec<u8>>,
    /// Station that the redundant copy addresses, where it is not the same.
    pub redundant_station: Option<StationAddress>,
    /// The working counter at which waiting for a second copy is pointless.
    pub expected: Option<Wkc>,
    /// Whether a lost datagram may be sent again: false where reading or writing twice is not the same as once.
    pub resend: bool,
    /// A datagram that goes before it in the same frame: a part of the same mail, or its [`Request::witness`].
    pub lead: Option<(Command, Target, Vec<u8>)>,
    /// A read of this SubDevice's mailbox: what each copy reads matters, also when it comes late.
    pub mail: Option<StationAddress>,
    /// So many more of the same go before it, in a frame that holds nothing else.
    pub before: usize,
    /// No other frame is to be on the wire while it is; the links on which copies are known not to come home, a bit
    /// each.
    pub alone: Option<u8>,
    /// The data is a system time of 32 bits that was right then; it leaves as what it is when the frame does.
    pub time_at: Option<Instant>,
}

impl Request {
    /// A datagram that is sent once, both copies alike, and waits for both.
    pub(crate) const fn once(command: Command, target: Target, data: Vec<u8>) -> Request {
        Request {
            command,
            target,
            data,
            redundant: None,
            redundant_station: None,
            expected: None,
            resend: false,
            lead: None,
            mail: None,
            before: 0,
            alone: None,
            time_at: None,
        }
    }

    /// Sets a time in the data forward to now.
    pub(super) fn let_run(&self, data: &mut [u8], now: Instant) {
        if let (Some(at), Some(bytes)) = (self.time_at, data.first_chunk_mut::<4>()) {
            *bytes = u32::from_le_bytes(*bytes).wrapping_add(now.0.wrapping_sub(at.0) as u32).to_le_bytes();
        }
    }

    /// Datagrams that it takes.
    pub(super) fn datagrams(&self) -> usize {
        1 + usize::from(self.lead.is_some()) + self.before
    }

    /// Bytes of a frame that it takes.
    pub(super) fn bytes(&self) -> usize {
        let lead = self.lead.as_ref().map_or(0, |(_, _, data)| OVERHEAD + data.len());
        lead + (1 + self.before) * (OVERHEAD + self.data.len())
    }

    /// A read of the SubDevice that ARMW and FRMW address: which copy meets it, their own working counters do not tell,
    /// because all others count too (protocol 9.3).
    pub(crate) fn witness(&self) -> Option<(Command, Target, Vec<u8>)> {
        let (command, target) = match (self.command, self.target) {
            (Command::Armw, Target::Position(position, _)) => (Command::Aprd, Target::Position(position, map::TYPE)),
            (Command::Frmw, Target::Station(station, _)) => (Command::Fprd, Target::Station(station, map::TYPE)),
            _ => return None,
        };
        let fits = self.data.len() + WITNESS_BYTES <= MAX_DATA;
        fits.then(|| (command, target, Vec::from([0])))
    }
}

/// What a [`Request::witness`] takes in a frame: a datagram of one byte.
pub(super) const WITNESS_BYTES: usize = OVERHEAD + 1;

/// How far a transfer is.
#[derive(Debug)]
pub(crate) enum Stage {
    /// Waits to be packed into a frame.
    Queued,
    /// Is in a frame that is out.
    InFlight,
    /// The procedure may fetch it.
    Done(Result<Reply, BusError>),
}

#[derive(Debug)]
pub(crate) struct Transfer {
    pub request: Request,
    pub stage: Stage,
    pub task: TaskId,
    pub retries: u8,
    /// The procedure no longer waits: freed as soon as it is not in a frame.
    pub abandoned: bool,
}

#[cfg(test)]
impl Transfer {
    /// A datagram to nobody.
    pub(crate) fn for_test() -> Transfer {
        let request = Request::once(Command::Nop, Target::None, Vec::new());
        Transfer { request, stage: Stage::Queued, task: TaskId(0), retries: 0, abandoned: false }
    }
}

/// A transfer in the table; the generation tells re-used places apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TransferId {
    index: u32,
    generation: u32,
}

/// All transfers that exist.
#[derive(Debug, Default)]
pub(crate) struct Transfers {
    entries: Vec<(u32, Option<Transfer>)>,
    free: Vec<u32>,
}

impl Transfers {
    pub(crate) fn insert(&mut self, transfer: Transfer) -> TransferId {
        let index = self.free.pop().unwrap_or_else(|| {
            self.entries.push((0, None));
            (self.entries.len() - 1) as u32
        });
        let entry = &mut self.entries[index as usize];
        entry.0 = entry.0.wrapping_add(1);
        entry.1 = Some(transfer);
        TransferId { index, generation: entry.0 }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.entries.len() - self.free.len()
    }

    pub(crate) fn find(&mut self, id: TransferId) -> Option<&mut Transfer> {
        let (generation, transfer) = self.entries.get_mut(id.index as usize)?;
        if *generation == id.generation { transfer.as_mut() } else { None }
    }

    pub(crate) fn remove(&mut self, id: TransferId) -> Option<Transfer> {
        let (generation, transfer) = self.entries.get_mut(id.index as usize)?;
        if *generation != id.generation {
            return None;
        }
        let removed = transfer.take();
        if removed.is_some() {
            self.free.push(id.index);
        }
        removed
    }
}
