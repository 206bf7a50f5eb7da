//! A frame that may be sent again within its cycle, and what its tries have proved (decision 0045).
//!
//! Each try is evaluated by itself: working counters of different tries are never added. A try proves, for each
//! SubDevice of a datagram, that it took the outputs or delivered the inputs. A cycle is complete if one try is
//! complete, or if the tries together have proved each SubDevice. The bytes of outputs are those of the first try.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::flight::CyclicFrame;
use super::image::InputNumber;
use super::proved::Proved;
use super::round_trip::RoundTrip;
use crate::board::Board;
use crate::layout::{OutputsAgain, Piece, PlannedFrame, PlannedRepeat, RepeatRule};
use crate::link::Link;
use crate::ring::Identity;
use crate::time::Instant;

/// Grid of SYNC0 signals: outputs may not be repeated across one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SyncGrid {
    cycle_ns: u64,
    shift_ns: i64,
}

impl SyncGrid {
    /// Whether a signal occurs between two system times.
    pub fn lies_between(self, first: u64, last: u64) -> bool {
        let number = |time: u64| (i128::from(time) - i128::from(self.shift_ns)).div_euclid(self.cycle_ns.into());
        self.cycle_ns == 0 || number(first) != number(last)
    }
}

/// Proof about one SubDevice in a datagram of the frame.
#[derive(Clone, Copy, Debug)]
struct Proof {
    datagram: usize,
    /// Index of the SubDevice among the contributions of the datagram.
    contribution: usize,
    subdevice: usize,
    /// Its increment of the working counter.
    wkc: u16,
    needed: Proved,
    found: Proved,
}

/// Stage of the tries of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Tries {
    /// Only the first try was sent.
    #[default]
    First,
    /// The frame is to be sent again at once: the ring changed while the copies of a try were on the wire.
    Due,
    /// It was sent again.
    Again,
    /// It is sent no more in this cycle.
    Over,
    /// The tries together are complete.
    Complete,
}

/// A frame that may be sent again.
#[derive(Debug)]
pub(super) struct Again {
    /// The frame of the further tries.
    pub frame: CyclicFrame,
    /// The round trip of the first try.
    pub round_trip: RoundTrip,
    pieces: Box<[Piece]>,
    proofs: Box<[Proof]>,
    grids: Box<[SyncGrid]>,
    tries: Tries,
    /// The frame was sent again in the cycle.
    was_sent: bool,
    /// The cycle of these tries: that of the first try's departure, plus one.
    left: u64,
    /// When the last try left.
    pub sent_at: Instant,
}

impl Again {
    /// `number`: numbers of the first datagram and the first inputs of the frame in the image.
    pub fn new(
        identity: &Identity,
        first: &CyclicFrame,
        (frame, repeat): (&PlannedFrame, &PlannedRepeat),
        number: InputNumber,
        rule: impl Fn(usize) -> RepeatRule,
    ) -> Again {
        let mut again = CyclicFrame::new(identity, first.all_links(), first.domain(), &repeat.frame, number);
        let numbers = repeat.pieces.iter().map(|piece| {
            let before: usize = frame.datagrams.iter().take(piece.datagram).map(|it| it.input_areas.len()).sum();
            InputNumber { datagram: number.datagram + piece.datagram, part: number.part + before + piece.first_part }
        });
        again.renumber(numbers);
        let mut proofs = Vec::new();
        for (datagram, contribution, subdevice, wkc, needed) in first.contributions() {
            proofs.push(Proof { datagram, contribution, subdevice, wkc, needed, found: Proved::default() });
        }
        let written = repeat.frame.datagrams.iter().filter(|datagram| datagram.outputs > 0);
        let subdevices = written.flat_map(|datagram| datagram.contributions.iter().map(|(subdevice, _)| *subdevice));
        let mut grids: Vec<SyncGrid> = Vec::new();
        for subdevice in subdevices {
            if let OutputsAgain::BeforeSync0 { cycle_ns, shift_ns } = rule(subdevice).outputs {
                let grid = SyncGrid { cycle_ns: cycle_ns.into(), shift_ns: shift_ns.into() };
                if !grids.contains(&grid) {
                    grids.push(grid);
                }
            }
        }
        Again {
            frame: again,
            round_trip: RoundTrip::default(),
            pieces: repeat.pieces.clone().into_boxed_slice(),
            proofs: proofs.into_boxed_slice(),
            grids: grids.into_boxed_slice(),
            tries: Tries::First,
            was_sent: false,
            left: 0,
            sent_at: Instant::NEVER,
        }
    }

    /// Stage of the tries in the cycle that left then.
    pub fn tries(&self, left: u64) -> Tries {
        if self.left == left { self.tries } else { Tries::First }
    }

    /// Sets the stage of the tries in the cycle of this first try.
    pub fn set_tries(&mut self, first: &CyclicFrame, tries: Tries) {
        if self.left != first.left() {
            self.left = first.left();
            self.was_sent = false;
            self.proofs.iter_mut().for_each(|proof| proof.found = Proved::default());
        }
        self.tries = tries;
    }

    /// Whether the frame was sent again in the cycle that left then.
    pub fn was_sent(&self, left: u64) -> bool {
        self.left == left && self.was_sent
    }

    /// SYNC0 signals that the outputs of a further try must not pass.
    pub fn grids(&self) -> &[SyncGrid] {
        &self.grids
    }

    /// Prepares a further try with the outputs of the first one.
    pub fn load(&mut self, first: &CyclicFrame, board: &Board, now: Instant) {
        if self.was_sent(first.left()) {
            self.gather_own();
        } else {
            self.set_tries(first, Tries::Again);
            self.gather_first(first);
        }
        (self.tries, self.was_sent, self.sent_at) = (Tries::Again, true, now);
        self.frame.close();
        let changes = board.taking_part_changes();
        if !self.frame.is_ready(changes) {
            self.frame.follow(changes, board);
        }
        let datagrams = self.pieces.iter().map(|piece| piece.datagram);
        self.frame.load_again(first, datagrams);
    }

    /// Collects what copies of the first try prove.
    pub fn gather_first(&mut self, first: &CyclicFrame) {
        for proof in &mut self.proofs {
            proof.found.add(first.proves(proof.datagram, proof.subdevice));
        }
    }

    /// Collects what copies of the last further try prove.
    pub fn gather_own(&mut self) {
        for (place, piece) in self.pieces.iter().enumerate() {
            for proof in self.proofs.iter_mut().filter(|proof| proof.datagram == piece.datagram) {
                proof.found.add(self.frame.proves(place, proof.subdevice));
            }
        }
    }

    /// Whether the tries together are complete: each required SubDevice took its outputs and delivered its inputs.
    pub fn is_proved(&self, first: &CyclicFrame) -> bool {
        let is_met =
            |proof: &Proof| proof.found.holds(proof.needed) || !first.requires(proof.datagram, proof.contribution);
        self.proofs.iter().all(is_met)
    }

    /// The increment of a SubDevice in a datagram, by their indices in the first try, if the tries have proved it.
    pub fn proved(&self, datagram: usize, contribution: usize) -> Option<u16> {
        let mut own = self.proofs.iter().filter(|it| it.datagram == datagram && it.contribution == contribution);
        own.find(|proof| proof.found.holds(proof.needed)).map(|proof| proof.wkc)
    }

    /// Sum of the increments that are proved.
    pub fn wkc(&self) -> u32 {
        let found = self.proofs.iter().filter(|proof| proof.found.holds(proof.needed));
        found.map(|proof| u32::from(proof.wkc)).sum()
    }

    /// Counts an error for each expected SubDevice that no try has proved.
    pub fn count_errors(&self, first: &CyclicFrame, board: &Board) {
        let missing = self.proofs.iter().filter(|proof| !proof.found.holds(proof.needed));
        let expected = missing.filter(|proof| first.expects(proof.datagram, proof.contribution));
        let mut last = None;
        for proof in expected {
            board.count_wkc_error(proof.subdevice);
            if last.replace(proof.datagram) != Some(proof.datagram) {
                first.post_error(proof.datagram, board);
            }
        }
    }
}

/// Whether copies of one try show a change of the ring while they were on the wire: they took ways that do not belong
/// together.
pub(super) fn is_mixed(frame: &CyclicFrame) -> bool {
    let arrivals = frame.arrivals();
    let both = Link::Main.bit() | Link::Redundant.bit();
    arrivals.arrived == both && (arrivals.returned == Link::Main.bit() || arrivals.returned == Link::Redundant.bit())
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: lost-frames
    #[test]
    fn a_grid_separates_the_times_before_and_after_its_signals() {
        let grid = SyncGrid { cycle_ns: 1_000_000, shift_ns: -200_000 };
        assert!(!grid.lies_between(0, 799_999));
        assert!(grid.lies_between(0, 800_000));
        assert!(grid.lies_between(799_999, 1_900_000));
        assert!(SyncGrid { cycle_ns: 0, shift_ns: 0 }.lies_between(0, 0), "a single pulse has no grid");
    }
}
