//! Interfaces of packet sockets whose rings other processes use: given to them, and taken away from them.
//!
//! `bind` acts on the socket, whichever processes have it. So a process that has a duplicate can take an interface away
//! from another one, and give it the same interface when that was removed and has come back. None of it needs a
//! privilege.

use std::os::fd::{AsRawFd, BorrowedFd};

use super::{bind, ethernet, join};
use crate::error::LinkError;
use crate::filter;
use crate::kernel;

/// The interface that leads nowhere.
const LOOPBACK: &str = "lo";

/// An Ethernet interface that is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PresentInterface {
    /// Its number. Another one, or the same that comes back, has another number.
    pub index: u32,
    /// Its address.
    pub mac: [u8; 6],
}

impl PresentInterface {
    /// The interface with this name; `None` if there is none.
    ///
    /// # Errors
    /// It is no Ethernet interface.
    pub fn find(name: &str) -> Result<Option<PresentInterface>, LinkError> {
        match ethernet(name) {
            Ok((index, mac)) => Ok(Some(PresentInterface { index: index as u32, mac })),
            Err(LinkError::NoInterface { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Gives a socket that was prepared, or whose interface was removed, an interface.
///
/// # Errors
/// The interface is gone, or the descriptor is no packet socket.
pub fn give(socket: BorrowedFd<'_>, name: &str, interface: PresentInterface) -> Result<(), LinkError> {
    let failed = |what| move |errno| LinkError::from_errno(name, what, errno);
    let (fd, index) = (socket.as_raw_fd(), interface.index as libc::c_int);
    bind(fd, index, filter::ETHERCAT).map_err(failed("binding to the interface"))?;
    join(fd, index, true).map_err(failed("joining the EtherCAT group"))?;
    // An interface that was removed, or is down, leaves a pending error, which the first send would return.
    kernel::clear_error(&socket);
    Ok(())
}

/// Number of the interface that a socket has; `None` if it has none, or it was removed.
///
/// # Errors
/// The descriptor is no socket.
pub fn given(socket: BorrowedFd<'_>) -> Result<Option<u32>, LinkError> {
    let failed = |errno| LinkError::from_errno("", "asking for the interface of a socket", errno);
    let index = kernel::bound_interface(socket.as_raw_fd()).map_err(failed)?;
    Ok(u32::try_from(index).ok().filter(|index| *index > 0))
}

/// Takes the interface away from a socket of which another process may have a duplicate: what it still sends goes to
/// the loopback interface, and it receives nothing.
///
/// # Errors
/// The descriptor is no packet socket.
pub fn revoke(socket: BorrowedFd<'_>) -> Result<(), LinkError> {
    let failed = |errno| LinkError::from_errno(LOOPBACK, "taking the interface away from a socket", errno);
    let index = kernel::index_of(LOOPBACK).ok_or_else(|| failed(libc::ENODEV))?;
    bind(socket.as_raw_fd(), index as libc::c_int, 0).map_err(failed)
}
