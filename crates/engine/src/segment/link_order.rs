//! The link that is disconnected on purpose, and the order to the link layer to disconnect it or to reconnect it.
//!
//! The runtime fetches an order, carries it out if it can, and answers. This is optional: an order that it does not
//! fetch counts as refused. A link that was disconnected is reconnected when its procedure has ended, whatever has
//! ended it; an order that is carried out after its procedure has given up waiting is undone.

use super::effect::{Effect, Effects};
use crate::link::{Link, LinkOrder};

/// What happens to an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkObservation {
    /// A procedure gives it.
    Ordered(LinkOrder),
    /// The runtime has fetched it.
    Fetched,
    /// The link layer has carried it out, or refused it.
    Answered(bool),
    /// Its procedure has the answer, or no longer waits for it.
    Ended,
    /// The link that was disconnected is up again, or is no longer waited for.
    Connected,
}

/// Progress of the last order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    /// Not fetched yet.
    Given,
    /// It is being carried out.
    Fetched,
    /// The same, and its procedure no longer waits for the answer.
    Abandoned,
    /// It was carried out, or refused.
    Answered(bool),
}

/// The last order, and what follows from it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkControl {
    order: Option<(LinkOrder, Progress)>,
    /// The link that is down by an order.
    disconnected: Option<Link>,
    /// A link was disconnected by an order, and is not known to be up again.
    returns: bool,
}

impl LinkControl {
    /// The answer to the order of the procedure that waits for it.
    pub fn answer(&self) -> Option<bool> {
        match self.order {
            Some((_, Progress::Answered(is_done))) => Some(is_done),
            _ => None,
        }
    }

    /// Whether a link is down by an order, or comes up again after one.
    pub fn is_returning(&self) -> bool {
        self.returns
    }

    /// Whether a link is down by an order.
    pub fn is_down(&self) -> bool {
        self.disconnected.is_some()
    }

    /// Observes the course of an order.
    pub fn observe(&mut self, seen: LinkObservation, effects: &mut Effects) {
        match (seen, self.order) {
            (LinkObservation::Ordered(order), _) => self.give(order, effects),
            (LinkObservation::Fetched, Some((order, Progress::Given))) => {
                self.disconnected = order.disconnect.then_some(order.link);
                self.returns |= order.disconnect;
                self.order = Some((order, Progress::Fetched));
            }
            (LinkObservation::Answered(is_done), Some((order, Progress::Fetched))) => {
                self.note_refusal(order, is_done);
                self.order = Some((order, Progress::Answered(is_done)));
            }
            (LinkObservation::Answered(is_done), Some((order, Progress::Abandoned))) => {
                self.note_refusal(order, is_done);
                self.order = None;
                self.restore(effects);
            }
            (LinkObservation::Ended, Some((_, Progress::Given))) => {
                self.order = None;
                effects.0.push(Effect::OrderLink(None));
            }
            (LinkObservation::Ended, Some((order, Progress::Fetched))) => {
                self.order = Some((order, Progress::Abandoned));
            }
            (LinkObservation::Ended, Some((_, Progress::Answered(_)))) => self.order = None,
            (LinkObservation::Connected, _) => self.returns = false,
            (LinkObservation::Ended, Some((_, Progress::Abandoned)) | None)
            | (LinkObservation::Fetched | LinkObservation::Answered(_), _) => {}
        }
    }

    /// The procedure that would reconnect the link has ended. An order that was not fetched is taken back.
    pub fn restore(&mut self, effects: &mut Effects) {
        let is_given = matches!(self.order.take(), Some((_, Progress::Given)));
        match self.disconnected {
            Some(link) => self.give(LinkOrder { link, disconnect: false }, effects),
            None if is_given => effects.0.push(Effect::OrderLink(None)),
            None => {}
        }
    }

    fn give(&mut self, order: LinkOrder, effects: &mut Effects) {
        self.order = Some((order, Progress::Given));
        effects.0.push(Effect::OrderLink(Some(order)));
    }

    fn note_refusal(&mut self, order: LinkOrder, is_done: bool) {
        if order.disconnect && !is_done {
            (self.disconnected, self.returns) = (None, false);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use super::LinkObservation::{Answered, Connected, Ended, Fetched, Ordered};
    use super::*;

    const DOWN: LinkOrder = LinkOrder { link: Link::Redundant, disconnect: true };
    const UP: LinkOrder = LinkOrder { disconnect: false, ..DOWN };

    /// Orders to the runtime that follow from observations; `None` takes an order back.
    fn orders(control: &mut LinkControl, seen: &[LinkObservation]) -> Vec<Option<LinkOrder>> {
        let mut effects = Effects::default();
        seen.iter().for_each(|seen| control.observe(*seen, &mut effects));
        of(&effects)
    }

    fn of(effects: &Effects) -> Vec<Option<LinkOrder>> {
        let order = |effect: &Effect| match effect {
            Effect::OrderLink(order) => *order,
            _ => panic!("{effect:?}"),
        };
        effects.0.iter().map(order).collect()
    }

    /// Orders at the end of an application.
    fn at_the_end(mut control: LinkControl) -> Vec<Option<LinkOrder>> {
        let mut effects = Effects::default();
        control.restore(&mut effects);
        of(&effects)
    }

    #[test]
    fn a_link_that_is_down_at_the_end_is_reconnected_and_no_other() {
        for (seen, at_end) in [
            (&[][..], vec![]),
            (&[Ordered(DOWN)], vec![None]),
            (&[Ordered(DOWN), Fetched], vec![Some(UP)]),
            (&[Ordered(DOWN), Fetched, Answered(true)], vec![Some(UP)]),
            (&[Ordered(DOWN), Fetched, Answered(true), Ended], vec![Some(UP)]),
            (&[Ordered(DOWN), Fetched, Answered(false)], vec![]),
            (&[Ordered(DOWN), Fetched, Answered(true), Ended, Ordered(UP)], vec![Some(UP)]),
            (&[Ordered(DOWN), Fetched, Answered(true), Ended, Ordered(UP), Fetched], vec![]),
        ] {
            let mut control = LinkControl::default();
            orders(&mut control, seen);
            assert_eq!(at_the_end(control), at_end, "{seen:?}");
        }
    }

    #[test]
    fn a_reconnection_that_was_not_fetched_is_ordered_again() {
        let mut control = LinkControl::default();
        orders(&mut control, &[Ordered(DOWN), Fetched, Answered(true), Ended]);
        control.restore(&mut Effects::default());
        assert_eq!(at_the_end(control), [Some(UP)]);
    }

    #[test]
    fn a_disconnected_link_counts_as_returning_until_it_is_up() {
        for (seen, returns) in [
            (&[Ordered(DOWN)][..], false),
            (&[Ordered(DOWN), Fetched], true),
            (&[Ordered(DOWN), Fetched, Answered(false)], false),
            (&[Ordered(DOWN), Fetched, Answered(true), Ended, Ordered(UP), Fetched, Answered(true), Ended], true),
            (&[Ordered(DOWN), Fetched, Answered(true), Ended, Ordered(UP), Fetched, Connected], false),
        ] {
            let mut control = LinkControl::default();
            orders(&mut control, seen);
            control.restore(&mut Effects::default());
            assert_eq!(control.is_returning(), returns, "{seen:?}");
        }
    }

    #[test]
    fn an_order_that_is_carried_out_too_late_is_undone() {
        let mut control = LinkControl::default();
        assert_eq!(orders(&mut control, &[Ordered(DOWN), Fetched, Ended, Answered(true)]), [Some(DOWN), Some(UP)]);
        assert_eq!(control.answer(), None);
        assert_eq!(orders(&mut control, &[Fetched, Answered(true)]), []);
        assert_eq!(at_the_end(control), []);
        let mut refused = LinkControl::default();
        assert_eq!(orders(&mut refused, &[Ordered(DOWN), Fetched, Ended, Answered(false)]), [Some(DOWN)]);
    }

    #[test]
    fn an_order_that_is_not_fetched_in_time_is_taken_back() {
        let mut control = LinkControl::default();
        assert_eq!(orders(&mut control, &[Ordered(DOWN), Ended]), [Some(DOWN), None]);
        assert_eq!(orders(&mut control, &[Fetched, Answered(true)]), [], "it is too late");
        assert_eq!(at_the_end(control), []);
    }
}
