//! Tests of the controller through its ports and its PDI, with literal register contents. The bench sends one frame of
//! one or more datagrams at a time and returns the outgoing frame.

mod clock;
mod commands;
mod fmmus;
mod ports;
mod properties;
mod protection;
mod registers;
mod sii;
mod sync_managers;
mod watchdogs;

use core::time::Duration;

use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{Header, Target};
use ringcat_wire::frame::{FrameBuilder, MacAddress};
use ringcat_wire::register::PortKind;
use ringcat_wire::sii::checksum;

use super::*;

/// An EEPROM of 2 KByte with a configuration area: no device emulation, alias 0x1234, pulse length 100.
fn image() -> Vec<u8> {
    let mut image = vec![0; 2048];
    image[..10].copy_from_slice(&[0x05, 0x0E, 0x03, 0x44, 0x64, 0x00, 0x00, 0x00, 0x34, 0x12]);
    sign(&mut image);
    image[16..24].copy_from_slice(&[0x02, 0x00, 0x00, 0x00, 0x52, 0x30, 0xF0, 0x07]);
    image
}

/// Writes a valid checksum.
fn sign(image: &mut [u8]) {
    let mut checked = [0; 14];
    checked.copy_from_slice(&image[..14]);
    image[14] = checksum(&checked);
}

fn config() -> ControllerConfig {
    ControllerConfig { ports: [PortKind::Mii; 4], sii: image(), ..ControllerConfig::default() }
}

/// A datagram to send: command, address as ADP and ADO, data.
type Sent<'a> = (Command, u16, u16, &'a [u8]);

/// Data and working counter of a returned datagram.
type Returned = (Vec<u8>, u16);

fn target(command: Command, adp: u16, ado: u16) -> Target {
    match command {
        Command::Lrd | Command::Lwr | Command::Lrw => {
            Target::Logical(LogicalAddress(u32::from(adp) | u32::from(ado) << 16))
        }
        Command::Fprd | Command::Fpwr | Command::Fprw | Command::Frmw => {
            Target::Station(StationAddress(adp), RegisterAddress(ado))
        }
        _ => Target::Position(Position(0u16.wrapping_sub(adp)), RegisterAddress(ado)),
    }
}

fn frame_bytes(datagrams: &[Sent]) -> Vec<u8> {
    let mut buffer = vec![0; 1514];
    let source = MacAddress([0x10, 0x11, 0x12, 0x13, 0x14, 0x15]);
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, source).unwrap();
    for &(command, adp, ado, data) in datagrams {
        let header = Header::new(command, 0x5A, target(command, adp, ado), data.len() as u16);
        let at = builder.header(header).unwrap();
        builder.data_mut(at, data.len()).unwrap().copy_from_slice(data);
    }
    let len = builder.finish();
    buffer.truncate(len);
    buffer
}

fn returned(frame: &SimFrame, n: usize) -> Returned {
    let place = frame.datagrams[n];
    let wkc = u16::from_le_bytes(frame.bytes[place.wkc()..place.end()].try_into().unwrap());
    (frame.bytes[place.data()..place.wkc()].to_vec(), wkc)
}

/// A controller with its EEPROM loaded and a link at port 0.
struct Bench {
    controller: Controller,
    now: SimTime,
    next_id: u64,
}

impl Bench {
    fn new() -> Bench {
        Bench::with(config())
    }

    fn with(config: ControllerConfig) -> Bench {
        let mut bench = Bench { controller: Controller::new(config), now: SimTime::from_micros(10), next_id: 1 };
        bench.controller.power_on(bench.now);
        bench.wait(Duration::from_millis(2));
        bench.link(Port::A, true);
        bench
    }

    fn wait(&mut self, time: Duration) {
        self.now += time;
        self.controller.tick(self.now);
    }

    fn link(&mut self, port: Port, up: bool) {
        self.controller.link_changed(port, up, self.now);
    }

    fn frame(&mut self, datagrams: &[Sent]) -> SimFrame {
        self.next_id += 1;
        SimFrame::new(self.next_id, frame_bytes(datagrams))
    }

    /// Receives a frame 10 us later.
    fn receive(&mut self, frame: &mut SimFrame, port: Port) -> Passage {
        self.now += Duration::from_micros(10);
        self.controller.receive(frame, port, self.now)
    }

    /// Sends one frame to port 0 and returns its datagrams.
    fn exchange(&mut self, datagrams: &[Sent]) -> Vec<Returned> {
        let mut frame = self.frame(datagrams);
        assert_ne!(self.receive(&mut frame, Port::A), Passage::Destroyed);
        (0..datagrams.len()).map(|n| returned(&frame, n)).collect()
    }

    fn one(&mut self, datagram: Sent) -> Returned {
        self.exchange(&[datagram]).remove(0)
    }

    /// As `exchange`, with a damaged frame.
    fn damaged(&mut self, datagrams: &[Sent]) -> Vec<Returned> {
        let mut frame = self.frame(datagrams);
        frame.fcs = Fcs::Bad;
        self.receive(&mut frame, Port::A);
        (0..datagrams.len()).map(|n| returned(&frame, n)).collect()
    }

    /// Writes by APWR; returns the working counter.
    fn write(&mut self, ado: u16, data: &[u8]) -> u16 {
        self.one((Command::Apwr, 0, ado, data)).1
    }

    /// Reads by APRD.
    fn read(&mut self, ado: u16, len: usize) -> Returned {
        self.one((Command::Aprd, 0, ado, &vec![0; len]))
    }

    fn register<const N: usize>(&self, address: u16) -> [u8; N] {
        self.controller.register(RegisterAddress(address), N).try_into().unwrap()
    }

    fn pdi_read(&mut self, address: u16, len: usize) -> Option<Vec<u8>> {
        let mut out = vec![0; len];
        self.controller.pdi_read(RegisterAddress(address), &mut out, self.now).then_some(out)
    }

    fn pdi_write(&mut self, address: u16, data: &[u8]) -> bool {
        self.controller.pdi_write(RegisterAddress(address), data, self.now)
    }
}
