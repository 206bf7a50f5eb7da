//! The newest frames that were taken from taps, in bounded memory, for a capture of the time before a fault.
//!
//! In: frames in the order of their times. Out: a pcapng file with those that are still there. Both limits hold at any
//! time: bytes of memory, which is reserved at the start and never grows, and the time between the oldest and the
//! newest frame.

use std::collections::{TryReserveError, VecDeque};
use std::io::{self, Write};
use std::time::Duration;

use super::frame_queue::FrameNote;
use crate::pcapng::{Direction, Writer};

/// Bytes of a note in front of the bytes of its frame.
const NOTE: usize = 18;

/// A frame of the ring.
#[derive(Clone, Copy, Debug)]
struct Kept {
    note: FrameNote,
    /// Bytes of it that are there.
    captured: usize,
}

impl Kept {
    /// Interface, direction, bytes that are there, length, time. A frame has less than 4 GiB, an interface a number up
    /// to 255.
    fn to_bytes(self) -> [u8; NOTE] {
        let mut bytes = [0; NOTE];
        let word = |value: usize| u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes();
        bytes[0] = u8::try_from(self.note.interface).unwrap_or(u8::MAX);
        bytes[1] = (self.note.direction == Direction::Out).into();
        bytes[2..6].copy_from_slice(&word(self.captured));
        bytes[6..10].copy_from_slice(&word(self.note.length));
        bytes[10..].copy_from_slice(&self.note.time_ns.to_le_bytes());
        bytes
    }

    /// The note at the beginning of these bytes.
    fn take(bytes: &mut impl Iterator<Item = u8>) -> Option<Kept> {
        let mut note = [0; NOTE];
        for place in &mut note {
            *place = bytes.next()?;
        }
        let [interface, direction, a, b, c, d, e, f, g, h, time @ ..] = note;
        let word = |bytes| u32::from_le_bytes(bytes) as usize;
        let direction = if direction == 1 { Direction::Out } else { Direction::In };
        let (captured, length, time_ns) = (word([a, b, c, d]), word([e, f, g, h]), u64::from_le_bytes(time));
        Some(Kept { note: FrameNote { interface: interface.into(), direction, time_ns, length }, captured })
    }
}

/// The newest frames.
#[derive(Debug)]
pub struct FrameRing {
    /// Each frame behind its note.
    bytes: VecDeque<u8>,
    frames: usize,
    most_bytes: usize,
    span_ns: u64,
}

impl FrameRing {
    /// A ring without frames, for at most so many bytes of frames and notes, and so much time.
    ///
    /// # Errors
    /// There is not so much memory.
    pub fn new(most_bytes: usize, span: Duration) -> Result<FrameRing, TryReserveError> {
        let span_ns = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        let mut bytes = VecDeque::new();
        bytes.try_reserve_exact(most_bytes)?;
        Ok(FrameRing { bytes, frames: 0, most_bytes, span_ns })
    }

    /// Adds the newest frame, and removes the oldest ones. A frame that is longer than the ring is not added.
    pub fn push(&mut self, note: FrameNote, frame: &[u8]) {
        let needed = frame.len() + NOTE;
        if needed > self.most_bytes {
            return;
        }
        while self.bytes.len() + needed > self.most_bytes || self.oldest().is_some_and(|it| self.is_old(it, note)) {
            self.pop();
        }
        self.bytes.extend(&Kept { note, captured: frame.len() }.to_bytes());
        self.bytes.extend(frame);
        self.frames += 1;
    }

    fn oldest(&self) -> Option<Kept> {
        Kept::take(&mut self.bytes.iter().copied())
    }

    fn is_old(&self, oldest: Kept, newest: FrameNote) -> bool {
        newest.time_ns.saturating_sub(oldest.note.time_ns) > self.span_ns
    }

    fn pop(&mut self) {
        match self.oldest() {
            Some(kept) => {
                self.bytes.drain(..NOTE + kept.captured);
                self.frames -= 1;
            }
            None => self.clear(),
        }
    }

    /// Removes all frames. The memory stays.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.frames = 0;
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// Writes all frames of interfaces with these names and descriptions, oldest first.
    ///
    /// # Errors
    /// That of the output.
    pub fn write(&self, out: impl Write, interfaces: &[(&str, &str)]) -> io::Result<()> {
        let mut writer = Writer::new(out, interfaces)?;
        let (mut bytes, mut frame) = (self.bytes.iter().copied(), Vec::new());
        while let Some(Kept { note, captured }) = Kept::take(&mut bytes) {
            frame.clear();
            frame.extend(bytes.by_ref().take(captured));
            writer.beginning(note.interface, note.direction, note.time_ns, &frame, note.length)?;
        }
        writer.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(at_ms: u64, length: usize) -> FrameNote {
        FrameNote { interface: 0, direction: Direction::Out, time_ns: at_ms * 1_000_000, length }
    }

    fn first(ring: &FrameRing) -> (u64, u8) {
        (ring.oldest().expect("there is one").note.time_ns / 1_000_000, ring.bytes[NOTE])
    }

    // covers: capture
    #[test]
    fn the_newest_frames_stay_within_bytes_and_time() {
        let mut ring = FrameRing::new(10 * (100 + NOTE), Duration::from_secs(1)).expect("there is memory");
        let reserved = ring.bytes.capacity();
        for at in 0..50_u8 {
            ring.push(note(u64::from(at) * 10, 100), &[at; 100]);
        }
        assert_eq!((ring.len(), first(&ring)), (10, (400, 40)), "bytes");
        ring.push(note(1_450, 60), &[77; 60]);
        assert_eq!((ring.len(), first(&ring)), (6, (450, 45)), "time");
        ring.push(note(1_460, 10_000), &[1; 10_000]);
        assert_eq!(ring.len(), 6, "longer than the ring");
        let mut file = Vec::new();
        ring.write(&mut file, &[("eth1", "main link")]).expect("it is memory");
        assert!(file.windows(60).any(|it| it == [77; 60]) && !file.windows(4).any(|it| it == [44; 4]));
        ring.clear();
        assert_eq!((ring.len(), ring.bytes.capacity()), (0, reserved), "the memory stays as it is");
    }

    // covers: capture
    #[test]
    fn a_ring_larger_than_the_memory_is_refused() {
        assert!(FrameRing::new(usize::MAX, Duration::from_secs(1)).is_err());
    }

    // covers: capture
    #[test]
    fn notes_are_read_as_they_were_written() {
        let note = FrameNote { interface: 1, direction: Direction::In, time_ns: u64::MAX - 5, length: 70_000 };
        let kept = Kept { note, captured: 1_514 };
        let again = Kept::take(&mut kept.to_bytes().into_iter()).expect("it is whole");
        assert_eq!((again.note, again.captured), (note, 1_514));
    }
}
