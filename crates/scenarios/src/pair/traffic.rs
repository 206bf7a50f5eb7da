//! Frames on the interfaces of both MainDevices: an INACTIVE sends none of its own, two MainDevices send at the same
//! time for two cycles at most, a frame passes each interface of an INACTIVE once, and every frame ends.

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat_sim::cable::{Host, HostLink};
use ringcat_sim::network::host_log::HostFrame;
use ringcat_sim::time::SimTime;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT};

use ringcat::Instant;

use super::board::{Phase, Seen};

/// Last bytes of the addresses of both hosts that their frames carry.
const IDENTITIES: [[u8; 3]; 2] = [[0x00, 0x53, 0x01], [0x00, 0x53, 0x11]];
/// Cycles after which a frame is no more on its way: two passes of an INACTIVE that may each wait for two cycles.
const LIFETIME: u32 = 5;
/// Most cycles in which both MainDevices may send frames of their own.
const MOST_TOGETHER: u32 = 2;
/// Copies are remembered for this many lifetimes.
const REMEMBERED: u32 = 10;

/// Marks of a copy: identity of its MainDevice, byte 0 without what changes on the way, byte 1, and Idx.
type Copy = ([u8; 3], u8, u8, u8);

/// A copy on its way.
#[derive(Debug)]
struct Journey {
    begun: SimTime,
    /// Passes of each interface of an INACTIVE.
    passes: [u8; 4],
}

/// Checks the frames on the interfaces.
#[derive(Debug)]
pub(super) struct Traffic {
    cycle: Duration,
    lifetime: Duration,
    copies: BTreeMap<Copy, Journey>,
    /// When each host sent a frame of its own last.
    sent: [Option<SimTime>; 2],
    /// Since when both send.
    together_since: Option<SimTime>,
    passes: u64,
}

impl Traffic {
    pub(super) fn new(cycle: Duration) -> Traffic {
        let (lifetime, copies) = (cycle * LIFETIME, BTreeMap::new());
        Traffic { cycle, lifetime, copies, sent: [None; 2], together_since: None, passes: 0 }
    }

    pub(super) fn passes(&self) -> u64 {
        self.passes
    }

    /// Checks what has passed the interfaces.
    pub(super) fn check(&mut self, frames: Vec<HostFrame>, seen: &[Seen; 2]) {
        let Some(last) = frames.last().map(|frame| frame.at) else { return };
        for frame in frames {
            self.check_frame(&frame, seen);
        }
        let limit = self.lifetime * REMEMBERED;
        self.copies.retain(|_, journey| last - journey.begun < limit);
    }

    fn check_frame(&mut self, frame: &HostFrame, seen: &[Seen; 2]) {
        let marks = frame.head[6];
        let identity = [frame.head[9], frame.head[10], frame.head[11]];
        let copy = (identity, marks & 0x78, frame.head[7], frame.head[17]);
        let host = frame.link.host();
        let begins = frame.is_sent && identity == IDENTITIES[host as usize];
        if begins {
            let phase = seen[host as usize].phase_at(Instant(frame.at.0));
            assert_ne!(phase, Phase::Inactive, "an INACTIVE MainDevice sends a frame of its own: {frame:02x?}");
            assert_eq!(marks & (FORWARDED_ON_MAIN | FORWARDED_ON_REDUNDANT), 0, "{frame:02x?}");
            self.copies.insert(copy, Journey { begun: frame.at, passes: [0; 4] });
            self.check_roles(host, frame.at);
            return;
        }
        let Some(journey) = self.copies.get_mut(&copy) else {
            panic!("nothing has sent this frame, or long ago: {frame:02x?}");
        };
        let age = frame.at - journey.begun;
        assert!(age <= self.lifetime, "a frame is on its way for {age:?}: {frame:02x?}");
        if frame.is_sent {
            let mark = if is_main(frame.link) { FORWARDED_ON_MAIN } else { FORWARDED_ON_REDUNDANT };
            assert_ne!(marks & mark, 0, "forwarded without its mark: {frame:02x?}");
            let passes = &mut journey.passes[frame.link as usize];
            *passes += 1;
            assert_eq!(*passes, 1, "a frame passes {} again: {frame:02x?}", frame.link);
            self.passes += 1;
        }
    }
}

impl Traffic {
    /// A host sends a frame of its own.
    fn check_roles(&mut self, host: Host, at: SimTime) {
        self.sent[host as usize] = Some(at);
        // An ACTIVE sends in each cycle.
        let other_sends = self.sent[host.other() as usize].is_some_and(|last| at - last <= self.cycle);
        if !other_sends {
            self.together_since = None;
            return;
        }
        let since = *self.together_since.get_or_insert(at);
        let most = self.cycle * MOST_TOGETHER;
        assert!(at - since <= most, "both MainDevices are ACTIVE since {since}, at {at}");
    }
}

fn is_main(link: HostLink) -> bool {
    link == Host::First.main() || link == Host::Second.main()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Duration = Duration::from_millis(1);
    const PHASES: [Phase; 2] = [Phase::Active, Phase::Inactive];

    fn seen(phases: [Phase; 2]) -> [Seen; 2] {
        phases.map(|phase| Seen { phase, ..Seen::default() })
    }

    /// A frame of the first host with these marks.
    fn frame(us: u64, link: HostLink, is_sent: bool, marks: u8) -> HostFrame {
        let mut head = [0; 26];
        (head[6], head[7]) = (marks, 7);
        head[9..12].copy_from_slice(&IDENTITIES[0]);
        HostFrame { at: SimTime::from_micros(us), link, is_sent, head }
    }

    fn check(frames: Vec<HostFrame>) -> u64 {
        let mut traffic = Traffic::new(CYCLE);
        traffic.check(frames, &seen(PHASES));
        traffic.passes()
    }

    /// A copy on its way through the INACTIVE.
    fn way() -> Vec<HostFrame> {
        vec![
            frame(0, HostLink::Main, true, 0),
            frame(20, HostLink::SecondRedundant, false, 0x02),
            frame(26, HostLink::SecondMain, true, 0x06),
            frame(40, HostLink::Redundant, false, 0x06),
        ]
    }

    #[test]
    fn a_copy_that_is_forwarded_once_passes() {
        assert_eq!(check(way()), 1);
    }

    #[test]
    #[should_panic(expected = "passes second main again")]
    fn a_copy_that_passes_an_interface_twice_is_found() {
        check([way(), vec![frame(60, HostLink::SecondMain, true, 0x06)]].concat());
    }

    #[test]
    #[should_panic(expected = "forwarded without its mark")]
    fn a_copy_without_a_mark_is_found() {
        check(vec![frame(0, HostLink::Main, true, 0), frame(26, HostLink::SecondMain, true, 0x02)]);
    }

    #[test]
    #[should_panic(expected = "is on its way for")]
    fn a_copy_that_does_not_end_is_found() {
        check([way(), vec![frame(6_000, HostLink::Main, false, 0x06)]].concat());
    }

    /// Both hosts send in each of this number of cycles.
    fn both_send(cycles: u64) {
        let mut traffic = Traffic::new(CYCLE);
        for cycle in 0..cycles {
            let mut other = frame(cycle * 1_000 + 400, HostLink::SecondMain, true, 0);
            other.head[9..12].copy_from_slice(&IDENTITIES[1]);
            traffic.check(vec![frame(cycle * 1_000, HostLink::Main, true, 0), other], &seen([Phase::Active; 2]));
        }
    }

    #[test]
    fn two_that_send_in_two_cycles_pass() {
        both_send(3);
    }

    #[test]
    #[should_panic(expected = "both MainDevices are ACTIVE")]
    fn two_that_send_for_longer_are_found() {
        both_send(4);
    }

    #[test]
    #[should_panic(expected = "sends a frame of its own")]
    fn an_inactive_that_sends_is_found() {
        let mut own = frame(0, HostLink::SecondMain, true, 0);
        own.head[9..12].copy_from_slice(&IDENTITIES[1]);
        check(vec![own]);
    }
}
