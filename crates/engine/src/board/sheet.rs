//! Bytes of one writer for readers in other threads: what does not fit a word.
//!
//! A reader neither waits nor disturbs the writer. It notices a change while it reads, and reads again later.

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

/// Bytes of a word.
const WORD: usize = size_of::<u64>();

/// Bytes that are replaced as a whole.
#[derive(Debug)]
pub struct Sheet {
    words: Vec<AtomicU64>,
    length: AtomicU32,
    /// Odd while the bytes change; 0 before the first ones.
    version: AtomicU32,
}

impl Sheet {
    /// Room for bytes.
    pub fn new(bytes: usize) -> Sheet {
        let words = (0..bytes.div_ceil(WORD)).map(|_| AtomicU64::new(0)).collect();
        Sheet { words, length: AtomicU32::new(0), version: AtomicU32::new(0) }
    }

    /// Bytes that it has room for.
    pub fn room(&self) -> usize {
        self.words.len() * WORD
    }

    /// Replaces the bytes. False, and nothing has changed, if they do not fit. For the only writer.
    pub fn write(&self, bytes: &[u8]) -> bool {
        if bytes.len() > self.room() {
            return false;
        }
        self.begin();
        self.put(0, bytes);
        self.end(bytes.len());
        true
    }

    /// The bytes change piece by piece from now on; readers get none. For the only writer.
    pub fn begin(&self) {
        let version = self.version.load(Ordering::Relaxed);
        self.version.store(version | 1, Ordering::Relaxed);
        fence(Ordering::Release);
    }

    /// Writes a piece, at a multiple of eight; the last word is filled with zeros. What does not fit is left out.
    pub fn put(&self, offset: usize, bytes: &[u8]) {
        let words = self.words.get(offset / WORD..).unwrap_or_default();
        for (word, piece) in words.iter().zip(bytes.chunks(WORD)) {
            let mut whole = [0; WORD];
            whole[..piece.len()].copy_from_slice(piece);
            word.store(u64::from_le_bytes(whole), Ordering::Relaxed);
        }
    }

    /// All pieces of the new bytes are written.
    pub fn end(&self, length: usize) {
        self.length.store(length as u32, Ordering::Relaxed);
        let version = self.version.load(Ordering::Relaxed);
        self.version.store((version | 1).wrapping_add(1), Ordering::Release);
    }

    /// Version and length of the bytes; `None` before the first ones, and while they change.
    pub fn version(&self) -> Option<(u32, usize)> {
        let version = self.version.load(Ordering::Acquire);
        let length = self.length.load(Ordering::Relaxed) as usize;
        (version != 0 && version & 1 == 0).then_some((version, length))
    }

    /// Copies bytes from a multiple of eight on; zeros follow the last one. The version and the whole length; `None`,
    /// and anything in `out`, if the bytes changed meanwhile.
    pub fn read_at(&self, offset: usize, out: &mut [u8]) -> Option<(u32, usize)> {
        let before = self.version()?;
        let words = self.words.get(offset / WORD..).unwrap_or_default();
        let left = before.1.saturating_sub(offset).min(out.len());
        for (word, piece) in words.iter().zip(out.chunks_mut(WORD)) {
            piece.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes()[..piece.len()]);
        }
        out.iter_mut().skip(left).for_each(|byte| *byte = 0);
        fence(Ordering::Acquire);
        (self.version.load(Ordering::Relaxed) == before.0).then_some(before)
    }

    /// A copy of all bytes, with their version; `None` before the first ones, and if they changed meanwhile.
    pub fn copy(&self) -> Option<(u32, Vec<u8>)> {
        let (_, length) = self.version()?;
        let mut bytes = alloc::vec![0; length];
        let (version, now) = self.read_at(0, &mut bytes)?;
        (now == length).then_some((version, bytes))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::thread;
    use std::vec;

    use super::*;

    // covers: standby
    #[test]
    fn bytes_are_read_as_a_whole_and_in_pieces() {
        let sheet = Sheet::new(20);
        assert_eq!((sheet.version(), sheet.copy(), sheet.room()), (None, None, 24));
        assert!(sheet.write(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]));
        assert_eq!(sheet.copy(), Some((2, vec![1, 2, 3, 4, 5, 6, 7, 8, 9, 10])));
        let mut piece = [0xEE; 4];
        assert_eq!((sheet.read_at(8, &mut piece), piece), (Some((2, 10)), [9, 10, 0, 0]));
        assert_eq!((sheet.read_at(16, &mut piece), piece), (Some((2, 10)), [0; 4]));
        assert!(!sheet.write(&[0; 25]), "it is too long");
        sheet.begin();
        sheet.put(8, &[7; 3]);
        assert_eq!((sheet.version(), sheet.copy()), (None, None), "it changes");
        sheet.end(11);
        assert_eq!(sheet.copy(), Some((4, vec![1, 2, 3, 4, 5, 6, 7, 8, 7, 7, 7])));
        sheet.put(1000, &[1]);
    }

    // covers: standby, threads
    #[test]
    fn a_reader_beside_the_writer_never_gets_bytes_of_two_versions() {
        /// Copies that the reader gets, however seldom a loaded machine lets it run.
        const WANTED: usize = 1_000;
        let (sheet, is_read) = (Arc::new(Sheet::new(256)), Arc::new(AtomicBool::new(false)));
        let (writer, ends) = (sheet.clone(), is_read.clone());
        let writing = thread::spawn(move || {
            for round in 0_u32.. {
                if ends.load(Ordering::Relaxed) {
                    return;
                }
                writer.write(&[round as u8; 256]);
                if round % 16 == 0 {
                    thread::yield_now();
                }
            }
        });
        let mut seen = 0;
        while seen < WANTED && !writing.is_finished() {
            if let Some((_, bytes)) = sheet.copy() {
                assert!(bytes.iter().all(|byte| *byte == bytes[0]), "{bytes:?}");
                seen += 1;
            }
        }
        is_read.store(true, Ordering::Relaxed);
        writing.join().unwrap();
        assert!(seen == WANTED && sheet.copy().is_some());
    }
}
