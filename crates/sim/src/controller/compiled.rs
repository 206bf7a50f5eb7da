//! Precomputed effect of equal logical datagrams on this controller.
//!
//! Input: a datagram's command, address and length, and the current FMMUs and SyncManagers. Output: the affected pieces
//! of memory, which are then copied without a search. Only simple cases are precomputed: whole bytes, each piece in one
//! area of process RAM or the AL status, no byte both read and written. [`super::processing`] handles all others. A
//! write to a relevant register discards all results.

mod known;

use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use super::Controller;
use super::fmmu::{Direction, Piece};
use super::memory::{PROCESS_RAM, Side};
use super::sync_manager::Claim;
use known::{AL_STATUS, FREE, Known, Move, PIECES};

pub(super) use known::Compiled;

impl Controller {
    /// Copies the data of a logical datagram that addresses this controller. Returns whether data was read and whether
    /// data was written; `None` for a case that is not simple.
    pub(super) fn logical_compiled(&mut self, command: Command, address: u32, data: &mut [u8]) -> Option<(bool, bool)> {
        let len = u16::try_from(data.len()).ok()?;
        let known = match self.compiled.find(command, address, len) {
            Some(known) => *known,
            None => {
                let known = self.compile(command, address, len);
                self.compiled.keep(known);
                known
            }
        };
        let (mut read, mut written) = (false, false);
        for piece in known.moves.get(..usize::from(known.count?))? {
            let data = data.get_mut(usize::from(piece.at)..usize::from(piece.at) + usize::from(piece.len))?;
            let Some(physical) = self.piece_address(*piece) else { continue };
            self.logical_log.moved(piece.at.into(), piece.len.into(), piece.write);
            if piece.write {
                self.memory.store(physical, data);
                written = true;
            } else {
                // Usually one or two bytes: a loop is faster than a call.
                let from = self.memory.span(physical, data.len());
                data.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
                read = true;
            }
        }
        Some((read, written))
    }

    /// Current address of a piece, if its SyncManager grants the access.
    #[inline]
    fn piece_address(&mut self, piece: Move) -> Option<u32> {
        let (start, end) = (u32::from(piece.physical), u32::from(piece.physical) + u32::from(piece.len));
        if piece.sync_manager >= AL_STATUS {
            self.pass.read_al_status |= piece.sync_manager == AL_STATUS;
            return Some(start);
        }
        let n = usize::from(piece.sync_manager);
        let grant = self.sync_managers.access(n, Side::Ecat, piece.write, start, end)?;
        self.pass.sync_managers |= 1 << n;
        (grant.address + u32::from(piece.len) <= self.memory.len()).then_some(grant.address)
    }

    fn compile(&self, command: Command, address: u32, len: u16) -> Known {
        let mut known = Known { command, address, len, count: None, moves: [Move::default(); PIECES] };
        known.count = self.compile_moves(command, address, len, &mut known.moves);
        known
    }

    fn compile_moves(&self, command: Command, address: u32, len: u16, moves: &mut [Move; PIECES]) -> Option<u8> {
        let protected = self.memory.u8(map::ESC_WRITE_PROTECTION) & 1 != 0;
        if !self.memory.process_ram_open || protected && command.writes() {
            return None;
        }
        let first = u64::from(address) * 8;
        let end = first + u64::from(len) * 8;
        let mut count = 0;
        for (wanted, direction) in [(command.reads(), Direction::Read), (command.writes(), Direction::Write)] {
            for n in (0..self.fmmus.count()).filter(|_| wanted) {
                let mut from = first;
                while let Some(piece) = self.fmmus.piece(n, direction, from, end) {
                    *moves.get_mut(count)? = self.compile_piece(piece, first, direction == Direction::Write)?;
                    count += 1;
                    from = piece.logical + piece.len;
                }
            }
        }
        let moves = &moves[..count];
        let meets = |one: &Move, other: &Move| one.at < other.at + other.len && other.at < one.at + one.len;
        let reads_into = |write: &Move| moves.iter().any(|read| !read.write && meets(read, write));
        let crossed = moves.iter().filter(|one| one.write).any(reads_into);
        if crossed { None } else { u8::try_from(count).ok() }
    }

    /// A piece of whole bytes in one area of process RAM.
    fn compile_piece(&self, piece: Piece, base: u64, write: bool) -> Option<Move> {
        let at = piece.logical - base;
        if (at | piece.physical | piece.len) & 7 != 0 {
            return None;
        }
        let (start, end) = (piece.physical / 8, (piece.physical + piece.len) / 8);
        let is_al_status = !write && (start, end) == (u64::from(map::AL_STATUS.0), u64::from(map::AL_STATUS.0) + 1);
        if (start < u64::from(PROCESS_RAM) && !is_al_status) || end > u64::from(self.memory.len()) {
            return None;
        }
        let end = u32::try_from(end).ok()?;
        let sync_manager = match self.sync_managers.claim(start as u32, end) {
            _ if is_al_status => AL_STATUS,
            Claim::Free(until) if until == end => FREE,
            Claim::Area(n, until) if until == end => n as u8,
            Claim::Free(_) | Claim::Area(..) | Claim::Locked(_) => return None,
        };
        let (at, len) = (u16::try_from(at / 8).ok()?, u16::try_from(piece.len / 8).ok()?);
        Some(Move { write, sync_manager, at, len, physical: u16::try_from(start).ok()? })
    }
}
