//! Checks of captures: recomputes from a file alone whether a MainDevice followed the rules on the wire.
//!
//! Input: a pcapng file with both directions of one or two links, main link first. Output: a [`Verdict`]. It has
//! parsers of its own for pcapng, Ethernet and EtherCAT: no code of the engine or of `ringcat-wire` is used, so that a
//! common misreading is detected. Constants are those of protocol 1.1 to 1.4 and 9.7.
//!
//! Checks of every sent frame:
//!
//! 1. **Form** (protocol 1.1 to 1.3): EtherType 0x88A4, type 1, 60 to 1,514 bytes, the length in the EtherCAT header is
//!    that of the datagrams, the M bit is set in all of them but the last, reserved bits and padding are zero.
//! 2. **Circulation** (protocol 2.4, CR-25): the C bit of each datagram is 0.
//! 3. **Fresh datagrams** (protocol 1.2): working counters and event requests are 0.
//! 4. **Reads** (protocol 9.3): the data of APRD, FPRD, BRD and LRD is zeros. (For LRW, APRW, FPRW and BRW read and
//!    written data cannot be distinguished; ARMW and FRMW write their data to all other SubDevices.)
//! 5. **Link mark** (SM-01): the RED bit of the source address is set on the redundant link and clear on the main link.
//! 6. **Pairs** (CR-01, SM-02): with two links each frame is sent once on each; the copies differ only in the RED bit,
//!    in the ADP of auto-increment commands (CR-09) and in station addresses that are written (unassigned SubDevices on
//!    two links must not get the same address).
//! 7. **Ids** (CR-04, SM-02): a frame's number, 15 bits from source address and Idx within its class (bit 7 of the
//!    first datagram's Idx), is that of the frame before plus 1, or 1 if the MainDevice restarts its count (scan,
//!    activation, stop); all datagrams of a frame carry the same Idx.
//! 8. **Flights** (CR-04, CR-07, SM-03): each copy comes back at most once, and not after the 8 bits of its id in the
//!    source address were used by another frame of its class: no id is in flight twice. Only sent frames come back.
//! 9. **Windows**: see [`windows`].
//! 10. **Tries**: a frame that is sent again within its cycle has process data of that cycle alone, with the same
//!     outputs; it begins no cycle. See [`tries`].
//!
//! Copies that do not come back are counted but are not findings: cables are cut in tests.

pub mod ethercat;
pub mod flights;
pub mod pcapng;
pub mod tries;
mod verdict;
pub mod windows;

use std::collections::HashMap;
use std::time::Duration;

use ethercat::{Frame, READS};
use flights::Flights;
use pcapng::Capture;

pub use verdict::Verdict;

/// Checks a capture. `cycle` is the time between cycles; with `None` it is taken from the capture.
///
/// # Errors
/// The file is not a pcapng capture of one or two Ethernet interfaces with directions.
pub fn evaluate(bytes: &[u8], cycle: Option<Duration>) -> Result<Verdict, String> {
    evaluate_frames(&Capture::parse(bytes)?, cycle)
}

/// As [`evaluate`], for the contents of a file.
///
/// # Errors
/// The number of interfaces is not one or two.
pub fn evaluate_frames(capture: &Capture, cycle: Option<Duration>) -> Result<Verdict, String> {
    let links = capture.interfaces.len();
    if !(1..=2).contains(&links) {
        return Err(format!("{links} interfaces, expected one or two"));
    }
    let mut packets: Vec<(usize, &pcapng::Packet)> = capture.packets.iter().enumerate().collect();
    // Frames of threads that write into one file may be slightly out of order.
    packets.sort_by_key(|(_, packet)| packet.time_ns);
    let mut verdict = Verdict::default();
    let mut flights = Flights::new(links);
    let mut traffic = Vec::new();
    let mut cycles: Vec<tries::Cycle> = (0..links).map(|_| tries::Cycle::default()).collect();
    // Send time of the copy on the main link, by number.
    let mut first_copies: HashMap<(bool, u16), u64> = HashMap::new();
    for (number, packet) in packets {
        // Frame numbers as in tshark.
        let number = number + 1;
        let link = packet.interface;
        if packet.sent {
            verdict.sent[link] += 1;
        } else {
            verdict.received[link] += 1;
        }
        match Frame::parse(&packet.bytes) {
            Ok(frame) if packet.sent => {
                check_sent(&mut verdict, number, link, &frame);
                flights.sent(&mut verdict, number, packet, &frame);
                let key = (frame.is_acyclic(), frame.number());
                let first =
                    if link == 0 { first_copies.insert(key, packet.time_ns) } else { first_copies.remove(&key) };
                let behind_ns = first.filter(|_| link > 0).map_or(0, |first| packet.time_ns.saturating_sub(first));
                let again = if frame.is_acyclic() { None } else { cycles[link].take(&frame) };
                verdict.again += u64::from(again.is_some() && link == 0);
                if again == Some(false) {
                    verdict.find(number, "is sent again with other outputs");
                }
                traffic.push(windows::Sent {
                    again: again.is_some(),
                    behind_ns,
                    time_ns: packet.time_ns,
                    link,
                    acyclic: frame.is_acyclic(),
                    length: packet.bytes.len(),
                });
            }
            Ok(frame) => flights.received(&mut verdict, number, packet, &frame),
            Err(error) => verdict.find(number, error),
        }
    }
    flights.finish(&mut verdict);
    verdict.windows = windows::measure(&traffic, links, cycle);
    Ok(verdict)
}

/// Checks 2 to 5 and a part of 7; [`Frame::parse`] does check 1.
fn check_sent(verdict: &mut Verdict, number: usize, link: usize, frame: &Frame<'_>) {
    if frame.is_marked_redundant() != (link == 1) {
        verdict.find(number, "the RED bit is not that of its link");
    }
    for (place, datagram) in frame.datagrams.iter().enumerate() {
        if datagram.circulating {
            verdict.find(number, format_args!("datagram {place} is sent with C = 1"));
        }
        if datagram.wkc != 0 || datagram.irq != 0 {
            verdict.find(number, format_args!("datagram {place} is sent with working counter or event request"));
        }
        if datagram.index != frame.datagrams[0].index {
            verdict.find(number, format_args!("datagram {place} has Idx {:#04x}", datagram.index));
        }
        if READS.contains(&datagram.command) {
            verdict.reads += 1;
            if datagram.data.iter().any(|byte| *byte != 0) {
                verdict.find(number, format_args!("datagram {place}, a read, is sent with data"));
            }
        }
    }
}
