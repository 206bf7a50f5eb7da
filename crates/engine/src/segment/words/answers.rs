//! Since the last supervision result with an answer: for how long no frame has returned.

use core::time::Duration;

use super::posted::Words;
use crate::time::Instant;

/// The last result with an answer.
#[derive(Debug, Default)]
pub struct LastAnswer(Option<Answer>);

#[derive(Clone, Copy, Debug)]
struct Answer {
    /// The result's number; none before the first.
    number: Option<u32>,
    /// When it was observed.
    at: Instant,
    /// Cycles sent by then.
    cycles: u64,
}

impl LastAnswer {
    /// Whether SubDevices have answered since the last answer. The first words are an answer, which is not new.
    pub fn observe(&mut self, words: &Words, now: Instant) -> bool {
        let now = Answer { number: answered(words), at: now, cycles: words.cycles };
        let last = self.0.get_or_insert(now);
        let number = now.number.or(last.number);
        let is_new = number != last.number;
        if is_new {
            *last = Answer { number, ..now };
        }
        is_new
    }

    /// Whether at least this number of cycles was sent in this time, and none was answered.
    pub fn is_older_than(&self, (time, cycles): (Duration, u64), words: &Words, now: Instant) -> bool {
        let is_old = |last: &Answer| now.since(last.at) >= time && words.cycles.wrapping_sub(last.cycles) >= cycles;
        self.0.as_ref().is_some_and(is_old)
    }

    /// No frame could return until now.
    pub fn begin_again(&mut self, words: &Words, now: Instant) {
        let before = self.0.and_then(|last| last.number);
        self.0 = Some(Answer { number: answered(words).or(before), at: now, cycles: words.cycles });
    }
}

/// The number of a result that a SubDevice has answered: a frame that was processed by none did not return from the
/// SubDevices, and in a closed ring of two links copies return unprocessed.
fn answered(words: &Words) -> Option<u32> {
    words.supervision.filter(|(_, result)| result.total().0 > 0).map(|(number, _)| number)
}
