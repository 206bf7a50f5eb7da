//! The queue between the thread that receives or sends frames and the writing thread: a bounded queue of bytes with one
//! producer and one consumer at a time.
//!
//! Input: frames with interface, direction and time. Output: the same frames in the same order. It uses no locks and no
//! `unsafe`: the memory consists of atomic words. The producer does not wait, allocate or call the kernel. Frames that
//! do not fit are counted per interface.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::pcapng::Direction;

/// Bytes of a word.
const WORD: usize = size_of::<u64>();
/// Words before a frame: interface, direction and lengths; time.
const HEAD: usize = 2;
/// Longer frames are truncated; jumbo frames are shorter.
pub const LONGEST: usize = 0xFFFF;
/// Initial value of the memory: writing it makes the kernel map all pages before use.
const FILLING: u64 = u64::MAX;

/// Properties of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameNote {
    /// Position of the interface in the list of the capture, at most 255.
    pub interface: usize,
    /// Direction.
    pub direction: Direction,
    /// Time.
    pub time_ns: u64,
    /// Length of the whole frame; the queue may hold only its beginning.
    pub length: usize,
}

/// The memory of a queue.
#[derive(Debug)]
pub struct Queue {
    /// The length is a power of two; a count of words modulo the length is a position.
    words: Box<[AtomicU64]>,
    /// Words written so far; only the producer stores it.
    written: AtomicU64,
    /// Words read so far; only the consumer stores it.
    read: AtomicU64,
    /// Frames that did not fit, by interface.
    lost: Box<[AtomicU64]>,
}

impl Queue {
    /// A queue of `bytes`, rounded up to a power of two, for this number of interfaces. It has at most one producer and
    /// one consumer at a time.
    pub fn new(bytes: usize, interfaces: usize) -> Queue {
        let words = bytes.div_ceil(WORD).clamp(2 * HEAD, 1 << 28).next_power_of_two();
        Queue {
            words: (0..words).map(|_| AtomicU64::new(FILLING)).collect(),
            written: AtomicU64::new(0),
            read: AtomicU64::new(0),
            lost: (0..interfaces).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    fn word(&self, at: u64) -> &AtomicU64 {
        &self.words[at as usize & (self.words.len() - 1)]
    }

    fn lost(&self, interface: usize) -> u64 {
        self.lost.get(interface).map_or(0, |lost| lost.load(Ordering::Relaxed))
    }
}

/// The writing end.
#[derive(Debug)]
pub struct Producer {
    shared: Arc<Queue>,
    written: u64,
    /// Last known count of the consumer; the current count may be higher.
    read: u64,
}

/// The reading end.
#[derive(Debug)]
pub struct Consumer {
    shared: Arc<Queue>,
    read: u64,
    /// Frames that did not fit before, by interface.
    lost_before: Vec<u64>,
}

impl Producer {
    /// The producer of a queue.
    pub fn new(shared: Arc<Queue>) -> Producer {
        let (written, read) = (shared.written.load(Ordering::Relaxed), shared.read.load(Ordering::Acquire));
        Producer { shared, written, read }
    }

    /// Appends a frame; false (and counted) if the queue is full.
    pub fn push(&mut self, note: FrameNote, frame: &[u8]) -> bool {
        let shared = &*self.shared;
        let frame = &frame[..frame.len().min(LONGEST)];
        let needed = (HEAD + frame.len().div_ceil(WORD)) as u64;
        let room = |read: u64| shared.words.len() as u64 - (self.written - read);
        if room(self.read) < needed {
            self.read = shared.read.load(Ordering::Acquire);
        }
        if room(self.read) < needed {
            if let Some(lost) = shared.lost.get(note.interface) {
                // Only this thread writes the counter.
                lost.store(lost.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
            }
            return false;
        }
        let direction = u64::from(note.direction == Direction::Out);
        let whole = note.length.max(frame.len()).min(u32::MAX as usize) as u64;
        let head = frame.len() as u64 | direction << 16 | (note.interface as u64 & 0xFF) << 24 | whole << 32;
        let mut at = self.written;
        let mut put = |word: u64| {
            shared.word(at).store(word, Ordering::Relaxed);
            at += 1;
        };
        put(head);
        put(note.time_ns);
        let mut words = frame.chunks_exact(WORD);
        for word in &mut words {
            let mut bytes = [0; WORD];
            bytes.copy_from_slice(word);
            put(u64::from_le_bytes(bytes));
        }
        if !words.remainder().is_empty() {
            let mut bytes = [0; WORD];
            bytes[..words.remainder().len()].copy_from_slice(words.remainder());
            put(u64::from_le_bytes(bytes));
        }
        self.written = at;
        shared.written.store(at, Ordering::Release);
        true
    }
}

impl Consumer {
    /// The consumer of a queue, from its next frame on.
    pub fn new(shared: Arc<Queue>) -> Consumer {
        let read = shared.written.load(Ordering::Acquire);
        shared.read.store(read, Ordering::Release);
        let lost_before = (0..shared.lost.len()).map(|interface| shared.lost(interface)).collect();
        Consumer { shared, read, lost_before }
    }

    /// The first consumer of a queue, from its first frame on.
    pub fn first(shared: Arc<Queue>) -> Consumer {
        let lost_before = vec![0; shared.lost.len()];
        Consumer { shared, read: 0, lost_before }
    }

    /// The producer's current position, for [`Consumer::is_before`].
    pub fn end(&self) -> u64 {
        self.shared.written.load(Ordering::Acquire)
    }

    /// Whether a frame waits that was added before `end`, a result of [`Consumer::end`].
    pub fn is_before(&self, end: u64) -> bool {
        self.read < end
    }

    /// Time of the oldest frame, if it is before `end`.
    pub fn oldest(&self, end: u64) -> Option<u64> {
        self.is_before(end).then(|| self.shared.word(self.read + 1).load(Ordering::Relaxed))
    }

    /// Removes the oldest frame before `end`; its bytes replace the content of `frame`.
    pub fn pop(&mut self, end: u64, frame: &mut Vec<u8>) -> Option<FrameNote> {
        let time_ns = self.oldest(end)?;
        let head = self.shared.word(self.read).load(Ordering::Relaxed);
        let length = head as usize & 0xFFFF;
        let words = length.div_ceil(WORD);
        frame.clear();
        for at in 0..words {
            let word = self.shared.word(self.read + (HEAD + at) as u64).load(Ordering::Relaxed);
            frame.extend_from_slice(&word.to_le_bytes());
        }
        frame.truncate(length);
        self.read += (HEAD + words) as u64;
        self.shared.read.store(self.read, Ordering::Release);
        let direction = if head >> 16 & 1 == 0 { Direction::In } else { Direction::Out };
        Some(FrameNote { interface: (head >> 24) as usize & 0xFF, direction, time_ns, length: (head >> 32) as usize })
    }

    /// Frames of an interface that did not fit since this consumer began.
    pub fn lost(&self, interface: usize) -> u64 {
        self.shared.lost(interface) - self.lost_before.get(interface).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn queue(bytes: usize, interfaces: usize) -> (Producer, Consumer) {
        let queue = Arc::new(Queue::new(bytes, interfaces));
        (Producer::new(queue.clone()), Consumer::first(queue))
    }

    fn note(number: u64) -> FrameNote {
        let direction = if number.is_multiple_of(3) { Direction::In } else { Direction::Out };
        FrameNote { interface: number as usize % 2, direction, time_ns: number << 33, length: frame(number).len() }
    }

    fn frame(number: u64) -> Vec<u8> {
        (0..number * 7 % 1515).map(|at| (at + number) as u8).collect()
    }

    #[test]
    fn frames_of_every_length_pass_unchanged_while_the_queue_wraps() {
        let (mut producer, mut consumer) = queue(8192, 2);
        let mut taken = Vec::new();
        for number in 0..5000 {
            assert!(producer.push(note(number), &frame(number)));
            let end = consumer.end();
            assert_eq!(consumer.oldest(end), Some(number << 33));
            assert_eq!(consumer.pop(end, &mut taken), Some(note(number)));
            assert_eq!(taken, frame(number));
            assert_eq!(consumer.pop(end, &mut taken), None);
        }
    }

    #[test]
    fn a_frame_for_a_full_queue_is_counted_and_the_others_are_kept() {
        let (mut producer, mut consumer) = queue(256, 2);
        let ones = FrameNote { interface: 1, ..note(1) };
        let pushed = (0..5).filter(|_| producer.push(ones, &[7; 64])).count();
        assert_eq!((pushed, consumer.lost(0), consumer.lost(1)), (3, 0, 2));
        let mut taken = Vec::new();
        let end = consumer.end();
        assert!(consumer.pop(end, &mut taken).is_some());
        assert!(producer.push(ones, &[8; 64]), "the queue has room again");
        assert!(!producer.push(ones, &[9; 4096]), "longer than the whole queue");
        let end = consumer.end();
        let rest: Vec<u8> = std::iter::from_fn(|| consumer.pop(end, &mut taken).map(|_| taken[0])).collect();
        assert_eq!(rest, [7, 7, 8]);
    }

    // covers: capture
    #[test]
    fn two_threads_lose_only_counted_frames() {
        const FRAMES: u64 = 20_000;
        let (mut producer, mut consumer) = queue(16_384, 2);
        let writer = std::thread::spawn(move || (0..FRAMES).filter(|n| producer.push(note(*n), &frame(*n))).count());
        let (mut taken, mut seen, mut last) = (Vec::new(), 0, None);
        loop {
            let finished = writer.is_finished();
            let end = consumer.end();
            while let Some(note) = consumer.pop(end, &mut taken) {
                let number = note.time_ns >> 33;
                assert!(last < Some(number), "order");
                assert_eq!((note, &taken), (self::note(number), &frame(number)));
                (seen, last) = (seen + 1, Some(number));
            }
            if finished {
                break;
            }
        }
        assert_eq!(writer.join().expect("no panic"), seen);
        assert_eq!(consumer.lost(0) + consumer.lost(1) + seen as u64, FRAMES);
    }

    // covers: capture
    #[test]
    fn a_later_consumer_begins_with_the_next_frame_and_counts_its_own_losses() {
        let queue = Arc::new(Queue::new(256, 1));
        let mut producer = Producer::new(queue.clone());
        let zero = |number| FrameNote { interface: 0, ..note(number) };
        let first = Consumer::first(queue.clone());
        assert_eq!((0..5).filter(|number| producer.push(zero(*number), &[1; 64])).count(), 3);
        assert_eq!(first.lost(0), 2);
        drop(first);
        let mut later = Consumer::new(queue);
        assert_eq!((later.lost(0), later.oldest(later.end())), (0, None));
        assert!((7..10).all(|number| producer.push(zero(number), &[2; 64])), "the room of old frames is free");
        assert!(!producer.push(zero(10), &[2; 64]));
        let mut taken = Vec::new();
        let end = later.end();
        assert_eq!(later.pop(end, &mut taken).map(|note| (note.time_ns >> 33, taken[0])), Some((7, 2)));
        assert_eq!(later.lost(0), 1);
    }
}
