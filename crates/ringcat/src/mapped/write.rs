//! Why process data cannot be written.

use std::fmt;

use ringcat_engine::domain::DomainId;
use ringcat_engine::main_device::ObjectOf;

use super::bits::DoesNotFit;

/// Process data was not written; nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WriteError {
    /// The place is an input, or belongs to no SubDevice: the next frame would overwrite it.
    NotAnOutput {
        /// The domain.
        domain: DomainId,
        /// First bit of the place in the domain's image.
        start: u64,
        /// The object at that bit; `None` if no PDO entry is there.
        object: Option<ObjectOf>,
    },
    /// The place ends behind the domain's image, or there is no such domain.
    Outside {
        /// The domain.
        domain: DomainId,
        /// The bit behind the place.
        end: u64,
        /// Bits of the image.
        image_bits: u64,
    },
    /// Entries of 1 to 64 bits are written by value; longer ones by
    /// [`outputs_mut`](crate::ProcessData::outputs_mut).
    Length {
        /// Bits of the entry.
        bits: u16,
    },
    /// The value has more bits than the entry.
    DoesNotFit(DoesNotFit),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WriteError::NotAnOutput { domain, start, object } => {
                if let Some(object) = object {
                    write!(f, "{object}: ")?;
                }
                write!(f, "domain {domain}, bit {start}: not an output, so it cannot be written")
            }
            WriteError::Outside { domain, end, image_bits } => {
                write!(f, "domain {domain}: the place ends at bit {end}, the image has {image_bits} bits")
            }
            WriteError::Length { bits } => write!(f, "expected an entry of 1 to 64 bits, got {bits} bits"),
            WriteError::DoesNotFit(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for WriteError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            WriteError::DoesNotFit(error) => Some(error),
            _ => None,
        }
    }
}

impl From<DoesNotFit> for WriteError {
    fn from(error: DoesNotFit) -> WriteError {
        WriteError::DoesNotFit(error)
    }
}
