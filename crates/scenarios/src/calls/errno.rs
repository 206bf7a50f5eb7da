//! The error numbers of `ecrt.h`.

use ringcat::{Error, RegisterError, SdoFailure, SubDeviceFailure};
use ringcat_wire::mailbox::sdo::AbortCode;

/// Why a call failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errno {
    /// EBUSY: already reserved.
    Busy,
    /// EFAULT: an entry that does not begin at a byte, without a place for the bit.
    Fault,
    /// EINVAL: no such SubDevice, or not in this phase.
    Inval,
    /// EIO, with the abort code of the SubDevice if there is one.
    Io(Option<AbortCode>),
    /// ENOBUFS: the answer is longer than the buffer.
    NoBufs,
    /// ENODEV: not reserved.
    NoDev,
    /// ENOENT: not mapped, or another identity at this address.
    NoEnt,
    /// ENXIO: no reference clock.
    NxIo,
    /// EOVERFLOW: too many FMMUs.
    Overflow,
    /// ETIMEDOUT.
    TimedOut,
}

impl From<RegisterError> for Errno {
    fn from(error: RegisterError) -> Errno {
        match error {
            RegisterError::Unknown { .. }
            | RegisterError::NotMapped { .. }
            | RegisterError::NoProcessData { .. }
            | RegisterError::NoSuchPlace { .. } => Errno::NoEnt,
            RegisterError::TooManyPlaces { .. } | RegisterError::TooLarge { .. } => Errno::Overflow,
            _ => Errno::Inval,
        }
    }
}

impl From<SubDeviceFailure> for Errno {
    fn from(failure: SubDeviceFailure) -> Errno {
        match failure {
            SubDeviceFailure::NotScanned | SubDeviceFailure::NoPosition { .. } => Errno::Inval,
            SubDeviceFailure::TimedOut { .. } => Errno::TimedOut,
            SubDeviceFailure::Sdo(error) => match error.cause {
                SdoFailure::Aborted(code) => Errno::Io(Some(code)),
                _ => Errno::Io(None),
            },
            _ => Errno::Io(None),
        }
    }
}

impl From<Error> for Errno {
    fn from(error: Error) -> Errno {
        match error {
            Error::SubDevice(error) => error.failure.into(),
            Error::TimedOut { .. } => Errno::TimedOut,
            _ => Errno::Io(None),
        }
    }
}
