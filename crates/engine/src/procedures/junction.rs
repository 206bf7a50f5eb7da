//! Rings behind junctions (protocol 9.4): which there are ([`learn()`]), whether
//! those that are declared are where they are said to be ([`refute()`]), where they are broken when nothing comes back
//! ([`isolate`]), and the orders that their junctions have ([`orders`]). What becomes of them in operation is a matter
//! of the model ([`crate::segment`]).
//!
//! The controllers keep a local ring going by themselves; nothing here is needed for that. It is about knowledge: which
//! may be entered from behind without being cabled wrongly, that a cable is broken, and when there must not be another
//! one.

mod isolate;
mod learn;
mod orders;
mod refute;

pub(super) use self::isolate::isolate_rings;
pub(super) use self::learn::learn;
pub(super) use self::orders::note_controls;
pub(crate) use self::orders::{UnderWay, ordering};
pub(crate) use self::refute::refute;
