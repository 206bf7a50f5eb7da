//! The bytes of an image: own memory, or memory of the caller that outlives the application.
//!
//! Both are a pointer and a length at the same place, so that an access needs no branch (bin `cycle`).

use alloc::boxed::Box;
use core::ops::{Deref, DerefMut};

/// Memory of an image.
#[derive(Debug)]
pub(crate) enum Bytes {
    /// Own.
    Own(Box<[u8]>),
    /// The caller's.
    Given(&'static mut [u8]),
}

impl Bytes {
    /// Gives the caller's memory back; its present content stays in own memory.
    pub fn give_back(&mut self) -> Option<&'static mut [u8]> {
        let own = Bytes::Own(match self {
            Bytes::Own(_) => return None,
            Bytes::Given(bytes) => Box::from(&**bytes),
        });
        match core::mem::replace(self, own) {
            Bytes::Own(_) => None,
            Bytes::Given(bytes) => Some(bytes),
        }
    }
}

impl Deref for Bytes {
    type Target = [u8];

    #[inline(always)]
    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Own(bytes) => bytes,
            Bytes::Given(bytes) => bytes,
        }
    }
}

impl DerefMut for Bytes {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [u8] {
        match self {
            Bytes::Own(bytes) => bytes,
            Bytes::Given(bytes) => bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn memory_that_is_given_back_has_the_content_and_the_image_keeps_it() {
        let given: &'static mut [u8] = Vec::leak(vec![1, 2, 3]);
        let mut bytes = Bytes::Given(given);
        bytes[1] = 7;
        let back = bytes.give_back().expect("it was given");
        assert_eq!((&*back, &*bytes), (&[1, 7, 3][..], &[1, 7, 3][..]));
        bytes[0] = 9;
        assert_eq!(back, [1, 7, 3], "they are two now");
        assert!(bytes.give_back().is_none());
    }
}
