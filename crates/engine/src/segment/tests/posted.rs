//! The words of a test, which changes them one by one.

use super::*;

/// What the cyclic half has posted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posted {
    pub links: LinkSet,
    pub carriers: [Option<bool>; 2],
    pub ring: RingWord,
    pub supervision: Option<(u32, Supervision)>,
    pub cycles: u64,
}

impl Posted {
    /// As the model takes them.
    pub fn words(&self) -> Words {
        let words = Words::new(self.links, self.carriers, self.ring).after_cycles(self.cycles);
        self.supervision.map_or(words, |(number, result)| words.with_result(number, result))
    }
}
