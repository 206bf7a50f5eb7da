//! A domain's image, and when inputs came into it.
//!
//! With several cycles under way, flights of the same datagram share this: inputs of an older cycle never overwrite
//! those of a newer one.

use alloc::boxed::Box;
use alloc::vec;

/// When inputs came. Cycles are counted from 1 here, so that zero is never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Moment {
    /// Cycle in which the flight that brought them left.
    pub left: u64,
    /// Cycle in which it came back.
    pub came: u64,
}

/// Inputs of a SubDevice in a datagram, by their numbers in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InputNumber {
    /// Of the datagram.
    pub datagram: usize,
    /// Of the part of it.
    pub part: usize,
}

/// The image, and when what came into it: by datagram where all its inputs came together, and by their parts.
#[derive(Debug)]
pub(crate) struct Image {
    pub bytes: Box<[u8]>,
    pub datagrams: Box<[Moment]>,
    pub parts: Box<[Moment]>,
    /// When, as a cycle plus one, the newest flight of which anything came had left.
    pub newest: u64,
}

impl Image {
    pub fn new(bytes: usize, datagrams: usize, parts: usize) -> Image {
        Image {
            bytes: vec![0; bytes].into_boxed_slice(),
            datagrams: vec![Moment::default(); datagrams].into_boxed_slice(),
            parts: vec![Moment::default(); parts].into_boxed_slice(),
            newest: 0,
        }
    }

    /// When inputs came last.
    pub fn moment(&self, input: InputNumber) -> Moment {
        let of = |moments: &[Moment], number: usize| moments.get(number).copied().unwrap_or_default();
        let (whole, part) = (of(&self.datagrams, input.datagram), of(&self.parts, input.part));
        if whole.left >= part.left { whole } else { part }
    }
}
