//! Waits for words that the cyclic half and the links post, instead of polling them.
//!
//! Packed words are compared here for equality, only to wake the tasks that wait: nothing is decided, and a change may
//! turn out to be none for the model. The fields of the words are evaluated in `segment/words.rs` alone; the supervisor
//! may not name the model, which is above it (decision 0153).

use core::future::poll_fn;
use core::task::Poll;

use super::bus::Bus;
use super::posted::{Posted, PostedWords};
use super::shared::Shared;
use super::signal::Signal;
use crate::time::Instant;

impl Shared {
    pub(super) fn posted(&self) -> Posted {
        let requests = self.request_counter.value();
        let Some(board) = &self.board else {
            return Posted { carriers: self.carriers, requests, ..Posted::default() };
        };
        Posted {
            requests,
            supervision: board.supervision().map(|(_, supervision)| supervision),
            result: None,
            ring: board.ring(),
            carriers: self.carriers,
            holds: board.clocks.holds(),
            times: board.clocks.times.posted(),
        }
    }

    #[inline(always)]
    fn posted_words(&self) -> PostedWords {
        let requests = self.request_counter.value();
        let Some(board) = self.board.as_deref() else { return PostedWords { requests, ..PostedWords::default() } };
        let (supervision, ring, holds) = (board.supervision_word(), board.ring_word(), board.clocks.holds());
        let result = if self.watchers.wants_result { board.supervision_number() } else { 0 };
        PostedWords { supervision, result, ring, requests, holds }
    }

    /// Whether a procedure waits for posted words, and those of other threads have changed.
    #[inline(always)]
    pub(super) fn is_posted(&self) -> bool {
        !self.watchers.waiting.is_empty() && self.posted_words() != self.watchers.seen
    }

    /// Whether a procedure waits for posted words, and the carriers have changed.
    pub(super) fn has_carriers_to_show(&self) -> bool {
        !self.watchers.waiting.is_empty() && self.carriers != self.watchers.seen_carriers
    }

    fn see_posted_words(&mut self) {
        (self.watchers.seen, self.watchers.seen_carriers) = (self.posted_words(), self.carriers);
    }

    /// Wakes the procedures that wait for a change, if a posted word has changed.
    pub(super) fn wake_watchers(&mut self) {
        if !self.is_posted() && !self.has_carriers_to_show() {
            return;
        }
        self.watchers.wants_result = false;
        self.see_posted_words();
        for task in core::mem::take(&mut self.watchers.waiting) {
            self.wake(task);
        }
    }
}

impl Bus {
    /// The currently posted words.
    pub(crate) fn posted(&self) -> Posted {
        self.shared.borrow().posted()
    }

    /// Waits until other words than these are posted, until a time, or until `ready` returns a value; `ready` is called
    /// after each notification of `signal`.
    pub(crate) async fn until_posted(
        &self,
        seen: Posted,
        until: Instant,
        signal: &Signal,
        mut ready: impl FnMut() -> bool,
    ) {
        let mut armed = false;
        poll_fn(|_| {
            if ready() {
                return Poll::Ready(());
            }
            let shared = &mut *self.shared.borrow_mut();
            let number = |_| shared.board.as_ref().map_or(0, |board| board.supervision_number());
            let posted = shared.posted().with_next_result(seen.result.map(number));
            if posted != seen || shared.now >= until {
                return Poll::Ready(());
            }
            let task = shared.current;
            shared.watchers.wants_result |= seen.result.is_some();
            shared.see_posted_words();
            if !shared.watchers.waiting.contains(&task) {
                shared.watchers.waiting.push(task);
            }
            signal.register(task);
            if !armed && until != Instant::NEVER {
                shared.wake_at(until);
                armed = true;
            }
            Poll::Pending
        })
        .await;
    }
}
