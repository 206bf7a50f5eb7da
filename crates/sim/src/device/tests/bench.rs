//! A test bench for one device: sends datagrams to it and advances virtual time.

use core::time::Duration;

use ringcat_wire::address::{Position, RegisterAddress, Wkc};
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{Frame, FrameBuilder, MacAddress};
use ringcat_wire::mailbox::Header;
use ringcat_wire::register::{SyncManager, SyncManagerActivate, SyncManagerControl, map};
use ringcat_wire::sii::SyncManagerKind;

use crate::catalogue;
use crate::description::DeviceDescription;
use crate::device::Device;
use crate::frame::{Port, SimFrame};
use crate::time::SimTime;

/// Time from one frame to the next.
const STEP: Duration = Duration::from_micros(20);
/// Longer than any transition.
const TRANSITION: Duration = Duration::from_millis(3);

pub struct Bench {
    pub device: Device,
    pub now: SimTime,
    frames: u64,
    /// Use the mailboxes of BOOT instead of those of PREOP.
    bootstrap: bool,
}

impl Bench {
    /// A device of the catalogue in INIT.
    pub fn named(name: &str) -> Bench {
        Bench::new(catalogue::by_name(name).unwrap())
    }

    /// A device in INIT with its SII loaded.
    pub fn new(description: DeviceDescription) -> Bench {
        let mut bench =
            Bench { device: Device::new(description), now: SimTime::from_millis(1), frames: 0, bootstrap: false };
        bench.power_on();
        bench
    }

    /// Switches power and link on; the SII is loaded.
    pub fn power_on(&mut self) {
        self.device.power_on(self.now);
        self.device.controller.link_changed(Port::A, true, self.now);
        self.pass(Duration::from_millis(20));
        assert!(self.device.controller.pdi_operational());
    }

    /// Switches the power off and on.
    pub fn power_cycle(&mut self) {
        self.device.power_off(self.now);
        self.now += Duration::from_millis(100);
        self.power_on();
    }

    /// A device brought up to `state` with valid settings.
    pub fn up_to(description: DeviceDescription, state: AlState) -> Bench {
        let mut bench = Bench::new(description);
        bench.climb(state);
        bench
    }

    /// Brings the device up to `state` with valid settings.
    pub fn climb(&mut self, state: AlState) {
        let states = [AlState::PreOp, AlState::SafeOp, AlState::Op];
        let steps = states.iter().position(|step| *step == state).unwrap() + 1;
        for step in &states[..steps] {
            match step {
                AlState::PreOp => self.set_mailbox(),
                AlState::SafeOp => self.set_process_data(),
                _ => self.write_outputs(),
            }
            let (status, code) = self.request(*step);
            let name = self.device.name().to_string();
            assert_eq!((status, code), (AlStatus::new(*step), AlStatusCode::NO_ERROR), "{name} to {step}: {code}");
        }
    }

    /// Sends one datagram and runs the device.
    pub fn exchange(&mut self, command: Command, target: Target, data: &[u8]) -> (Vec<u8>, u16) {
        let mut buffer = vec![0; 1514];
        let source = MacAddress([0x0C, 0, 0, 0, 0, 1]);
        let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, source).unwrap();
        let offset = builder.datagram(command, 1, target, data.len()).unwrap();
        builder.data_mut(offset, data.len()).unwrap().copy_from_slice(data);
        let length = builder.finish();
        buffer.truncate(length);
        self.frames += 1;
        let mut frame = SimFrame::new(self.frames, buffer);
        self.device.controller.receive(&mut frame, Port::A, self.now);
        self.react();
        self.pass(STEP);
        let parsed = Frame::parse(&frame.bytes).unwrap();
        let datagram = parsed.datagrams().next().unwrap();
        let Wkc(wkc) = datagram.wkc;
        (datagram.data.to_vec(), wkc)
    }

    fn react(&mut self) {
        for _ in 0..8 {
            if !self.device.needs_run() {
                return;
            }
            self.device.run(self.now);
        }
    }

    /// Advances virtual time.
    pub fn pass(&mut self, duration: Duration) {
        let end = self.now + duration;
        while let Some(at) = self.device.next_deadline().filter(|at| *at <= end) {
            self.now = self.now.max(at);
            self.device.run(self.now);
        }
        self.now = end;
        self.react();
    }

    pub fn read(&mut self, address: RegisterAddress, length: usize) -> Vec<u8> {
        let (data, wkc) = self.try_read(address, length);
        assert_eq!(wkc, 1, "read of {address}");
        data
    }

    pub fn try_read(&mut self, address: RegisterAddress, length: usize) -> (Vec<u8>, u16) {
        self.exchange(Command::Aprd, target(address), &vec![0; length])
    }

    pub fn write(&mut self, address: RegisterAddress, data: &[u8]) {
        assert_eq!(self.try_write(address, data), 1, "write of {address}");
    }

    pub fn try_write(&mut self, address: RegisterAddress, data: &[u8]) -> u16 {
        self.exchange(Command::Apwr, target(address), data).1
    }

    pub fn read_u16(&mut self, address: RegisterAddress) -> u16 {
        let data = self.read(address, 2);
        u16::from_le_bytes([data[0], data[1]])
    }

    /// AL status and code as EtherCAT reads them.
    pub fn status(&mut self) -> (AlStatus, AlStatusCode) {
        let status = AlStatus::from_bits(self.read_u16(map::AL_STATUS));
        (status, AlStatusCode(self.read_u16(map::AL_STATUS_CODE)))
    }

    /// Requests a state and waits.
    pub fn request(&mut self, state: AlState) -> (AlStatus, AlStatusCode) {
        self.control(AlControl::new(state))
    }

    /// Acknowledges an error.
    pub fn acknowledge(&mut self, state: AlState) -> (AlStatus, AlStatusCode) {
        self.control(AlControl::with_acknowledge(state))
    }

    /// Writes AL control and waits.
    pub fn control(&mut self, control: AlControl) -> (AlStatus, AlStatusCode) {
        self.write(map::AL_CONTROL, &control.encode());
        self.pass(TRANSITION);
        self.status()
    }

    /// Uses the mailboxes of BOOT, or those of PREOP, from now on.
    pub fn use_bootstrap(&mut self, bootstrap: bool) {
        self.bootstrap = bootstrap;
    }

    /// A SyncManager according to the description and the default assignment.
    pub fn right(&self, number: u8) -> SyncManager {
        let description = &self.device.description;
        let entry = description.sync_managers[usize::from(number)];
        let length = match entry.kind {
            SyncManagerKind::Outputs | SyncManagerKind::Inputs => description.default_length(number),
            _ => entry.length,
        };
        let boot = description.mailbox.filter(|_| self.bootstrap).map(|mailbox| mailbox.bootstrap);
        let (start, length) = match (entry.kind, boot) {
            (SyncManagerKind::MailboxOut, Some(boot)) => (boot.receive_offset, boot.receive_size),
            (SyncManagerKind::MailboxIn, Some(boot)) => (boot.send_offset, boot.send_size),
            _ => (entry.start, length),
        };
        SyncManager {
            start,
            length,
            control: SyncManagerControl::from_bits(entry.control),
            activate: SyncManagerActivate { enable: length != 0, ..SyncManagerActivate::default() },
            ..SyncManager::default()
        }
    }

    /// Writes a SyncManager: disabled first, because its start and length are writable only then.
    pub fn set_sync_manager(&mut self, number: u8, manager: &SyncManager) {
        let address = map::sync_manager(number);
        self.write(address.offset(SyncManager::ACTIVATE), &[0]);
        self.write(address, &manager.encode()[..5]);
        self.write(address.offset(SyncManager::ACTIVATE), &manager.activate.encode());
    }

    /// Writes valid settings to all writable SyncManagers.
    pub fn try_set_all(&mut self) {
        for number in (0u8..).take(self.device.description.sync_managers.len()) {
            let manager = self.right(number);
            let address = map::sync_manager(number);
            self.try_write(address.offset(SyncManager::ACTIVATE), &[0]);
            self.try_write(address, &manager.encode()[..5]);
            self.try_write(address.offset(SyncManager::ACTIVATE), &manager.activate.encode());
        }
    }

    fn set_kinds(&mut self, kinds: [SyncManagerKind; 2]) {
        let managers = self.device.description.sync_managers.clone();
        for (number, entry) in (0u8..).zip(managers) {
            if kinds.contains(&entry.kind) {
                let right = self.right(number);
                self.set_sync_manager(number, &right);
            }
        }
    }

    pub fn set_mailbox(&mut self) {
        self.set_kinds([SyncManagerKind::MailboxOut, SyncManagerKind::MailboxIn]);
    }

    pub fn set_process_data(&mut self) {
        self.set_kinds([SyncManagerKind::Outputs, SyncManagerKind::Inputs]);
    }

    /// Numbers of the enabled SyncManagers of a type.
    pub fn numbers(&self, kind: SyncManagerKind) -> Vec<u8> {
        let managers = (0u8..).zip(&self.device.description.sync_managers);
        let used = managers.filter(|(number, entry)| entry.kind == kind && self.right(*number).length != 0);
        used.map(|(number, _)| number).collect()
    }

    /// Writes zeros to all outputs.
    pub fn write_outputs(&mut self) {
        for number in self.numbers(SyncManagerKind::Outputs) {
            let manager = self.right(number);
            self.write(RegisterAddress(manager.start), &vec![0; usize::from(manager.length)]);
        }
    }

    /// Writes the outputs of the first output SyncManager.
    pub fn output(&mut self, data: &[u8]) {
        let number = self.numbers(SyncManagerKind::Outputs)[0];
        let start = self.right(number).start;
        self.write(RegisterAddress(start), data);
    }

    /// Reads the inputs of the first input SyncManager.
    pub fn input(&mut self) -> Vec<u8> {
        let number = self.numbers(SyncManagerKind::Inputs)[0];
        let manager = self.right(number);
        self.read(RegisterAddress(manager.start), usize::from(manager.length))
    }

    /// Writes a message to the mailbox; false if the mailbox is full.
    pub fn send_mail(&mut self, header: Header, payload: &[u8]) -> bool {
        let manager = self.right(self.numbers(SyncManagerKind::MailboxOut)[0]);
        let mut message = header.encode().to_vec();
        message.extend_from_slice(payload);
        message.resize(usize::from(manager.length), 0);
        self.try_write(RegisterAddress(manager.start), &message) == 1
    }

    /// Reads the message in the mailbox.
    pub fn fetch_mail(&mut self) -> Option<(Header, Vec<u8>)> {
        let manager = self.right(self.numbers(SyncManagerKind::MailboxIn)[0]);
        let (data, wkc) = self.try_read(RegisterAddress(manager.start), usize::from(manager.length));
        if wkc == 0 {
            return None;
        }
        let header = Header::decode(data.first_chunk().unwrap());
        Some((header, data[Header::LEN..][..usize::from(header.length)].to_vec()))
    }
}

fn target(address: RegisterAddress) -> Target {
    Target::Position(Position(0), address)
}
