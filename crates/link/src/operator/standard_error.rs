//! The standard error of the process, written without waiting.

use std::mem::MaybeUninit;

/// Whether the standard error is this file, as `device:inode`.
pub fn is_at(named: &str) -> bool {
    let Some((device, inode)) = named.split_once(':') else { return false };
    let (Ok(device), Ok(inode)) = (device.parse::<u64>(), inode.parse::<u64>()) else { return false };
    let mut found = MaybeUninit::<libc::stat>::zeroed();
    // SAFETY: the pointer is to memory for one value, in which zeros are valid.
    let found = unsafe {
        if libc::fstat(libc::STDERR_FILENO, found.as_mut_ptr()) < 0 {
            return false;
        }
        found.assume_init()
    };
    #[allow(clippy::unnecessary_cast, reason = "the types differ between targets")]
    let own = (found.st_dev as u64, found.st_ino as u64);
    own == (device, inode)
}

/// Writes a line of at most `PIPE_BUF` bytes to a descriptor; false if nothing takes it now.
pub fn write_now(fd: libc::c_int, line: &[u8]) -> bool {
    let mut rest = line;
    while !rest.is_empty() {
        let mut polled = libc::pollfd { fd, events: libc::POLLOUT, revents: 0 };
        // SAFETY: the pointer is to one live value; it does not wait.
        let ready = unsafe { libc::poll(&mut polled, 1, 0) };
        // Without a reader a write would also raise SIGPIPE.
        if ready <= 0 || polled.revents & (libc::POLLERR | libc::POLLNVAL) != 0 || polled.revents & libc::POLLOUT == 0 {
            return false;
        }
        // SAFETY: pointer and length describe live bytes, which the kernel only reads. A pipe that is ready has room
        // for `PIPE_BUF` bytes.
        let written = unsafe { libc::write(fd, rest.as_ptr().cast(), rest.len()) };
        match usize::try_from(written) {
            Ok(written) => rest = &rest[written..],
            Err(_) if crate::kernel::errno() == libc::EINTR => {}
            Err(_) => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::os::fd::AsRawFd;

    use super::*;

    // covers: links
    #[test]
    fn a_line_that_nothing_takes_is_lost_at_once_and_later_ones_pass_again() {
        let (mut reader, writer) = std::io::pipe().expect("a pipe");
        let line = [b'x'; 4096];
        let taken = (0..10_000).take_while(|_| write_now(writer.as_raw_fd(), &line)).count();
        assert!((1..10_000).contains(&taken), "{taken}");
        assert!(!write_now(writer.as_raw_fd(), b"y\n"), "the pipe is full");
        let mut all = vec![0; taken * line.len()];
        reader.read_exact(&mut all).expect("it was written");
        assert!(all.iter().all(|byte| *byte == b'x') && write_now(writer.as_raw_fd(), b"z\n"));
        drop(reader);
        assert!(!write_now(writer.as_raw_fd(), b"z\n"), "nothing reads");
        assert!(!write_now(-1, b"z\n"), "it is closed");
    }
}
