//! Injected frame losses: selected by a datagram in the frame, on the way out or back.

use ringcat_wire::command::Command;
use ringcat_wire::frame::Frame;

/// Frames to be lost.
#[derive(Clone, Copy, Debug)]
pub struct Loss {
    /// Lost on the way out, before any SubDevice processes them; otherwise on the way back, after processing.
    pub outward: bool,
    /// Command of a datagram in them.
    pub command: Command,
    /// Station address of that datagram.
    pub station: u16,
    /// Register or memory that it addresses.
    pub register: u16,
    /// Matching frames that are not lost first.
    pub skip: u32,
    /// Number of lost frames.
    pub count: u32,
}

impl Loss {
    /// The next sent frame that writes there.
    pub fn of_write(station: u16, register: u16) -> Loss {
        Loss { outward: true, command: Command::Fpwr, station, register, skip: 0, count: 1 }
    }

    /// The next sent frame that reads there.
    pub fn of_read(station: u16, register: u16) -> Loss {
        Loss { command: Command::Fprd, ..Loss::of_write(station, register) }
    }

    /// On its way back instead.
    #[must_use]
    pub fn on_the_way_back(self) -> Loss {
        Loss { outward: false, ..self }
    }

    /// This many frames, after some that pass.
    #[must_use]
    pub fn times(self, count: u32, skip: u32) -> Loss {
        Loss { count, skip, ..self }
    }

    /// Whether a frame is to be lost.
    pub(crate) fn hits(&mut self, outward: bool, bytes: &[u8]) -> bool {
        if self.count == 0 || outward != self.outward || !self.matches(bytes) {
            return false;
        }
        if self.skip > 0 {
            self.skip -= 1;
            return false;
        }
        self.count -= 1;
        true
    }

    fn matches(&self, bytes: &[u8]) -> bool {
        let Ok(frame) = Frame::parse(bytes) else { return false };
        frame.datagrams().any(|datagram| {
            let header = datagram.header;
            header.command == self.command && header.adp() == self.station && header.ado().0 == self.register
        })
    }
}
