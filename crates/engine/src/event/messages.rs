//! Messages for an operator at the machine: steps of procedures, frames of the acyclic half.
//!
//! In: a level and a mask of subjects, both changed at any time, and what the acyclic half reports. Out: the last
//! messages, numbered. At level 0, the initial one, a message costs one comparison: its text is not made. The memory is
//! bounded; the oldest messages are dropped, and the gap in the numbers says so. The cyclic half reports none.

use alloc::collections::VecDeque;
use alloc::string::String;
use alloc::vec::Vec;

use super::subject::{Subject, Subjects};
use crate::link::Link;
use crate::time::Instant;

/// Messages kept.
const KEPT: usize = 4096;
/// Bytes of text and frames kept: a thousand frames of usual length.
const KEPT_BYTES: usize = 1 << 20;
/// Longest text of a step.
const LONGEST_STEP: usize = 256;

/// How much is reported (the levels of `ethercat debug`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum LogLevel {
    /// Level 0: events only, no message.
    #[default]
    Quiet,
    /// Level 1: also steps of procedures: state changes, scans, mail, clocks.
    Steps,
    /// Level 2: also the content of all acyclic frames.
    Frames,
}

impl LogLevel {
    /// The level with a number; numbers above 2 are 2.
    pub const fn from_number(number: u32) -> LogLevel {
        match number {
            0 => LogLevel::Quiet,
            1 => LogLevel::Steps,
            _ => LogLevel::Frames,
        }
    }

    /// 0 to 2.
    pub const fn number(self) -> u32 {
        match self {
            LogLevel::Quiet => 0,
            LogLevel::Steps => 1,
            LogLevel::Frames => 2,
        }
    }
}

/// Which messages are reported: those up to a level and of the subjects of a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct LogFilter {
    /// The level.
    pub level: LogLevel,
    /// The trace mask. Frames have a subject of their own, [`Subject::Frames`].
    pub subjects: Subjects,
}

impl Default for LogFilter {
    fn default() -> LogFilter {
        LogFilter::new(LogLevel::Quiet)
    }
}

impl LogFilter {
    /// All subjects up to a level.
    pub const fn new(level: LogLevel) -> LogFilter {
        LogFilter { level, subjects: Subjects::ALL }
    }

    /// Only some subjects.
    #[must_use]
    pub const fn with_subjects(mut self, subjects: Subjects) -> LogFilter {
        self.subjects = subjects;
        self
    }

    /// Whether steps of a subject are reported.
    fn takes_step(self, subject: Subject) -> bool {
        self.level >= LogLevel::Steps && self.subjects.has(subject)
    }

    /// Whether frames are reported.
    fn takes_frames(self) -> bool {
        self.level >= LogLevel::Frames && self.subjects.has(Subject::Frames)
    }
}

/// What a message contains.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MessageContent {
    /// A step of a procedure, in words.
    Step(String),
    /// A frame that is sent, without FCS.
    Sent {
        /// On this link.
        link: Link,
        /// Its bytes.
        frame: Vec<u8>,
    },
    /// A frame that has arrived, without FCS.
    Received {
        /// On this link.
        link: Link,
        /// Its bytes.
        frame: Vec<u8>,
    },
}

impl MessageContent {
    fn bytes(&self) -> usize {
        match self {
            MessageContent::Step(text) => text.len(),
            MessageContent::Sent { frame, .. } | MessageContent::Received { frame, .. } => frame.len(),
        }
    }
}

/// A message with its time.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Message {
    /// Its number: messages are numbered from 0.
    pub number: u64,
    /// The `now` of the call in which it was reported.
    pub at: Instant,
    /// What it is about.
    pub subject: Subject,
    /// What it says.
    pub content: MessageContent,
}

/// The messages from a number on, as far as they are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MessagesSince {
    /// The messages, oldest first.
    pub messages: Vec<Message>,
    /// Number of messages from that number on that are no longer kept.
    pub missed: u64,
    /// Number of the next message: the number to continue with.
    pub next: u64,
}

/// The last messages.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    filter: LogFilter,
    kept: VecDeque<Message>,
    bytes: usize,
    next: u64,
    /// Number of the oldest message that [`Messages::pop`] has not returned.
    unread: u64,
}

impl Messages {
    /// Sets what is reported from now on. Kept messages stay.
    pub(crate) fn set_filter(&mut self, filter: LogFilter) {
        self.filter = filter;
    }

    /// What is reported.
    pub(crate) fn filter(&self) -> LogFilter {
        self.filter
    }

    /// Whether steps of a subject are reported.
    pub(crate) fn takes_step(&self, subject: Subject) -> bool {
        self.filter.takes_step(subject)
    }

    /// Appends a step that [`Messages::takes_step`] allows.
    pub(crate) fn step(&mut self, at: Instant, subject: Subject, mut text: String) {
        let end = (0..=LONGEST_STEP.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        text.truncate(end);
        self.push(at, subject, MessageContent::Step(text));
    }

    /// Appends a sent frame, if frames are reported.
    pub(crate) fn sent(&mut self, at: Instant, link: Link, frame: &[u8]) {
        if self.filter.takes_frames() {
            self.push(at, Subject::Frames, MessageContent::Sent { link, frame: frame.to_vec() });
        }
    }

    /// Appends a received frame, if frames are reported.
    pub(crate) fn received(&mut self, at: Instant, link: Link, frame: &[u8]) {
        if self.filter.takes_frames() {
            self.push(at, Subject::Frames, MessageContent::Received { link, frame: frame.to_vec() });
        }
    }

    fn push(&mut self, at: Instant, subject: Subject, content: MessageContent) {
        self.bytes += content.bytes();
        self.kept.push_back(Message { number: self.next, at, subject, content });
        self.next += 1;
        while self.kept.len() > KEPT || self.bytes > KEPT_BYTES {
            let Some(oldest) = self.kept.pop_front() else { return };
            self.bytes -= oldest.content.bytes();
        }
    }

    /// The oldest message that was not returned before. It is kept for [`Messages::since`].
    pub(crate) fn pop(&mut self) -> Option<Message> {
        if self.unread == self.next {
            return None;
        }
        let first = self.kept.front()?.number;
        let message = self.kept.get(self.unread.saturating_sub(first) as usize)?.clone();
        self.unread = message.number + 1;
        Some(message)
    }

    /// The kept messages from a number on. A number beyond the next one gives none.
    pub(crate) fn since(&self, number: u64) -> MessagesSince {
        let first = self.kept.partition_point(|message| message.number < number);
        let messages: Vec<Message> = self.kept.range(first..).cloned().collect();
        let missed = self.next.saturating_sub(number) - messages.len() as u64;
        MessagesSince { messages, missed, next: self.next }
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    fn numbers(since: &MessagesSince) -> Vec<u64> {
        since.messages.iter().map(|message| message.number).collect()
    }

    // covers: jobs
    #[test]
    fn messages_pass_by_level_and_subject() {
        let mut messages = Messages::default();
        let report = |messages: &mut Messages| {
            let before = messages.next;
            for subject in [Subject::Scan, Subject::Mail] {
                if messages.takes_step(subject) {
                    messages.step(Instant(1), subject, "step".to_string());
                }
            }
            messages.sent(Instant(2), Link::Main, &[0; 60]);
            messages.received(Instant(3), Link::Redundant, &[0; 60]);
            messages.next - before
        };
        let filters = [0, 1, 2, 5].map(|number| LogFilter::new(LogLevel::from_number(number)));
        let of_scan = Subjects::NONE.with(Subject::Scan);
        for (filter, count) in filters.into_iter().zip([0, 2, 4, 4]) {
            messages.set_filter(filter);
            assert_eq!(report(&mut messages), count, "{filter:?}");
            messages.set_filter(filter.with_subjects(of_scan));
            assert_eq!(report(&mut messages), count.min(1), "{filter:?}");
            messages.set_filter(filter.with_subjects(Subjects::NONE.with(Subject::Frames)));
            assert_eq!(report(&mut messages), count.saturating_sub(2), "{filter:?}");
        }
    }

    // covers: jobs
    #[test]
    fn the_newest_messages_are_kept_within_number_and_bytes() {
        let mut messages = Messages::default();
        messages.set_filter(LogFilter::new(LogLevel::Frames));
        for _ in 0..KEPT + 5 {
            messages.step(Instant(0), Subject::Scan, "é".repeat(LONGEST_STEP));
        }
        let since = messages.since(0);
        assert_eq!((since.messages.len(), since.missed, since.next), (KEPT, 5, KEPT as u64 + 5));
        assert!(since.messages.iter().all(|message| message.content.bytes() == LONGEST_STEP));
        assert_eq!(numbers(&messages.since(KEPT as u64 + 3)), [KEPT as u64 + 3, KEPT as u64 + 4]);
        assert!(messages.since(u64::MAX).messages.is_empty());
        let popped: Vec<u64> = core::iter::from_fn(|| messages.pop()).map(|message| message.number).collect();
        assert_eq!((popped.len(), popped.first(), messages.since(0).messages.len()), (KEPT, Some(&5), KEPT));
        for _ in 0..2 * KEPT_BYTES / 1514 {
            messages.sent(Instant(0), Link::Main, &[0; 1514]);
            assert!(messages.bytes <= KEPT_BYTES && messages.kept.len() <= KEPT);
        }
        let kept: usize = messages.kept.iter().map(|message| message.content.bytes()).sum();
        assert_eq!((kept, messages.kept.len()), (messages.bytes, KEPT_BYTES / 1514));
    }
}
