//! A bounded queue that keeps the oldest items and counts the dropped ones.

use alloc::collections::VecDeque;

/// A bounded queue. Items that arrive while it is full are dropped and counted.
#[derive(Debug)]
pub(super) struct BoundedQueue<T> {
    entries: VecDeque<T>,
    capacity: usize,
    overruns: u64,
}

impl<T> BoundedQueue<T> {
    pub(super) fn new(capacity: usize) -> BoundedQueue<T> {
        BoundedQueue { entries: VecDeque::new(), capacity, overruns: 0 }
    }

    pub(super) fn push(&mut self, entry: T) {
        if self.entries.len() < self.capacity {
            self.entries.push_back(entry);
        } else {
            self.overruns += 1;
        }
    }

    pub(super) fn pop(&mut self) -> Option<T> {
        self.entries.pop_front()
    }

    pub(super) fn overruns(&self) -> u64 {
        self.overruns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_queue_keeps_the_oldest_items_and_counts_the_dropped_ones() {
        let mut queue = BoundedQueue::new(2);
        (0..5).for_each(|n| queue.push(n));
        assert_eq!(queue.overruns(), 3);
        assert_eq!([queue.pop(), queue.pop(), queue.pop()], [Some(0), Some(1), None]);
    }
}
