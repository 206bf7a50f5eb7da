//! A bounded single-producer single-consumer queue of words, between the two halves of the engine.
//!
//! It needs neither locks nor `unsafe`: the slots are atomics. The producer never waits; messages that do not fit are
//! counted.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Words of one message.
pub const WORDS: usize = 3;

#[derive(Debug)]
struct Shared {
    slots: Vec<[AtomicU64; WORDS]>,
    /// Next slot to write; only the producer stores it.
    head: AtomicU32,
    /// Next slot to read; only the consumer stores it.
    tail: AtomicU32,
    dropped: AtomicU64,
}

/// The writing end.
#[derive(Debug)]
pub struct Producer {
    shared: Arc<Shared>,
}

/// The reading end.
#[derive(Debug)]
pub struct Consumer {
    shared: Arc<Shared>,
}

/// A queue of `capacity` messages, rounded up to a power of two.
pub fn queue(capacity: usize) -> (Producer, Consumer) {
    let capacity = capacity.clamp(1, 1 << 20).next_power_of_two();
    let slots = (0..capacity).map(|_| [const { AtomicU64::new(0) }; WORDS]).collect();
    let shared =
        Arc::new(Shared { slots, head: AtomicU32::new(0), tail: AtomicU32::new(0), dropped: AtomicU64::new(0) });
    (Producer { shared: shared.clone() }, Consumer { shared })
}

impl Producer {
    /// Appends a message; false (and counted) if the queue is full.
    pub fn push(&mut self, message: [u64; WORDS]) -> bool {
        let shared = &*self.shared;
        let head = shared.head.load(Ordering::Relaxed);
        let tail = shared.tail.load(Ordering::Acquire);
        if head.wrapping_sub(tail) as usize >= shared.slots.len() {
            shared.dropped.fetch_add(1, Ordering::Relaxed);
            return false;
        }
        let slot = &shared.slots[head as usize & (shared.slots.len() - 1)];
        for (word, value) in slot.iter().zip(message) {
            word.store(value, Ordering::Relaxed);
        }
        shared.head.store(head.wrapping_add(1), Ordering::Release);
        true
    }
}

impl Consumer {
    /// Takes the oldest message.
    pub fn pop(&mut self) -> Option<[u64; WORDS]> {
        let shared = &*self.shared;
        let tail = shared.tail.load(Ordering::Relaxed);
        if tail == shared.head.load(Ordering::Acquire) {
            return None;
        }
        let slot = &shared.slots[tail as usize & (shared.slots.len() - 1)];
        let message = core::array::from_fn(|word| slot[word].load(Ordering::Relaxed));
        shared.tail.store(tail.wrapping_add(1), Ordering::Release);
        Some(message)
    }

    /// Messages that did not fit since the beginning.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_out_in_order_and_an_overflow_is_counted() {
        let (mut producer, mut consumer) = queue(3);
        for value in 0..4 {
            assert!(producer.push([value, value + 10, 0]));
        }
        assert!(!producer.push([9, 9, 9]));
        assert_eq!(consumer.dropped(), 1);
        for value in 0..4 {
            assert_eq!(consumer.pop(), Some([value, value + 10, 0]));
        }
        assert_eq!(consumer.pop(), None);
    }

    #[test]
    fn two_threads_lose_nothing() {
        let (mut producer, mut consumer) = queue(16);
        let writer = std::thread::spawn(move || {
            let mut value = 0;
            while value < 100_000 {
                if producer.push([value, !value, value << 8]) {
                    value += 1;
                } else {
                    std::thread::yield_now();
                }
            }
        });
        let mut expected = 0;
        while expected < 100_000 {
            match consumer.pop() {
                Some(message) => {
                    assert_eq!(message, [expected, !expected, expected << 8]);
                    expected += 1;
                }
                None => std::thread::yield_now(),
            }
        }
        writer.join().unwrap();
    }
}
