//! Another MainDevice on the interface: commands that send refuse to begin beside it.
//!
//! Two MainDevices on one segment disturb each other: a scan brings all SubDevices to INIT, and reading a register such
//! as 0x0110 clears what the other one waits for. A MainDevice on this host is found by its socket, any other one by
//! its frames. Both checks come before anything is sent. They do not find a MainDevice that takes its frames from the
//! interface below the packet sockets (AF_XDP) and sends nothing meanwhile.

use std::fmt;
use std::time::{Duration, Instant};

use ringcat::text::{address, address_of_sender};
use ringcat::wire::frame::{ETHERNET_HEADER_LEN, MacAddress};
use ringcat_link::interface::{UseWarning, exclusive_use};
use ringcat_link::pcapng::Direction;
use ringcat_link::{PacketSocket, ReceiveMode, Sniffer, monotonic};

use crate::failure::Failure;
use crate::output::warn;

/// How long frames are listened for: longer than the cycle of all but the slowest MainDevices.
const LISTEN: Duration = Duration::from_millis(250);
/// What comes before may still be the frames of a MainDevice that has just ended.
const LAST_FRAMES: Duration = Duration::from_millis(25);
/// EtherType, and a VLAN tag before it.
const ETHERCAT: [u8; 2] = [0x88, 0xA4];
const VLAN: [u8; 2] = [0x81, 0x00];
const TAG: usize = 4;
/// Type of the EtherCAT header that commands for SubDevices have; others are network variables and mailboxes.
const COMMANDS: u8 = 1;

/// What to do about it.
const ADVICE: &str = "nothing was sent: stop the other one first. --force goes on all the same, and its SubDevices\n\
                      leave OP. `ringcat capture` only listens";

/// Warns of other uses of the interfaces, and refuses where another process has a socket for EtherCAT on one.
pub fn check_sockets<'a>(names: impl Iterator<Item = &'a str>, force: bool) -> Result<(), Failure> {
    let mut found = Vec::new();
    for warning in names.flat_map(exclusive_use) {
        let is_socket = matches!(warning, UseWarning::Socket { .. });
        if !is_socket || force {
            warn(warning);
        } else if let UseWarning::Socket { interface, owner } = warning {
            let owner = owner.map_or_else(
                || "another program (sudo ss -0p shows which)".to_owned(),
                |(process, name)| format!("process {process} ({name})"),
            );
            found.push(format!("{owner} uses EtherCAT on {interface} already"));
        }
    }
    refuse(&found)
}

/// Listens, and refuses where frames of another MainDevice pass. Called once the interfaces have their carriers.
pub fn check_frames<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), Failure> {
    let mut sniffers = Vec::new();
    for name in names {
        sniffers.push((name, Sniffer::open(name, false)?, None));
    }
    let begin = Instant::now();
    while begin.elapsed() < LISTEN && sniffers.iter().any(|(.., heard)| heard.is_none()) {
        let sockets: Vec<&PacketSocket> = sniffers.iter().map(|(_, sniffer, _)| sniffer.socket()).collect();
        let rest = LISTEN.saturating_sub(begin.elapsed()).as_nanos() as u64;
        ringcat_link::wait(&sockets, monotonic::now_ns() + rest, ReceiveMode::Blocking);
        for (_, sniffer, heard) in &mut sniffers {
            while sniffer.next(&mut |passed| {
                if begin.elapsed() >= LAST_FRAMES && has_commands(passed.frame) {
                    *heard = address_of_sender(passed.frame).map(|source| (source, passed.direction));
                }
            }) && heard.is_none()
            {}
        }
    }
    let found = sniffers.iter().filter_map(|(name, _, heard)| Some(Heard { name, heard: (*heard)? }.to_string()));
    refuse(&found.collect::<Vec<_>>())
}

/// A frame that passed an interface.
struct Heard<'a> {
    name: &'a str,
    heard: (MacAddress, Direction),
}

impl fmt::Display for Heard<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (source, direction) = self.heard;
        let way = match direction {
            Direction::In => "arrive on",
            Direction::Out => "leave through",
        };
        write!(f, "another MainDevice controls this segment: its frames, from {}, {way} {}", address(source), self.name)
    }
}

fn refuse(found: &[String]) -> Result<(), Failure> {
    if found.is_empty() { Ok(()) } else { Err(Failure::new(format!("{}\n{ADVICE}", found.join("\n")))) }
}

/// Whether a frame holds datagrams for SubDevices.
fn has_commands(frame: &[u8]) -> bool {
    let tag = if frame.get(12..14) == Some(&VLAN) { TAG } else { 0 };
    let header_at = ETHERNET_HEADER_LEN + tag;
    frame.get(header_at - 2..header_at) == Some(&ETHERCAT)
        && frame.get(header_at + 1).is_some_and(|high| high >> 4 == COMMANDS)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn each_finding_is_reported_with_what_to_do() {
        assert!(refuse(&[]).is_ok());
        let text = refuse(&["a".to_owned(), "b".to_owned()]).expect_err("refused").to_string();
        assert!(text.starts_with("a\nb\nnothing was sent") && text.contains("--force"), "{text}");
        let source = MacAddress([2, 0, 0, 0, 0, 7]);
        let heard = Heard { name: "eth1", heard: (source, Direction::Out) }.to_string();
        assert!(heard.ends_with("its frames, from 02:00:00:00:00:07, leave through eth1"), "{heard}");
    }
}
