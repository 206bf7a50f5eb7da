//! Values that several commands print.

use serde::Serialize;
use serde::ser::{SerializeSeq, Serializer};

use crate::selection::state_name;

/// A link of the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Link {
    /// The main link.
    Main,
    /// The link at the other end of a ring.
    Redundant,
}

impl Link {
    /// The redundant link, or the main link.
    pub fn of(is_redundant: bool) -> Link {
        if is_redundant { Link::Redundant } else { Link::Main }
    }
}

/// Direction of process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// The MainDevice writes.
    Outputs,
    /// The MainDevice reads.
    Inputs,
}

impl Direction {
    /// The direction of outputs, or of inputs.
    pub fn of(is_output: bool) -> Direction {
        if is_output { Direction::Outputs } else { Direction::Inputs }
    }
}

/// An AL state by its name; `None` without an answer, and for a number that is no state.
pub fn state(status: Option<u16>) -> Option<&'static str> {
    status.and_then(state_name)
}

/// A list of records that are made while they are printed: nothing is copied, and nothing has to be freed.
#[derive(Clone, Copy, Debug)]
pub struct List<'a, S, C, R> {
    /// What they are made of.
    pub all: &'a [S],
    /// What all of them need.
    pub context: C,
    /// Makes one, with its place.
    pub make: fn(usize, &'a S, C) -> R,
}

impl<S, C: Copy, R: Serialize> Serialize for List<'_, S, C, R> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        let mut list = serializer.serialize_seq(None)?;
        for (place, it) in self.all.iter().enumerate() {
            list.serialize_element(&(self.make)(place, it, self.context))?;
        }
        list.end()
    }
}

/// Names of the bits that are set.
#[derive(Clone, Copy, Debug)]
pub struct Bits {
    /// Names by bit.
    pub names: &'static [&'static str],
    /// The bits.
    pub bits: u16,
}

impl Bits {
    /// The names of those that are set.
    pub fn set(self) -> impl Iterator<Item = &'static str> {
        let is_set = move |(bit, _): &(u16, _)| self.bits >> bit & 1 != 0;
        (0..).zip(self.names).filter(is_set).map(|(_, name)| *name)
    }
}

impl Serialize for Bits {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        let mut list = serializer.serialize_seq(None)?;
        for name in self.set() {
            list.serialize_element(name)?;
        }
        list.end()
    }
}

/// Bytes as hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hex<'a>(pub &'a [u8]);

impl Serialize for Hex<'_> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.serialize_bytes(self.0)
    }
}
