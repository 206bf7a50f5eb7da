//! The terminal of a program: its size, and its keys one by one.

use std::fs::File;
use std::io::{self, Read};
use std::mem::zeroed;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::sync::OnceLock;
use std::time::Duration;

use crate::process::wait_readable;

/// Columns and rows of a terminal; `None` for anything else, and for a terminal that does not report them.
pub fn size(terminal: BorrowedFd<'_>) -> Option<(u16, u16)> {
    // SAFETY: all bytes zero is a valid size, and the pointer is to a live one.
    let (answered, size) = unsafe {
        let mut size: libc::winsize = zeroed();
        (libc::ioctl(terminal.as_raw_fd(), libc::TIOCGWINSZ, &mut size), size)
    };
    (answered == 0 && size.ws_col > 0 && size.ws_row > 0).then_some((size.ws_col, size.ws_row))
}

/// What comes from the standard input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A byte: that of a key, or one of several.
    Byte(u8),
    /// The input has ended.
    End,
}

/// Ctrl-C, which sends no signal while [`Keys`] exists.
pub const CTRL_C: u8 = 3;
/// Ctrl-D.
pub const CTRL_D: u8 = 4;
/// Ctrl-Z, which stops no program while [`Keys`] exists.
pub const CTRL_Z: u8 = 26;
/// Ctrl-\\, in the same way.
pub const CTRL_BACKSLASH: u8 = 28;

/// Settings of the standard input before the first [`Keys`].
static BEFORE: OnceLock<libc::termios> = OnceLock::new();

/// Gives the terminal the settings back that it had before [`Keys`]: for a hook of panics.
pub fn restore() {
    BEFORE.get().into_iter().for_each(set);
}

/// The standard input, key by key and without an echo where it is a terminal. It is as before when this is dropped.
pub struct Keys {
    /// Without a buffer, in which a key could stay.
    input: File,
    /// The settings before; `None` where it is no terminal.
    before: Option<libc::termios>,
}

impl Keys {
    /// Switches to single keys.
    ///
    /// # Errors
    /// The standard input is closed, or this process has no more descriptors.
    pub fn start() -> io::Result<Keys> {
        let own = io::stdin().as_fd().try_clone_to_owned()?;
        let input = io::stdin().as_raw_fd();
        // SAFETY: all bytes zero are valid settings, and the pointers are to live ones.
        let before = unsafe {
            let mut settings: libc::termios = zeroed();
            (libc::tcgetattr(input, &mut settings) == 0).then_some(settings)
        };
        if let Some(before) = before {
            // Only the first ones are those of the user.
            let _ = BEFORE.set(before);
        }
        let keys = Keys { input: own.into(), before };
        keys.resume();
        Ok(keys)
    }

    /// Gives the terminal its settings back until [`Keys::resume`].
    pub fn pause(&self) {
        self.before.iter().for_each(set);
    }

    /// Switches to single keys again, also after a shell has changed the settings.
    pub fn resume(&self) {
        if let Some(mut settings) = self.before {
            settings.c_lflag &= !(libc::ICANON | libc::ECHO | libc::ISIG);
            settings.c_cc[libc::VMIN] = 1;
            settings.c_cc[libc::VTIME] = 0;
            set(&settings);
        }
    }

    /// The next byte, if one comes within this time.
    pub fn next(&mut self, limit: Duration) -> Option<Key> {
        if wait_readable(&[self.input.as_fd()], limit) == 0 {
            return None;
        }
        let mut byte = [0];
        // A terminal that was closed is an error, and an end.
        Some(match self.input.read(&mut byte) {
            Ok(1) => Key::Byte(byte[0]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return None,
            Ok(_) | Err(_) => Key::End,
        })
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.pause();
    }
}

/// Settings of the standard input. Errors are ignored: it may be closed.
fn set(settings: &libc::termios) {
    // SAFETY: the pointer is to live settings.
    unsafe { libc::tcsetattr(io::stdin().as_raw_fd(), libc::TCSANOW, settings) };
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;

    // covers: daemon
    #[test]
    fn only_a_terminal_has_a_size() {
        let (near, _far) = UnixStream::pair().expect("a pair");
        assert_eq!(size(near.as_fd()), None);
    }
}
