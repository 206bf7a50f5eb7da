//! What `ringcat ring --json` prints.

use serde::Serialize;

use super::values;

/// A ring as it was read.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ring {
    /// `closed`, `open`, or `unknown` where not all copies of frames come back; null with one interface
    pub ring: Option<values::Ring>,
    /// SubDevices that answer on the main interface
    pub main_subdevices: u16,
    /// SubDevices that answer on the redundant interface; 0 without one, and where the ring is closed
    pub redundant_subdevices: u16,
    /// The cable that is broken; null without a break, and where its place is not known
    pub line_break: Option<Cable>,
    /// Every cable, in the order of frames of the main interface
    pub cables: Vec<CableErrors>,
}

/// A cable.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cable {
    /// Its end towards the main interface; null: that interface
    pub near: Option<CableEnd>,
    /// Its other end; null: the redundant interface
    pub far: Option<CableEnd>,
}

/// A cable and what the ports at its ends have counted.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CableErrors {
    /// Its end towards the main interface; null: that interface
    pub near: Option<CableEnd>,
    /// Its other end; null: the redundant interface
    pub far: Option<CableEnd>,
    /// Damaged frames, since power-on or, with --for, during that time
    pub damaged_frames: u64,
    /// Lost links, since power-on or, with --for, during that time
    pub lost_links: u64,
}

/// An end of a cable.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CableEnd {
    /// Position of the SubDevice, from 0
    pub position: usize,
    /// Its station address; null where it has none
    pub station: Option<u16>,
    /// Number of its port, 0 to 3
    pub port: u8,
}
