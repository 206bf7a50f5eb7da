//! Return codes: negative error numbers of Linux, as `ecrt.h` gives them to C.

use ringcat::daemon::{OperatorLines, Priority};

use crate::environment::program_name;
use crate::host::variable;
use crate::locks::OfProcess;

/// Why a call failed. The value is what C gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code(pub i32);

/// Result of a call.
pub type Outcome<T = ()> = Result<T, Code>;

impl Code {
    /// The handle was opened and not requested.
    pub const NOT_RESERVED: Code = Code(-libc::EPERM);
    /// No such SubDevice, PDO, entry, or nothing is there.
    pub const NOT_FOUND: Code = Code(-libc::ENOENT);
    /// A message or datagram was not answered, or the master has failed (a panic).
    pub const IO: Code = Code(-libc::EIO);
    /// There is no reference clock.
    pub const NO_CLOCK: Code = Code(-libc::ENXIO);
    /// The object is in use by another call, or the phase does not allow this.
    pub const BUSY: Code = Code(-libc::EBUSY);
    /// The PDO is assigned already.
    pub const EXISTS: Code = Code(-libc::EEXIST);
    /// An argument is wrong, or the handle is not alive.
    pub const INVALID: Code = Code(-libc::EINVAL);
    /// A pointer that is needed is NULL.
    pub const FAULT: Code = Code(-libc::EFAULT);
    /// The reserved memory is too small.
    pub const NO_SPACE: Code = Code(-libc::ENOBUFS);
    /// The memory of the caller is too small, or there are too few FMMUs.
    pub const OVERFLOW: Code = Code(-libc::EOVERFLOW);
    /// No answer within the limit.
    pub const TIMED_OUT: Code = Code(-libc::ETIMEDOUT);
    /// The SubDevice does not support the protocol.
    pub const NO_PROTOCOL: Code = Code(-libc::EPROTONOSUPPORT);
    /// The acyclic half has ended.
    pub const GONE: Code = Code(-libc::ENODEV);
}

/// Writes a line for the operator about something that failed, as [`report_as`].
pub fn report(line: std::fmt::Arguments<'_>) {
    report_as(Priority::Error, line);
}

/// Writes a line for the operator to standard error, and to the journal where there is one. It never waits.
pub fn report_as(priority: Priority, line: std::fmt::Arguments<'_>) {
    static LINES: OfProcess<OperatorLines> = OfProcess::new();
    let lines = LINES.of(|| OperatorLines::new(&program_name(), variable));
    lines.write(priority, &format!("EtherCAT: {line}"));
}
