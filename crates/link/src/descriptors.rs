//! Descriptors that one process passes to another over a Unix socket (`SCM_RIGHTS`).
//!
//! A message has at least one byte, and at most [`MOST`] descriptors. What is received is closed on exec. Neither
//! function is for the cyclic path.

use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};

/// Most descriptors in a message: sockets of both classes for two links, with room for interfaces of EoE.
pub const MOST: usize = 64;

/// Room for the control message, aligned as its header.
#[repr(C)]
union Control {
    _header: libc::cmsghdr,
    _bytes: [u8; 64 + MOST * size_of::<RawFd>()],
}

/// Sends a message with duplicates of descriptors.
///
/// # Errors
/// The message is empty or has too many descriptors, or the system refuses it.
pub fn send(socket: &impl AsRawFd, bytes: &[u8], descriptors: &[RawFd]) -> io::Result<()> {
    if bytes.is_empty() || descriptors.len() > MOST {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    // SAFETY: all bytes zero are valid.
    let (mut control, mut message): (Control, libc::msghdr) = unsafe { (zeroed(), zeroed()) };
    let mut part = libc::iovec { iov_base: bytes.as_ptr().cast_mut().cast(), iov_len: bytes.len() };
    (message.msg_iov, message.msg_iovlen) = (&raw mut part, 1);
    if !descriptors.is_empty() {
        let length = size_of_val(descriptors) as libc::c_uint;
        message.msg_control = (&raw mut control).cast();
        // SAFETY: the functions compute lengths; the room for `MOST` descriptors is enough for these, and the header
        // lies at its beginning.
        unsafe {
            message.msg_controllen = libc::CMSG_SPACE(length) as _;
            let header = libc::CMSG_FIRSTHDR(&raw const message);
            (*header).cmsg_level = libc::SOL_SOCKET;
            (*header).cmsg_type = libc::SCM_RIGHTS;
            (*header).cmsg_len = libc::CMSG_LEN(length) as _;
            std::ptr::copy_nonoverlapping(descriptors.as_ptr(), libc::CMSG_DATA(header).cast(), descriptors.len());
        }
    }
    // SAFETY: the message refers to live memory, which the kernel only reads.
    let sent = unsafe { libc::sendmsg(socket.as_raw_fd(), &raw const message, libc::MSG_NOSIGNAL) };
    match usize::try_from(sent) {
        Err(_) => Err(io::Error::last_os_error()),
        Ok(count) if count < bytes.len() => Err(io::ErrorKind::WriteZero.into()),
        Ok(_) => Ok(()),
    }
}

/// Receives a message into `bytes`: its length, 0 at the end of the stream, and its descriptors.
///
/// # Errors
/// The system reports one, or the message had more than [`MOST`] descriptors; then all are closed.
pub fn receive(socket: &impl AsRawFd, bytes: &mut [u8]) -> io::Result<(usize, Vec<OwnedFd>)> {
    // SAFETY: all bytes zero are valid.
    let (mut control, mut message): (Control, libc::msghdr) = unsafe { (zeroed(), zeroed()) };
    let mut part = libc::iovec { iov_base: bytes.as_mut_ptr().cast(), iov_len: bytes.len() };
    (message.msg_iov, message.msg_iovlen) = (&raw mut part, 1);
    (message.msg_control, message.msg_controllen) = ((&raw mut control).cast(), size_of::<Control>() as _);
    // SAFETY: the message refers to live memory for which any bytes are valid, with its lengths.
    let received = unsafe { libc::recvmsg(socket.as_raw_fd(), &raw mut message, libc::MSG_CMSG_CLOEXEC) };
    let count = usize::try_from(received).map_err(|_| io::Error::last_os_error())?;
    let mut descriptors = Vec::new();
    // SAFETY: the kernel has filled in the control messages and their lengths; each descriptor in them is new and has
    // no other owner.
    unsafe {
        let mut header = libc::CMSG_FIRSTHDR(&raw const message);
        while !header.is_null() {
            if ((*header).cmsg_level, (*header).cmsg_type) == (libc::SOL_SOCKET, libc::SCM_RIGHTS) {
                let length = ((*header).cmsg_len as usize).saturating_sub(libc::CMSG_LEN(0) as usize);
                let first: *const RawFd = libc::CMSG_DATA(header).cast();
                for at in 0..length / size_of::<RawFd>() {
                    descriptors.push(OwnedFd::from_raw_fd(first.add(at).read_unaligned()));
                }
            }
            header = libc::CMSG_NXTHDR(&raw const message, header);
        }
    }
    if message.msg_flags & libc::MSG_CTRUNC != 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "more descriptors than a message may have"));
    }
    Ok((count, descriptors))
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::{Read, Write};
    use std::os::unix::net::UnixStream;

    use super::*;

    #[test]
    fn descriptors_arrive_open_and_closed_on_exec() {
        let (near, far) = UnixStream::pair().expect("a pair");
        let (mut reader, writer) = std::io::pipe().expect("a pipe");
        send(&near, b"pipe", &[writer.as_raw_fd(), reader.as_raw_fd()]).expect("it is sent");
        drop(writer);
        let mut bytes = [0; 16];
        let (count, mut descriptors) = receive(&far, &mut bytes).expect("it is received");
        assert_eq!((&bytes[..count], descriptors.len()), (&b"pipe"[..], 2));
        // SAFETY: no pointers are passed.
        let flags = unsafe { libc::fcntl(descriptors[0].as_raw_fd(), libc::F_GETFD) };
        assert_eq!(flags, libc::FD_CLOEXEC);
        descriptors.truncate(1);
        let mut writer = File::from(descriptors.remove(0));
        writer.write_all(b"through").expect("the pipe is open");
        drop(writer);
        let mut read = String::new();
        reader.read_to_string(&mut read).expect("it ends");
        assert_eq!(read, "through");
    }

    #[test]
    fn messages_without_descriptors_and_the_end_of_the_stream_have_none() {
        let (near, far) = UnixStream::pair().expect("a pair");
        send(&near, b"plain", &[]).expect("it is sent");
        assert!(send(&near, b"", &[]).is_err() && send(&near, b"x", &[0; MOST + 1]).is_err());
        drop(near);
        let mut bytes = [0; 16];
        assert!(matches!(receive(&far, &mut bytes), Ok((5, none)) if none.is_empty()));
        assert!(matches!(receive(&far, &mut bytes), Ok((0, none)) if none.is_empty()));
    }
}
