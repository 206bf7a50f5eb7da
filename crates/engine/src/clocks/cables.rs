//! What is known about the cables of a segment, so that a delay that cannot be measured now is known from before.
//!
//! A frame meets the members of a whole ring only once, and what is between them cannot be measured then. It was while
//! the ring was open: at the set-up, which opens it for that, or while it was broken.

use alloc::collections::BTreeMap;

use ringcat_wire::address::StationAddress;

/// A port, by the station address of its SubDevice.
pub type End = (StationAddress, u8);
/// Both ends of a cable, the smaller one first.
type Ends = (End, End);

#[derive(Clone, Copy, Debug)]
struct Known {
    time: i64,
    /// It has been away since: what is plugged in there now may be another one.
    is_old: bool,
}

/// Times on cables, with what all passages take ([`Passage`](super::delay::Passage)).
#[derive(Clone, Debug, Default)]
pub struct Cables {
    known: BTreeMap<Ends, Known>,
}

impl Cables {
    /// These cables are there, and no others.
    pub fn see(&mut self, present: impl Iterator<Item = (End, End)>) {
        let present: alloc::collections::BTreeSet<Ends> = present.map(ends).collect();
        for (ends, known) in &mut self.known {
            known.is_old |= !present.contains(ends);
        }
    }

    /// A cable was measured.
    pub(super) fn learn(&mut self, one: End, other: End, time: i64) {
        self.known.insert(ends((one, other)), Known { time, is_old: false });
    }

    /// Time on a cable that has not been away since it was measured.
    pub(super) fn measured(&self, one: End, other: End) -> Option<i64> {
        self.known.get(&ends((one, other))).filter(|known| !known.is_old).map(|known| known.time)
    }

    /// Time on a cable, as measured last.
    pub(super) fn remembered(&self, one: End, other: End) -> Option<i64> {
        self.known.get(&ends((one, other))).map(|known| known.time)
    }
}

fn ends((one, other): (End, End)) -> Ends {
    if one <= other { (one, other) } else { (other, one) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cable_that_was_away_is_remembered_and_counts_as_measured_no_longer() {
        let (one, other) = ((StationAddress(7), 1), (StationAddress(3), 0));
        let mut cables = Cables::default();
        cables.learn(one, other, 350);
        cables.see([(other, one)].into_iter());
        assert_eq!((cables.measured(other, one), cables.remembered(one, other)), (Some(350), Some(350)));
        cables.see(core::iter::empty());
        cables.see([(other, one)].into_iter());
        assert_eq!((cables.measured(other, one), cables.remembered(one, other)), (None, Some(350)));
        cables.learn(other, one, 360);
        assert_eq!(cables.measured(one, other), Some(360));
    }
}
