//! Another MainDevice on the links: heard before anything is sent.
//!
//! Two MainDevices on one segment disturb each other: a scan brings all SubDevices to INIT, and reading a register such
//! as 0x0110 clears what the other one waits for.

use std::fmt;
use std::time::{Duration, Instant};

use ringcat_engine::link::Link;
use ringcat_wire::frame::{ETHERNET_HEADER_LEN, MacAddress};

use crate::links::Links;
use crate::text::{address, address_of_sender};

/// How long frames are to be listened for: longer than the cycle of all but the slowest MainDevices.
pub const LISTEN: Duration = Duration::from_millis(250);
/// What comes before may still be the frames of a MainDevice that has just ended.
pub const LAST_FRAMES: Duration = Duration::from_millis(25);
/// Interval of looks.
const LOOK: Duration = Duration::from_millis(1);
/// EtherType, and a VLAN tag before it.
const ETHERCAT: [u8; 2] = [0x88, 0xA4];
const VLAN: [u8; 2] = [0x81, 0x00];
const TAG: usize = 4;
/// Type of the EtherCAT header that commands for SubDevices have; others are network variables and mailboxes
/// (ETG.1000.4, EtherCAT header).
const COMMANDS: u8 = 1;

/// A frame of another MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Heard {
    /// The link that it arrived on.
    pub arrived_on: Link,
    /// Its source address.
    pub source: MacAddress,
}

impl fmt::Display for Heard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Heard { arrived_on, source } = self;
        let source = address(*source);
        write!(f, "another MainDevice controls this segment: its frames, from {source}, arrive on {arrived_on}")
    }
}

/// Listens on the links of both halves for [`LISTEN`]; ends at the first frame of another MainDevice. Nothing may have
/// been sent on them.
pub fn listen<L: Links>(cyclic: &mut L, acyclic: &mut L) -> Option<Heard> {
    let begin = Instant::now();
    let mut heard = None;
    while begin.elapsed() < LISTEN {
        let is_late = begin.elapsed() >= LAST_FRAMES;
        for links in [&mut *cyclic, &mut *acyclic] {
            let mut take = |arrived_on, frame: &[u8]| {
                if is_late && has_commands(frame) {
                    heard = heard.or(address_of_sender(frame).map(|source| Heard { arrived_on, source }));
                }
            };
            while links.receive(&mut take) {}
        }
        if heard.is_some() {
            return heard;
        }
        std::thread::sleep(LOOK);
    }
    None
}

/// Whether a frame holds datagrams for SubDevices.
pub fn has_commands(frame: &[u8]) -> bool {
    let tag = if frame.get(12..14) == Some(&VLAN) { TAG } else { 0 };
    let header_at = ETHERNET_HEADER_LEN + tag;
    frame.get(header_at - 2..header_at) == Some(&ETHERCAT)
        && frame.get(header_at + 1).is_some_and(|high| high >> 4 == COMMANDS)
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::links::PerLink;

    fn frame(ether_type: &[u8], high: u8) -> Vec<u8> {
        let mut frame = vec![0xff; 12];
        frame.extend(ether_type);
        frame.extend([0x0e, high]);
        frame.resize(60, 0);
        frame
    }

    // covers: other-main-device
    #[test]
    fn only_frames_with_commands_show_a_main_device() {
        assert!(has_commands(&frame(&ETHERCAT, 0x10)));
        assert!(has_commands(&frame(&[0x81, 0x00, 0x00, 0x05, 0x88, 0xa4], 0x10)));
        assert!(!has_commands(&frame(&ETHERCAT, 0x40)), "network variables");
        assert!(!has_commands(&frame(&[0x08, 0x00], 0x10)), "IP");
        (0..16).for_each(|length| assert!(!has_commands(&frame(&ETHERCAT, 0x10)[..length.min(15)])));
    }

    /// Links on which these frames arrive, each at its time.
    struct Arriving(Instant, VecDeque<(Duration, Vec<u8>)>);

    impl Links for Arriving {
        fn now(&self) -> ringcat_engine::time::Instant {
            ringcat_engine::time::Instant::default()
        }

        fn addresses(&self) -> PerLink<MacAddress> {
            PerLink::new(MacAddress([2; 6]), None)
        }

        fn send(&mut self, _: Link, _: &[u8]) {
            panic!("it only listens");
        }

        fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
            let is_there = self.1.front().is_some_and(|(at, _)| self.0.elapsed() >= *at);
            let Some((_, frame)) = is_there.then(|| self.1.pop_front()).flatten() else { return false };
            take(Link::Main, &frame);
            true
        }

        fn wait(&mut self, _: ringcat_engine::time::Instant) {}
    }

    // covers: other-main-device
    #[test]
    fn the_first_frame_with_commands_is_heard_unless_its_sender_has_just_ended() {
        let arriving = |frames: Vec<(u64, Vec<u8>)>| {
            let frames = frames.into_iter().map(|(ms, frame)| (Duration::from_millis(ms), frame)).collect();
            Arriving(Instant::now(), frames)
        };
        let heard = |frames| listen(&mut arriving(Vec::new()), &mut arriving(frames));
        assert_eq!(heard(Vec::new()), None);
        let with_commands = || frame(&ETHERCAT, 0x10);
        assert_eq!(heard(vec![(0, with_commands()), (60, frame(&ETHERCAT, 0x40))]), None);
        let source = MacAddress([0xff; 6]);
        assert_eq!(heard(vec![(60, with_commands())]), Some(Heard { arrived_on: Link::Main, source }));
    }
}
