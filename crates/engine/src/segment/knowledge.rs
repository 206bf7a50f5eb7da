//! What is known of a SubDevice from its SII and registers.

use alloc::rc::Rc;
use alloc::string::String;

use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// What is known of a SubDevice from its SII and registers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Knowledge {
    /// It has never answered.
    NeverSeen,
    /// It is being read, since this time.
    Awaited(Instant),
    /// Its SII cannot be read; the last reported reason.
    Unreadable(String),
    /// Its identity and features.
    Known(Rc<SubDeviceInfo>),
}

impl Knowledge {
    /// Its identity and features, if known.
    pub fn info(&self) -> Option<&Rc<SubDeviceInfo>> {
        match self {
            Knowledge::Known(info) => Some(info),
            Knowledge::NeverSeen | Knowledge::Awaited(_) | Knowledge::Unreadable(_) => None,
        }
    }
}
