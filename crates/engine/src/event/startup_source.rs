//! What a start-up command has read.

use alloc::string::String;
use core::fmt;

use ringcat_wire::mailbox::soe::Idn;

/// What a start-up command has read.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StartupSource {
    /// An object (protocol 6.3).
    Object {
        /// Index of the object.
        index: u16,
        /// Subindex of the object.
        sub_index: u8,
    },
    /// Elements of an IDN (protocol 6.6).
    Idn {
        /// Drive of the SubDevice.
        drive: u8,
        /// The IDN.
        idn: Idn,
    },
    /// A file (protocol 6.4).
    File {
        /// Its name.
        name: String,
    },
}

impl fmt::Display for StartupSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartupSource::Object { index, sub_index } => write!(f, "{index:#06x}:{sub_index:02x}"),
            StartupSource::Idn { drive, idn } => write!(f, "{idn} of drive {drive}"),
            StartupSource::File { name } => write!(f, "file \"{name}\""),
        }
    }
}
