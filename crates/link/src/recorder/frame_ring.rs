//! The newest frames that were taken from taps, in bounded memory, for a capture of the time before a fault.
//!
//! In: frames in the order of their times. Out: a pcapng file with those that are still there. Both limits hold at any
//! time: bytes of memory, and the time between the oldest and the newest frame.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::time::Duration;

use super::frame_queue::FrameNote;
use crate::pcapng::Writer;

/// Memory that a frame takes beside its bytes.
const NOTE: usize = size_of::<Kept>();

/// A frame of the ring.
#[derive(Clone, Copy, Debug)]
struct Kept {
    note: FrameNote,
    /// Bytes of it that are there.
    captured: usize,
}

/// The newest frames.
#[derive(Debug)]
pub struct FrameRing {
    frames: VecDeque<Kept>,
    bytes: VecDeque<u8>,
    most_bytes: usize,
    span_ns: u64,
}

impl FrameRing {
    /// A ring without frames, for at most so many bytes of frames and notes, and so much time.
    pub fn new(most_bytes: usize, span: Duration) -> FrameRing {
        let span_ns = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        FrameRing { frames: VecDeque::new(), bytes: VecDeque::new(), most_bytes, span_ns }
    }

    /// Adds the newest frame, and removes the oldest ones. A frame that is longer than the ring is not added.
    pub fn push(&mut self, note: FrameNote, frame: &[u8]) {
        if frame.len() + NOTE > self.most_bytes {
            return;
        }
        let used = |ring: &FrameRing| ring.bytes.len() + ring.frames.len() * NOTE;
        while used(self) + frame.len() + NOTE > self.most_bytes {
            self.pop();
        }
        while self.frames.front().is_some_and(|it| note.time_ns.saturating_sub(it.note.time_ns) > self.span_ns) {
            self.pop();
        }
        self.frames.push_back(Kept { note, captured: frame.len() });
        self.bytes.extend(frame);
    }

    fn pop(&mut self) {
        if let Some(kept) = self.frames.pop_front() {
            self.bytes.drain(..kept.captured);
        }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Takes all frames into another ring; this one goes on without frames.
    #[must_use]
    pub fn take(&mut self) -> FrameRing {
        let (frames, bytes) = (std::mem::take(&mut self.frames), std::mem::take(&mut self.bytes));
        FrameRing { frames, bytes, ..*self }
    }

    /// Writes all frames of interfaces with these names and descriptions, oldest first.
    ///
    /// # Errors
    /// That of the output.
    pub fn write(&self, out: impl Write, interfaces: &[(&str, &str)]) -> io::Result<()> {
        let mut writer = Writer::new(out, interfaces)?;
        let (mut bytes, mut frame) = (self.bytes.iter().copied(), Vec::new());
        for Kept { note, captured } in &self.frames {
            frame.clear();
            frame.extend(bytes.by_ref().take(*captured));
            writer.beginning(note.interface, note.direction, note.time_ns, &frame, note.length)?;
        }
        writer.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pcapng::Direction;

    fn note(at_ms: u64, length: usize) -> FrameNote {
        FrameNote { interface: 0, direction: Direction::Out, time_ns: at_ms * 1_000_000, length }
    }

    fn first(ring: &FrameRing) -> (u64, u8) {
        (ring.frames[0].note.time_ns / 1_000_000, ring.bytes[0])
    }

    // covers: capture
    #[test]
    fn the_newest_frames_stay_within_bytes_and_time() {
        let mut ring = FrameRing::new(10 * (100 + NOTE), Duration::from_secs(1));
        for at in 0..50_u8 {
            ring.push(note(u64::from(at) * 10, 100), &[at; 100]);
        }
        assert_eq!((ring.len(), first(&ring)), (10, (400, 40)), "bytes");
        ring.push(note(1_450, 60), &[77; 60]);
        assert_eq!((ring.len(), first(&ring)), (6, (450, 45)), "time");
        ring.push(note(1_460, 10_000), &[1; 10_000]);
        assert_eq!(ring.len(), 6, "longer than the ring");
        let taken = ring.take();
        assert_eq!((ring.len(), taken.len(), ring.most_bytes), (0, 6, taken.most_bytes));
        let mut file = Vec::new();
        taken.write(&mut file, &[("eth1", "main link")]).expect("it is memory");
        assert!(file.windows(60).any(|it| it == [77; 60]) && !file.windows(4).any(|it| it == [44; 4]));
    }
}
