//! A bounded queue of Ethernet frames between the acyclic half and an endpoint in any thread.
//!
//! One writer, one reader, neither locks nor `unsafe`: the slots are atomics. Nothing waits or allocates.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use ringcat_wire::master_frame::MAX_ETHERNET;

/// Bytes of a word.
const WORD: usize = size_of::<u64>();
/// Words of a slot: the length of the frame, and its bytes.
const WORDS: usize = 1 + MAX_ETHERNET.div_ceil(WORD);

#[derive(Debug)]
struct Shared {
    /// [`WORDS`] for each slot.
    words: Vec<AtomicU64>,
    slots: u32,
    /// Next slot to write; only the writer stores it.
    head: AtomicU32,
    /// Next slot to read; only the reader stores it.
    tail: AtomicU32,
}

impl Shared {
    /// The length and the bytes of a slot.
    fn slot(&self, number: u32) -> (&AtomicU64, &[AtomicU64]) {
        let at = (number % self.slots) as usize * WORDS;
        (&self.words[at], &self.words[at + 1..at + WORDS])
    }

    fn count(&self) -> u32 {
        self.head.load(Ordering::Acquire).wrapping_sub(self.tail.load(Ordering::Acquire))
    }
}

/// The writing end.
#[derive(Debug)]
pub(super) struct FrameProducer(Arc<Shared>);

/// The reading end.
#[derive(Debug)]
pub(super) struct FrameConsumer(Arc<Shared>);

/// A queue for a number of frames, which is a power of two.
pub(super) fn frame_queue(slots: u32) -> (FrameProducer, FrameConsumer) {
    let slots = slots.next_power_of_two();
    let words = (0..slots as usize * WORDS).map(|_| AtomicU64::new(0)).collect();
    let shared = Arc::new(Shared { words, slots, head: AtomicU32::new(0), tail: AtomicU32::new(0) });
    (FrameProducer(shared.clone()), FrameConsumer(shared))
}

impl FrameProducer {
    /// Frames that it has room for.
    pub fn room(&self) -> usize {
        (self.0.slots - self.0.count()) as usize
    }

    /// Appends a frame of at most `MAX_ETHERNET` bytes; false if there is no room.
    pub fn push(&mut self, frame: &[u8]) -> bool {
        if frame.len() > MAX_ETHERNET || self.room() == 0 {
            return false;
        }
        let head = self.0.head.load(Ordering::Relaxed);
        let (length, words) = self.0.slot(head);
        length.store(frame.len() as u64, Ordering::Relaxed);
        for (word, piece) in words.iter().zip(frame.chunks(WORD)) {
            let mut whole = [0; WORD];
            whole[..piece.len()].copy_from_slice(piece);
            word.store(u64::from_le_bytes(whole), Ordering::Relaxed);
        }
        self.0.head.store(head.wrapping_add(1), Ordering::Release);
        true
    }
}

impl FrameConsumer {
    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.0.count() == 0
    }

    /// Bytes of the oldest frame.
    pub fn next_len(&self) -> Option<usize> {
        if self.is_empty() {
            return None;
        }
        let (length, _) = self.0.slot(self.0.tail.load(Ordering::Relaxed));
        Some((length.load(Ordering::Relaxed) as usize).min(MAX_ETHERNET))
    }

    /// Takes the oldest frame; its length. Bytes that have no place in `out` are lost.
    pub fn pop(&mut self, out: &mut [u8]) -> Option<usize> {
        let length = self.next_len()?;
        let tail = self.0.tail.load(Ordering::Relaxed);
        let (_, words) = self.0.slot(tail);
        let length = length.min(out.len());
        for (piece, word) in out[..length].chunks_mut(WORD).zip(words) {
            piece.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes()[..piece.len()]);
        }
        self.0.tail.store(tail.wrapping_add(1), Ordering::Release);
        Some(length)
    }

    /// Drops all frames; their number.
    pub fn clear(&mut self) -> u32 {
        let head = self.0.head.load(Ordering::Acquire);
        let tail = self.0.tail.swap(head, Ordering::Release);
        head.wrapping_sub(tail)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::vec;

    use super::*;

    // covers: standby, AC-06
    #[test]
    fn frames_of_any_length_come_out_in_order_and_a_full_queue_refuses() {
        let (mut producer, mut consumer) = frame_queue(4);
        let mut out = [0; MAX_ETHERNET];
        for round in 0..5_u8 {
            for (number, length) in (0..).zip([14, 15, 64, MAX_ETHERNET]) {
                assert!(producer.push(&vec![round * 16 + number; length]));
            }
            assert!(!producer.push(&[0; 14]) && producer.room() == 0);
            for (number, length) in (0..).zip([14, 15, 64, MAX_ETHERNET]) {
                assert_eq!((consumer.next_len(), consumer.pop(&mut out)), (Some(length), Some(length)));
                assert!(out[..length].iter().all(|byte| *byte == round * 16 + number));
            }
            assert_eq!((consumer.next_len(), consumer.pop(&mut out)), (None, None));
        }
        assert!(!producer.push(&[0; MAX_ETHERNET + 1]), "it is too long");
        assert!(producer.push(&[1; 20]) && producer.push(&[2; 20]));
        assert_eq!((consumer.clear(), consumer.is_empty(), producer.room()), (2, true, 4));
        assert!(producer.push(&[3; 20]));
        assert_eq!((consumer.pop(&mut out[..10]), &out[..10]), (Some(10), &[3; 10][..]));
        assert!(consumer.is_empty());
    }

    // covers: standby, threads
    #[test]
    fn frames_pass_from_one_thread_to_another_unchanged() {
        const FRAMES: u32 = 20_000;
        let (mut producer, mut consumer) = frame_queue(8);
        let frame = |number: u32| vec![number as u8; 14 + number as usize % 100];
        let writer = thread::spawn(move || {
            for number in 0..FRAMES {
                while !producer.push(&frame(number)) {
                    thread::yield_now();
                }
            }
        });
        let mut out = [0; MAX_ETHERNET];
        for number in 0..FRAMES {
            let length = loop {
                match consumer.pop(&mut out) {
                    Some(length) => break length,
                    None => thread::yield_now(),
                }
            };
            assert_eq!(out[..length], frame(number));
        }
        writer.join().expect("it ends");
    }
}
