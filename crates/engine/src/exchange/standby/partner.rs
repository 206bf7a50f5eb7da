//! State of the other MainDevice, as determined by the ACTIVE, from what comes back in its master frames (protocol
//! FR-11).

use alloc::sync::Arc;

use ringcat_wire::master_frame::Item;

use crate::exchange::master_frames::Returned;
use crate::role::Partner;

/// Cycles in a row without a sign of the other MainDevice after which it counts as gone: single frames are lost.
const PATIENCE: u8 = 3;

/// Derives the state of the other MainDevice from cycle to cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::exchange) struct PartnerWatch {
    partner: Partner,
    reported: Partner,
    /// Cycles in a row without a forwarded frame.
    unseen: u8,
    /// Cycles in a row without an answer.
    silent: u8,
}

impl PartnerWatch {
    pub fn partner(&self) -> Partner {
        self.partner
    }

    /// A cycle has brought this back. Returns the state if it is to be reported.
    pub fn note(&mut self, returned: &Returned) -> Option<Partner> {
        self.unseen = if returned.is_forwarded { 0 } else { self.unseen.saturating_add(1) };
        self.silent = if returned.answer.is_some() { 0 } else { self.silent.saturating_add(1) };
        self.partner = match (returned.answer, self.partner) {
            (Some(answer), _) => {
                Partner::Alive { stage: answer.stage, not_ready: answer.not_ready, is_consistent: returned.is_taken }
            }
            (None, alive @ Partner::Alive { .. }) if self.silent < PATIENCE => alive,
            (None, before) if self.unseen >= PATIENCE || before == Partner::Absent && self.unseen > 0 => {
                Partner::Absent
            }
            (None, _) => Partner::Forwards,
        };
        self.is_another().then(|| {
            self.reported = self.partner;
            self.partner
        })
    }

    /// Whether the state differs from the reported one in more than what a lost frame or a hand-over shows.
    fn is_another(&self) -> bool {
        match (self.partner, self.reported) {
            (Partner::Alive { not_ready: now, .. }, Partner::Alive { not_ready: before, .. }) => now != before,
            (now, before) => now != before,
        }
    }

    /// The role is another one now.
    pub fn forget(&mut self) {
        *self = PartnerWatch::default();
    }
}

/// The items of the configuration: one leaves in each cycle, those of the other MainDevice are compared.
#[derive(Debug)]
pub(in crate::exchange) struct Items {
    identity: u64,
    digests: Arc<[u32]>,
    next: u16,
    /// The difference that was reported, until the configurations are the same.
    reported: Option<u16>,
}

/// A difference between the configurations of both MainDevices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::exchange) enum Difference {
    /// An item, by its number.
    Item(u16),
    /// The number of items: here and there.
    Count { here: u16, there: u16 },
}

impl Items {
    pub fn new(identity: u64, digests: Arc<[u32]>) -> Items {
        Items { identity, digests, next: 0, reported: None }
    }

    /// The first item.
    pub fn first(&self) -> Item {
        self.at(0)
    }

    fn at(&self, number: u16) -> Item {
        let count = self.digests.len() as u16;
        Item { number, count, digest: self.digests.get(usize::from(number)).copied().unwrap_or_default() }
    }

    /// The item of the next cycle.
    pub fn next(&mut self) -> Item {
        self.next = if usize::from(self.next) + 1 < self.digests.len() { self.next + 1 } else { 0 };
        self.at(self.next)
    }

    /// Compares the configuration of the other MainDevice. Returns a difference once. One without items has not loaded
    /// its configuration yet.
    pub fn compare(&mut self, identity: u64, item: Item) -> Option<Difference> {
        if identity == self.identity {
            self.reported = None;
            return None;
        }
        if self.reported.is_some() || item.count == 0 {
            return None;
        }
        let here = self.digests.len() as u16;
        let own = self.at(item.number);
        let difference = match item.count == here {
            true if own.digest == item.digest => return None,
            true => Difference::Item(item.number),
            false => Difference::Count { here, there: item.count },
        };
        self.reported = Some(item.number);
        Some(difference)
    }

    /// Whether a digest is that of the own configuration.
    pub fn is_same(&self, identity: u64) -> bool {
        identity == self.identity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::master_frame::{Answer, NotReady, Stage};

    fn answered(stage: Stage, not_ready: NotReady) -> Returned {
        let mut answer = Answer::new();
        (answer.stage, answer.not_ready) = (stage, not_ready);
        Returned { is_forwarded: true, is_taken: true, answer: Some(answer), ..Returned::default() }
    }

    // covers: FR-11, 9.16, standby
    #[test]
    fn absent_forwarding_and_alive_differ_and_single_losses_are_not_reported() {
        let mut watch = PartnerWatch::default();
        let nothing = Returned::default();
        let forwarded = Returned { is_forwarded: true, ..nothing };
        assert_eq!(watch.note(&nothing), None);
        assert_eq!(watch.note(&forwarded), Some(Partner::Forwards));
        let follows = watch.note(&answered(Stage::Follows, NotReady::NO_CYCLE)).expect("it is new");
        assert!(matches!(follows, Partner::Alive { stage: Stage::Follows, .. }) && !follows.is_ready());
        assert!(watch.note(&answered(Stage::Ready, NotReady::NOTHING)).is_some_and(|partner| partner.is_ready()));
        assert_eq!(watch.note(&answered(Stage::Accepts, NotReady::NOTHING)), None);
        assert_eq!((watch.note(&nothing), watch.note(&nothing)), (None, None));
        assert_eq!(watch.note(&answered(Stage::Ready, NotReady::NOTHING)), None);
        assert_eq!((watch.note(&forwarded), watch.note(&forwarded)), (None, None));
        assert_eq!(watch.note(&forwarded), Some(Partner::Forwards), "its software is silent");
        assert_eq!((watch.note(&nothing), watch.note(&nothing)), (None, None));
        assert_eq!(watch.note(&nothing), Some(Partner::Absent));
    }

    // covers: REQ010, MR-15, standby
    #[test]
    fn a_difference_of_configurations_is_named_once() {
        let mut items = Items::new(7, [1, 2, 3].into());
        let item = |number, digest| Item { number, count: 3, digest };
        assert_eq!(items.compare(7, item(1, 9)), None, "the configuration as a whole is the same");
        assert_eq!(items.compare(0, Item { number: 0, count: 0, digest: 0 }), None, "it has none yet");
        assert_eq!(items.compare(8, item(0, 1)), None);
        assert_eq!(items.compare(8, item(1, 9)), Some(Difference::Item(1)));
        assert_eq!(items.compare(8, item(1, 9)), None);
        assert_eq!(items.compare(7, item(1, 2)), None);
        let other = Item { number: 0, count: 4, digest: 1 };
        assert_eq!(items.compare(8, other), Some(Difference::Count { here: 3, there: 4 }));
        assert_eq!([0; 4].map(|_| items.next().number), [1, 2, 0, 1]);
    }
}
