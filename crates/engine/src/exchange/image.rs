//! Image of a domain, and the arrival times of its inputs.
//!
//! With several cycles on the wire, flights of the same datagram share this: inputs of an older cycle never overwrite
//! those of a newer one.

mod bytes;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

pub(crate) use bytes::Bytes;

/// Times of inputs. Cycles count from 1 here, so that zero means never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Moment {
    /// Cycle in which the flight with them left.
    pub left: u64,
    /// Cycle in which that flight came back.
    pub came: u64,
}

/// Inputs of a SubDevice in a datagram, by their numbers in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InputNumber {
    /// Number of the datagram.
    pub datagram: usize,
    /// Number of the part within it.
    pub part: usize,
}

/// The image, and when its inputs arrived: by datagram where all inputs came together, by datagram and link where some
/// did, and by part.
#[derive(Debug)]
pub(crate) struct Image {
    pub bytes: Bytes,
    pub datagrams: Box<[Moment]>,
    pub parts: Box<[Moment]>,
    shares: Box<[[Share; 2]]>,
    /// Shares found so far.
    found: u32,
    /// Departure of the newest flight with other results than the one before, as a cycle plus one.
    changed: u64,
    /// Flights that left from this cycle on, as a cycle plus one, have the results of the one before, and the domain is
    /// complete with them; the distant future while it is not.
    pub usual_from: u64,
    /// Departure of the newest flight of which any copy returned, as a cycle plus one; one more if its frame was sent
    /// again.
    pub newest: u64,
}

/// The inputs of a datagram that arrive with the copies on one link in an open ring, as long as their selection stays
/// the same.
#[derive(Clone, Debug, Default)]
struct Share {
    /// Number that identifies this share; 0 is none.
    number: u32,
    moment: Moment,
    /// Number of the datagram's first part.
    first: usize,
    /// Its parts of the datagram.
    parts: Box<[bool]>,
}

impl Image {
    /// `parts`: number of parts of each datagram.
    pub fn new(bytes: usize, parts: impl Iterator<Item = usize>) -> Image {
        let mut first = 0;
        let mut shares = Vec::new();
        for count in parts {
            let share = || Share { first, parts: vec![false; count].into_boxed_slice(), ..Share::default() };
            shares.push([share(), share()]);
            first += count;
        }
        Image {
            bytes: Bytes::Own(vec![0; bytes].into_boxed_slice()),
            datagrams: vec![Moment::default(); shares.len()].into_boxed_slice(),
            parts: vec![Moment::default(); first].into_boxed_slice(),
            shares: shares.into_boxed_slice(),
            found: 0,
            changed: 0,
            usual_from: u64::MAX,
            newest: 0,
        }
    }

    /// Uses memory of the caller, of which the image is the beginning, with the content that it has. False, and nothing
    /// has changed, if it is too short.
    pub fn use_memory(&mut self, memory: &'static mut [u8]) -> bool {
        let Some(used) = memory.get_mut(..self.bytes.len()) else { return false };
        self.bytes = Bytes::Given(used);
        true
    }

    /// A flight that left then, as a cycle plus one, has other results than the one before.
    #[cold]
    pub fn note_change(&mut self, left: u64) {
        self.changed = self.changed.max(left);
        if self.usual_from != u64::MAX {
            self.usual_from = self.changed + 1;
        }
    }

    /// The domain is complete or not, and the results of its evaluated flights are posted.
    pub fn set_complete(&mut self, complete: bool) {
        self.usual_from = if complete { self.changed + 1 } else { u64::MAX };
    }

    /// The frame of this cycle was sent again: its inputs are delivered one by one from now on, and inputs of the cycle
    /// that came before stay.
    pub fn deliver_singly(&mut self, left: u64) {
        self.newest = self.newest.max(left + 1);
    }

    /// Last arrival of inputs.
    pub fn moment(&self, input: InputNumber) -> Moment {
        let of = |moments: &[Moment], number: usize| moments.get(number).copied().unwrap_or_default();
        let shares = self.shares.get(input.datagram).into_iter().flatten();
        let shared = shares.filter(|share| share.parts.get(input.part - share.first).copied().unwrap_or(false));
        let moments = [of(&self.datagrams, input.datagram), of(&self.parts, input.part)];
        moments.into_iter().chain(shared.map(|share| share.moment)).max_by_key(|moment| moment.left).unwrap_or_default()
    }

    /// Inputs have arrived by another way than a frame of this MainDevice.
    #[cfg(feature = "standby")]
    pub fn note_moment(&mut self, input: InputNumber, moment: Moment) {
        self.parts.get_mut(input.part).into_iter().for_each(|part| *part = moment);
    }

    /// Inputs of a share, by its number, arrived again. False where the last copies on this link brought another
    /// selection.
    #[inline]
    pub fn note_share(&mut self, datagram: usize, link: usize, number: u32, moment: Moment) -> bool {
        let Some(share) = self.shares.get_mut(datagram).map(|shares| &mut shares[link]) else { return true };
        let is_same = number != 0 && share.number == number;
        if is_same {
            share.moment = moment;
        }
        is_same
    }

    /// From now on copies on a link bring these inputs; returns the number of the share.
    #[cold]
    pub fn take_share(&mut self, datagram: usize, link: usize, is_part: impl Fn(usize) -> bool, moment: Moment) -> u32 {
        let Some(share) = self.shares.get_mut(datagram).map(|shares| &mut shares[link]) else { return 0 };
        let is_same = share.number != 0 && share.parts.iter().enumerate().all(|(part, has)| *has == is_part(part));
        if !is_same {
            let before = self.parts.iter_mut().skip(share.first).zip(&share.parts).filter(|(_, has)| **has);
            before.filter(|(part, _)| part.left < share.moment.left).for_each(|(part, _)| *part = share.moment);
            share.parts.iter_mut().enumerate().for_each(|(part, has)| *has = is_part(part));
            self.found = self.found.wrapping_add(1).max(1);
            share.number = self.found;
        }
        share.moment = moment;
        share.number
    }
}
