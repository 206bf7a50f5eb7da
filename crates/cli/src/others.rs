//! Another MainDevice on the interface: commands that send refuse to begin beside it.
//!
//! Two MainDevices on one segment disturb each other: a scan brings all SubDevices to INIT, and reading a register such
//! as 0x0110 clears what the other one waits for. A MainDevice on this host is found by its socket, any other one by
//! its frames. Both checks come before anything is sent. They do not find a MainDevice that takes its frames from the
//! interface below the packet sockets (AF_XDP) and sends nothing meanwhile.

use std::fmt;
use std::time::Instant;

use ringcat::foreign::{LAST_FRAMES, LISTEN, has_commands};
use ringcat::text::{address, address_of_sender};
use ringcat::wire::frame::MacAddress;
use ringcat_link::interface::{UseWarning, exclusive_use};
use ringcat_link::pcapng::Direction;
use ringcat_link::{PacketSocket, ReceiveMode, Sniffer, monotonic};

use crate::failure::Failure;
use crate::output::warn;

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
    while begin.elapsed() < LISTEN && sniffers.iter().any(|(.., frame)| frame.is_none()) {
        let sockets: Vec<&PacketSocket> = sniffers.iter().map(|(_, sniffer, _)| sniffer.socket()).collect();
        let rest = LISTEN.saturating_sub(begin.elapsed()).as_nanos() as u64;
        ringcat_link::wait(&sockets, monotonic::now_ns() + rest, ReceiveMode::Blocking);
        for (_, sniffer, frame) in &mut sniffers {
            while sniffer.next(&mut |passed| {
                if begin.elapsed() >= LAST_FRAMES && has_commands(passed.frame) {
                    *frame = address_of_sender(passed.frame).map(|source| (source, passed.direction));
                }
            }) && frame.is_none()
            {}
        }
    }
    let found =
        sniffers.iter().filter_map(|(name, _, frame)| Some(ForeignFrame { name, frame: (*frame)? }.to_string()));
    refuse(&found.collect::<Vec<_>>())
}

/// A frame that passed an interface.
struct ForeignFrame<'a> {
    name: &'a str,
    frame: (MacAddress, Direction),
}

impl fmt::Display for ForeignFrame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (source, direction) = self.frame;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_finding_is_reported_with_what_to_do() {
        assert!(refuse(&[]).is_ok());
        let text = refuse(&["a".to_owned(), "b".to_owned()]).expect_err("refused").to_string();
        assert!(text.starts_with("a\nb\nnothing was sent") && text.contains("--force"), "{text}");
        let source = MacAddress([2, 0, 0, 0, 0, 7]);
        let text = ForeignFrame { name: "eth1", frame: (source, Direction::Out) }.to_string();
        assert!(text.ends_with("its frames, from 02:00:00:00:00:07, leave through eth1"), "{text}");
    }
}
