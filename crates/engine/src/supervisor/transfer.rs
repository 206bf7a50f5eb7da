//! Datagrams of procedures, from the request to the reply.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD, Target};
use ringcat_wire::register::map;

use super::command_reports::WrongCommand;
use super::reply::{BusError, Reply};
use super::task::TaskId;
use crate::time::Instant;

/// Size of a group of requests, or of the rest of a group after one of its requests. A group is sent in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rest {
    pub bytes: usize,
    pub datagrams: usize,
}

impl Rest {
    /// After the last request of a group, and after a request without a group.
    pub(super) const NONE: Rest = Rest { bytes: 0, datagrams: 0 };
}

/// A request to the bus.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub command: Command,
    pub target: Target,
    /// Data to send; zeros for reads.
    pub data: Vec<u8>,
    /// Data of the redundant copy, if it differs; of the same length.
    pub redundant: Option<Vec<u8>>,
    /// Station that the redundant copy addresses, if it differs.
    pub redundant_station: Option<StationAddress>,
    /// The working counter with which a second copy need not be awaited.
    pub expected: Option<Wkc>,
    /// Whether a lost datagram may be repeated: false if a second access has another effect than one.
    pub resend: bool,
    /// A datagram that precedes it in the same frame: a part of the same mail, or its [`Request::witness`].
    pub preceding: Option<(Command, Target, Vec<u8>)>,
    /// Set for a read of this SubDevice's mailbox: the content of every copy is kept, also of a late one.
    pub mail: Option<StationAddress>,
    /// It is repeated until its working counter is as expected, so that another one is no error: a mailbox is full or
    /// empty.
    pub polls: bool,
    /// It is sent before all datagrams that wait.
    pub urgent: bool,
    /// The requests that follow it in the same frame ([`super::Bus::transfer_together`]).
    pub rest: Rest,
    /// Number of further datagrams of the same kind before it, in a frame of their own.
    pub before: usize,
    /// Set if no other frame may be on the wire with it: the links on which copies are known not to return, a bit each.
    pub alone: Option<u8>,
    /// Set if the data is a system time of 32 bits: the host time at which it is valid. It is adjusted to the departure
    /// of the frame.
    pub time_at: Option<Instant>,
}

impl Request {
    /// A datagram that is sent once, with both copies equal, and waits for both.
    pub(crate) const fn once(command: Command, target: Target, data: Vec<u8>) -> Request {
        Request {
            command,
            target,
            data,
            redundant: None,
            redundant_station: None,
            expected: None,
            resend: false,
            preceding: None,
            mail: None,
            polls: false,
            urgent: false,
            rest: Rest::NONE,
            before: 0,
            alone: None,
            time_at: None,
        }
    }

    /// The datagram, if this working counter is a wrong one.
    pub(super) fn wrong_command(&self, got: Wkc) -> Option<WrongCommand> {
        let expected = self.expected.filter(|expected| *expected != got && !self.polls)?;
        Some(WrongCommand { command: self.command, target: self.target, expected, got, count: 1 })
    }

    /// Advances a time in the data to now.
    pub(super) fn advance_time(&self, data: &mut [u8], now: Instant) {
        if let (Some(at), Some(bytes)) = (self.time_at, data.first_chunk_mut::<4>()) {
            *bytes = u32::from_le_bytes(*bytes).wrapping_add(now.0.wrapping_sub(at.0) as u32).to_le_bytes();
        }
    }

    /// Number of its datagrams.
    pub(super) fn datagrams(&self) -> usize {
        1 + usize::from(self.preceding.is_some()) + self.before
    }

    /// Its length in a frame in bytes.
    pub(super) fn bytes(&self) -> usize {
        let preceding = self.preceding.as_ref().map_or(0, |(_, _, data)| OVERHEAD + data.len());
        preceding + (1 + self.before) * (OVERHEAD + self.data.len())
    }

    /// Size of this request and of the rest of its group in a frame.
    pub(super) fn group(&self) -> Rest {
        Rest { bytes: self.bytes() + self.rest.bytes, datagrams: self.datagrams() + self.rest.datagrams }
    }

    /// A read of the SubDevice that ARMW and FRMW address. It shows which copy reaches that SubDevice; the working
    /// counters of ARMW and FRMW do not, because all other SubDevices increment them too (protocol 9.3).
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

/// Length of a [`Request::witness`] in a frame: a datagram of one byte.
pub(super) const WITNESS_BYTES: usize = OVERHEAD + 1;

/// Stage of a transfer.
#[derive(Debug)]
pub(crate) enum Stage {
    /// Waits for a frame.
    Queued,
    /// Is in a frame on the wire.
    InFlight,
    /// Its reply can be fetched.
    Done(Result<Reply, BusError>),
}

#[derive(Debug)]
pub(crate) struct Transfer {
    pub request: Request,
    pub stage: Stage,
    pub task: TaskId,
    pub retries: u8,
    /// The procedure gave it up: it is freed as soon as no frame contains it.
    pub abandoned: bool,
}

#[cfg(test)]
impl Transfer {
    /// A datagram without a target.
    pub(crate) fn for_test() -> Transfer {
        let request = Request::once(Command::Nop, Target::None, Vec::new());
        Transfer { request, stage: Stage::Queued, task: TaskId(0), retries: 0, abandoned: false }
    }
}

/// Index of a transfer in the table; the generation distinguishes reused entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TransferId {
    index: u32,
    generation: u32,
}

/// All existing transfers.
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

    /// Number of transfers.
    pub(crate) fn count(&self) -> usize {
        self.entries.len() - self.free.len()
    }

    pub(crate) fn find(&mut self, id: TransferId) -> Option<&mut Transfer> {
        let (generation, transfer) = self.entries.get_mut(id.index as usize)?;
        if *generation == id.generation { transfer.as_mut() } else { None }
    }

    /// The memory of the data that was sent, for the data of the reply.
    pub(crate) fn take_data(&mut self, id: TransferId) -> Vec<u8> {
        self.find(id).map_or_else(Vec::new, |transfer| core::mem::take(&mut transfer.request.data))
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
