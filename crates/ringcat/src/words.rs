//! Words of one writer that any number of readers copy as a whole: a sequence lock.
//!
//! The writer never waits. A reader copies again if the writer has written meanwhile. All words are atomics, so a torn
//! copy is found by its number and is no data race.

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// The words. Their number is even while nothing is being written.
#[derive(Debug)]
pub(crate) struct Words {
    number: AtomicU64,
    words: Box<[AtomicU64]>,
}

impl Words {
    /// This many words, zero.
    pub fn new(count: usize) -> Words {
        Words { number: AtomicU64::new(0), words: (0..count).map(|_| AtomicU64::new(0)).collect() }
    }

    /// Writes the words. For one thread at a time.
    pub fn write(&self, fill: impl FnOnce(&[AtomicU64])) {
        let number = self.number.load(Ordering::Relaxed);
        self.number.store(number + 1, Ordering::Relaxed);
        // No word is stored before the odd number: a reader that reads a new word reads that number, too.
        fence(Ordering::Release);
        fill(&self.words);
        self.number.store(number + 2, Ordering::Release);
    }

    /// Number that [`Words::read`] returns at least for words of which the writing begins from now on.
    pub fn next(&self) -> u64 {
        // While it is odd, the writing under way has begun before.
        let number = self.number.load(Ordering::Acquire);
        number + 2 + (number & 1)
    }

    /// Copies the words with this number or a later one. `None` before they are written, and if they were being written
    /// meanwhile.
    pub fn read(&self, at_least: u64) -> Option<Vec<u64>> {
        let number = self.number.load(Ordering::Acquire);
        if number < at_least || number & 1 != 0 {
            return None;
        }
        let copy = self.words.iter().map(|word| word.load(Ordering::Relaxed)).collect();
        // The words are loaded before the number is loaded again.
        fence(Ordering::Acquire);
        (self.number.load(Ordering::Relaxed) == number).then_some(copy)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::thread;

    use super::*;

    fn fill(words: &Words, value: u64) {
        words.write(|words| words.iter().for_each(|word| word.store(value, Ordering::Relaxed)));
    }

    // covers: threads
    #[test]
    fn readers_never_see_words_of_two_writings() {
        let (words, end) = (Arc::new(Words::new(200)), Arc::new(AtomicBool::new(false)));
        let read = |words: Arc<Words>, end: Arc<AtomicBool>| {
            move || {
                let (mut copies, mut last) = (0, 0);
                while !end.load(Ordering::Relaxed) || copies == 0 {
                    let Some(copy) = words.read(2) else { continue };
                    assert!(copy.iter().all(|word| *word == copy[0]), "{copy:?}");
                    assert!(copy[0] >= last, "they go back");
                    (copies, last) = (copies + 1, copy[0]);
                }
            }
        };
        let readers: Vec<_> = (0..3).map(|_| thread::spawn(read(words.clone(), end.clone()))).collect();
        for value in 1..50_000 {
            fill(&words, value);
            if value % 64 == 0 {
                thread::yield_now();
            }
        }
        end.store(true, Ordering::Relaxed);
        readers.into_iter().for_each(|reader| reader.join().expect("no torn copy"));
    }

    #[test]
    fn a_number_is_reached_by_a_writing_that_begins_afterwards() {
        let words = Words::new(1);
        let first = words.next();
        assert_eq!(words.read(first), None, "nothing is written");
        let mut during = 0;
        words.write(|inner| {
            inner[0].store(5, Ordering::Relaxed);
            assert_eq!(words.read(0), None, "it is being written");
            during = words.next();
        });
        assert_eq!(words.read(first), Some(vec![5]));
        assert_eq!(words.read(during), None, "that writing had begun before");
        fill(&words, 6);
        assert_eq!(words.read(during), Some(vec![6]));
    }
}
