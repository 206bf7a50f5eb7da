//! The event queue: what happens next in virtual time (issue 2, part 3).
//!
//! In go events with the time at which they are due, out they come in the order of time; events of the same time come
//! in the order in which they were put in, so that a run is the same every time. The queue keeps its memory: once it
//! has been as long as it gets, it allocates no more.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use crate::time::SimTime;

/// Events in the order of their time.
#[derive(Debug)]
pub(crate) struct EventQueue<E> {
    heap: BinaryHeap<Entry<E>>,
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
    /// The heap gives its greatest entry first, which has to be the earliest.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.at, other.sequence).cmp(&(self.at, self.sequence))
    }
}

impl<E: Copy> EventQueue<E> {
    /// An empty queue with room for this many events.
    pub(crate) fn with_capacity(capacity: usize) -> EventQueue<E> {
        EventQueue { heap: BinaryHeap::with_capacity(capacity), sequence: 0 }
    }

    /// Puts in an event.
    pub(crate) fn push(&mut self, at: SimTime, event: E) {
        let sequence = self.next_sequence();
        self.heap.push(Entry { at, sequence, event });
    }

    /// Puts in an event and takes out the earliest that is due by `limit`, the new one included. One walk through the
    /// heap instead of two: this is the step of a frame from one device to the next.
    pub(crate) fn push_pop(&mut self, at: SimTime, event: E, limit: SimTime) -> Option<(SimTime, E)> {
        if self.next_at().is_none_or(|first| at < first) && at <= limit {
            return Some((at, event));
        }
        let sequence = self.next_sequence();
        if self.next_at().is_none_or(|first| first > limit) {
            self.heap.push(Entry { at, sequence, event });
            return None;
        }
        let mut first = self.heap.peek_mut()?;
        let taken = std::mem::replace(&mut *first, Entry { at, sequence, event });
        Some((taken.at, taken.event))
    }

    /// Takes out the earliest event that is due by `limit`.
    pub(crate) fn pop_until(&mut self, limit: SimTime) -> Option<(SimTime, E)> {
        let first = self.heap.peek_mut().filter(|first| first.at <= limit)?;
        let Entry { at, event, .. } = PeekMut::pop(first);
        Some((at, event))
    }

    /// When the earliest event is due.
    pub(crate) fn next_at(&self) -> Option<SimTime> {
        self.heap.peek().map(|entry| entry.at)
    }

    fn next_sequence(&mut self) -> u64 {
        self.sequence += 1;
        self.sequence
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn events_of_one_time_come_in_the_order_they_were_put_in() {
        let mut queue = EventQueue::with_capacity(4);
        for (at, event) in [(5, 'c'), (3, 'a'), (5, 'd'), (3, 'b')] {
            queue.push(SimTime(at), event);
        }
        let order: String = std::iter::from_fn(|| queue.pop_until(SimTime(9))).map(|(_, event)| event).collect();
        assert_eq!(order, "abcd");
    }

    #[test]
    fn nothing_comes_before_its_time() {
        let mut queue = EventQueue::with_capacity(1);
        queue.push(SimTime(10), ());
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
                    two.push(SimTime(at), number);
                    prop_assert_eq!(got, two.pop_until(limit));
                } else {
                    one.push(SimTime(at), number);
                    two.push(SimTime(at), number);
                }
            }
            let rest = |mut queue: EventQueue<usize>| -> Vec<_> {
                std::iter::from_fn(|| queue.pop_until(SimTime(99))).collect()
            };
            prop_assert_eq!(rest(one), rest(two));
        }
    }
}
