//! Start-up lists of many drives at once, measured in virtual time and compared with the lower bound.
//!
//! Servo drives are connected to one link, each responds 1 ms after a mailbox request. The time is measured from
//! activation, with the segment scanned and all SubDevices in INIT, until all are in OP and process data is complete.
//!
//! There are two lower bounds. One is the time of a single drive. The other is the wire time of all mail: for each
//! object a request, written as header, data and last byte, and a read of the whole send mailbox, in the smallest
//! number of frames. State changes, mailbox polls and cyclic frames are not included.

use std::time::Duration;

use ringcat::{Options, Scan, automatic};
use ringcat_engine::mail::MailCounters;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::datagram::OVERHEAD;
use ringcat_wire::frame::{BYTE_TIME_NS, ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MAX_FRAME, wire_time_ns};
use ringcat_wire::mailbox::{Header, sdo};

use crate::segments::{descriptions, line};
use crate::world::World;

/// Response time of a drive.
pub const ANSWER_TIME: Duration = Duration::from_millis(1);
/// Start address of the mailboxes, and distance of two areas of a drive, in bytes.
const MAILBOX_START: u16 = 0x1000;
const AREA: u16 = 0x100;

/// A start of some drives.
#[derive(Clone, Copy, Debug)]
pub struct Lists {
    /// Drives on the line.
    pub drives: usize,
    /// Objects in the list of each.
    pub objects: u32,
    /// Bytes of each mailbox.
    pub mailbox: u16,
    /// Cycle of the process data.
    pub period: Duration,
}

/// Cost of a start.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// From activation to OP.
    pub time: Duration,
    /// Wire time of the acyclic frames meanwhile.
    pub acyclic: Duration,
    /// Wire time of the cyclic frames meanwhile.
    pub cyclic: Duration,
    /// Counters of all mailboxes.
    pub mail: MailCounters,
}

impl Lists {
    /// Starts the drives.
    ///
    /// # Panics
    /// When they are not in OP in time, or a response has no waiting request.
    pub fn start(self) -> Cost {
        let mut devices = descriptions(&vec!["servo"; self.drives]);
        for device in &mut devices {
            let mailbox = device.mailbox.as_mut().expect("it has one");
            mailbox.response_time = ANSWER_TIME;
            mailbox.standard.receive_size = self.mailbox;
            mailbox.standard.send_offset = MAILBOX_START + self.mailbox;
            mailbox.standard.send_size = self.mailbox;
            let mut at = MAILBOX_START;
            for (number, manager) in device.sync_managers.iter_mut().enumerate() {
                manager.start = at;
                if number < 2 {
                    manager.length = self.mailbox;
                }
                at += if number < 2 { self.mailbox } else { AREA };
            }
        }
        let declare = |scan: &Scan| {
            let mut declaration = automatic(&scan.subdevices, self.period);
            for config in &mut declaration.subdevices {
                for number in 0..self.objects {
                    *config = config.clone().sdo(0x6065, 0, number.to_le_bytes());
                }
            }
            declaration
        };
        let network = line(devices, NetworkOptions::default());
        let mut world = World::with(1, network, &Options::default(), declare).expect("activation");
        let start = (world.now(), world.application().acyclic_counters(), world.application().cyclic_counters());
        world.settle();
        let (acyclic, cyclic) = (world.application().acyclic_counters(), world.application().cyclic_counters());
        let mut mail = MailCounters::default();
        for counters in (0..self.drives).map(|drive| world.mailbox(drive).counters()) {
            assert_eq!((counters.unclaimed, counters.rewritten, counters.repeats), (0, 0, 0), "{counters:?}");
            mail.written += counters.written;
            mail.read += counters.read;
            mail.empty_reads += counters.empty_reads;
            mail.polls += counters.polls;
        }
        let wire = |frames: u64, bytes: u64| Duration::from_nanos(frames * wire_time_ns(0) + bytes * BYTE_TIME_NS);
        Cost {
            time: world.now() - start.0,
            acyclic: wire(acyclic.sent - start.1.sent, acyclic.bytes - start.1.bytes),
            cyclic: wire(cyclic.sent - start.2.sent, cyclic.bytes - start.2.bytes),
            mail,
        }
    }

    /// Wire time of the necessary mail alone.
    pub fn mail_alone(self) -> Duration {
        const HEADERS: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
        let last_byte = OVERHEAD + 1;
        let write = OVERHEAD + Header::LEN + sdo::INITIATE_LEN + last_byte;
        let read = OVERHEAD + usize::from(self.mailbox);
        let bytes = (write + read) * self.drives * self.objects as usize;
        let frames = bytes.div_ceil(MAX_FRAME - HEADERS);
        Duration::from_nanos(frames as u64 * wire_time_ns(HEADERS) + bytes as u64 * BYTE_TIME_NS)
    }
}
