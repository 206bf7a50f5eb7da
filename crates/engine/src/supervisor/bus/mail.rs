//! Reads and writes mailboxes as memory of a SubDevice, once each, and keeps late mail.

use alloc::vec;
use alloc::vec::Vec;
use core::future::Future;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{OVERHEAD, Target};

use super::Bus;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::stray::Stray;
use crate::supervisor::transfer::Request;

impl Bus {
    /// Writes a mailbox of `size` bytes, once: its beginning and its last byte, which completes the write, in one frame
    /// (protocol 6.1). The working counter is that of the last byte.
    pub fn write_mail(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        mail: Vec<u8>,
        size: u16,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let at = |offset: u16| Target::Station(station, register.offset(offset));
        let (command, expected) = (Command::Fpwr, Some(Wkc(1)));
        // A second datagram has overhead of its own.
        let (preceding, target, data) = if mail.len() + OVERHEAD < usize::from(size) {
            (Some((command, at(0), mail)), at(size - 1), vec![0; 1])
        } else {
            let mut whole = mail;
            whole.resize(usize::from(size), 0);
            (None, at(0), whole)
        };
        self.submit(Request { expected, preceding, polls: true, ..Request::once(command, target, data) })
    }

    /// Reads a mailbox, once. The mail of a second copy, and late mail, is kept for [`Bus::stray_mail`].
    pub fn read_mail(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        length: usize,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let (target, data) = (Target::Station(station, register), vec![0; length]);
        let (command, expected, mail) = (Command::Fprd, Some(Wkc(1)), Some(station));
        self.submit(Request { expected, mail, polls: true, ..Request::once(command, target, data) })
    }

    /// Takes the oldest mail of a SubDevice that came back after its read was given up.
    pub fn stray_mail(&self, station: StationAddress) -> Option<Stray> {
        self.shared.borrow_mut().strays.take(station)
    }

    /// Whether there is such a mail.
    pub fn has_stray_mail(&self, station: StationAddress) -> bool {
        self.shared.borrow().strays.has(station)
    }

    /// Whether there is such a mail of any SubDevice.
    pub(crate) fn has_stray_mails(&self) -> bool {
        self.shared.borrow().strays.has_any()
    }
}
