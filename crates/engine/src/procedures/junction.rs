//! Rings behind junctions (protocol 9.4): detection ([`learn()`]), test of declared rings ([`refute()`]), location of
//! breaks when no frame returns ([`isolate`]), and the port commands of their junctions ([`orders`]). The model
//! contains their state in operation ([`crate::segment`]).
//!
//! The controllers switch a local ring over without the MainDevice. These procedures only find out: which SubDevices
//! frames may enter from behind without wrong cabling, that a cable is broken, and that a second break would interrupt
//! the ring.

mod isolate;
mod learn;
mod orders;
mod refute;

pub(super) use self::isolate::isolate_rings;
pub(crate) use self::learn::Reached;
pub(super) use self::learn::learn;
pub(super) use self::orders::note_controls;
pub(crate) use self::orders::{UnderWay, ordering};
pub(crate) use self::refute::{Refuted, refute};
