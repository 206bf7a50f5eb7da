//! The event queue of virtual time.
//!
//! Input: events with their due times. Output: the events in the order of time; events of the same time in the order of
//! insertion, so that every run is the same. Events are stored in lanes, so that a caller that processes some kinds of
//! events ahead of time can read when the others are due. The queue reuses its memory: after its maximum length, it
//! does not allocate.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::time::SimTime;

/// Kinds of events with a separate query for the next due time. Their order is common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    /// All other events.
    Any = 0,
    /// Frames of the main interface that enter the segment and change no paths.
    EntryMain = 1,
    /// Frames of the redundant interface that enter the segment and change no paths.
    EntryRedundant = 2,
    /// Frames that have passed all devices.
    Exit = 3,
}

const LANES: usize = 4;

/// Events ordered by time.
#[derive(Debug)]
pub(crate) struct EventQueue<E> {
    lanes: [BinaryHeap<Entry<E>>; LANES],
    sequence: u64,
}

#[derive(Debug)]
struct Entry<E> {
    at: SimTime,
    sequence: u64,
    event: E,
}

impl<E> PartialEq for Entry<E> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<E> Eq for Entry<E> {}

impl<E> PartialOrd for Entry<E> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<E> Ord for Entry<E> {
    /// The heap returns its greatest entry first, which has to be the earliest.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.at, other.sequence).cmp(&(self.at, self.sequence))
    }
}

impl<E: Copy> EventQueue<E> {
    /// An empty queue with this capacity in each lane.
    pub(crate) fn with_capacity(capacity: usize) -> EventQueue<E> {
        let mut lanes = [const { BinaryHeap::new() }; LANES];
        lanes[Lane::Any as usize].reserve(capacity);
        EventQueue { lanes, sequence: 0 }
    }

    /// Inserts an event.
    pub(crate) fn push(&mut self, lane: Lane, at: SimTime, event: E) {
        self.sequence += 1;
        self.lanes[lane as usize].push(Entry { at, sequence: self.sequence, event });
    }

    /// Inserts an event and removes the earliest that is due by `limit`, which may be the new one: the step of a frame
    /// from one device to the next, which is mostly the earliest event.
    pub(crate) fn push_pop(&mut self, at: SimTime, event: E, limit: SimTime) -> Option<(SimTime, E)> {
        if self.next_at().is_none_or(|first| at < first) && at <= limit {
            return Some((at, event));
        }
        self.push(Lane::Any, at, event);
        self.pop_until(limit)
    }

    /// Removes the earliest event that is due by `limit`.
    pub(crate) fn pop_until(&mut self, limit: SimTime) -> Option<(SimTime, E)> {
        let order = |heap: &BinaryHeap<Entry<E>>| heap.peek().map(|first| (first.at, first.sequence));
        let mut earliest = None;
        for (lane, heap) in self.lanes.iter().enumerate() {
            if let Some(first) = order(heap)
                && earliest.is_none_or(|(other, _)| first < other)
            {
                earliest = Some((first, lane));
            }
        }
        let (_, lane) = earliest.filter(|((at, _), _)| *at <= limit)?;
        let Entry { at, event, .. } = self.lanes[lane].pop()?;
        Some((at, event))
    }

    /// Time of the earliest event.
    pub(crate) fn next_at(&self) -> Option<SimTime> {
        self.lanes.iter().filter_map(|heap| heap.peek()).map(|entry| entry.at).min()
    }

    /// Time of the earliest event of a lane; `NEVER` if the lane is empty.
    pub(crate) fn next_in(&self, lane: Lane) -> SimTime {
        self.lanes[lane as usize].peek().map_or(SimTime::NEVER, |entry| entry.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn events_of_the_same_time_are_in_the_order_of_insertion() {
        let mut queue = EventQueue::with_capacity(4);
        use Lane::{Any, EntryMain, EntryRedundant, Exit};
        for (lane, at, event) in [(Any, 5, 'c'), (Exit, 3, 'a'), (EntryMain, 5, 'd'), (EntryRedundant, 3, 'b')] {
            queue.push(lane, SimTime(at), event);
        }
        let order: String = std::iter::from_fn(|| queue.pop_until(SimTime(9))).map(|(_, event)| event).collect();
        assert_eq!(order, "abcd");
    }

    #[test]
    fn no_event_occurs_before_its_time() {
        let mut queue = EventQueue::with_capacity(1);
        queue.push(Lane::Exit, SimTime(10), ());
        assert_eq!((queue.next_in(Lane::Exit), queue.next_in(Lane::Any)), (SimTime(10), SimTime::NEVER));
        assert_eq!(queue.pop_until(SimTime(9)), None);
        assert_eq!(queue.next_at(), Some(SimTime(10)));
        assert_eq!(queue.pop_until(SimTime(10)), Some((SimTime(10), ())));
        assert_eq!(queue.next_at(), None);
    }

    proptest! {
        #[test]
        fn push_pop_is_a_push_and_then_a_pop(
            steps in prop::collection::vec((0u64..20, any::<bool>()), 0..60),
            limit in 0u64..25,
        ) {
            let limit = SimTime(limit);
            let mut one = EventQueue::with_capacity(0);
            let mut two = EventQueue::with_capacity(0);
            for (number, (at, together)) in steps.into_iter().enumerate() {
                if together {
                    let got = one.push_pop(SimTime(at), number, limit);
                    two.push(Lane::Any, SimTime(at), number);
                    prop_assert_eq!(got, two.pop_until(limit));
                } else {
                    one.push(Lane::Any, SimTime(at), number);
                    two.push(Lane::Any, SimTime(at), number);
                }
            }
            let rest = |mut queue: EventQueue<usize>| -> Vec<_> {
                std::iter::from_fn(|| queue.pop_until(SimTime(99))).collect()
            };
            prop_assert_eq!(rest(one), rest(two));
        }
    }
}
