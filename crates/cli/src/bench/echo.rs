//! The other end of a round trip: frames go back as one SubDevice with outputs and inputs would send them.
//!
//! Every datagram's working counter grows by what its command makes one such SubDevice add (protocol 1.4), and the
//! source address gets the bit that controllers set (protocol 2.6). The data stays as it came.

use clap::Args;
use ringcat::wire::command::Command;
use ringcat::wire::datagram::{HEADER_LEN, Header, WKC_LEN};
use ringcat::wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MAX_FRAME_VLAN};
use ringcat::wire::source_address::PROCESSED;
use ringcat_link::{PacketOptions, PacketSocket, monotonic, wait};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::bench::Echo;
use crate::json::data::Data;
use crate::others::check_sockets;
use crate::output::say;
use crate::thread::ThreadArguments;
use crate::verdict::{Report, Verdict};

/// Offset of the source address.
const SOURCE: usize = 6;
/// Period of checks for the end.
const LOOK_NS: u64 = 20_000_000;

/// Options of `ringcat bench echo`.
#[derive(Args, Debug)]
pub struct EchoArguments {
    /// Network interface that the frames arrive on
    #[arg(long, value_name = "IF", help_heading = "Links")]
    main: String,
    /// Go on although another program sends or answers EtherCAT frames there
    #[arg(long, help_heading = "Links")]
    force: bool,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// Answers until a signal ends it.
pub fn run(arguments: &EchoArguments) -> Result<Report, Failure> {
    let end = EndRequest::watch(arguments.thread.priority)?;
    let options = PacketOptions::default().with_receive(arguments.thread.mode());
    let socket = PacketSocket::open(&arguments.main, &options)?;
    check_sockets(std::iter::once(arguments.main.as_str()), arguments.force)?;
    let _awake = arguments.thread.apply();
    say!("echo on {}", arguments.main);
    let answered = answer_all(socket, &end);
    let verdict = Verdict::Held(format!("{answered} frames answered"));
    Ok(Report { verdict, data: Data::Echo(Echo { frames_answered: answered }) })
}

/// Answers until a request to end; the number of frames.
fn answer_all(mut socket: PacketSocket, end: &EndRequest) -> u64 {
    let mode = socket.mode();
    let mut answered = 0;
    let mut answer = [0; MAX_FRAME_VLAN];
    while !end.is_asked() {
        if !wait(&[&socket], monotonic::now_ns() + LOOK_NS, mode) {
            continue;
        }
        let mut length = 0;
        socket.receive(&mut |frame| {
            length = frame.len().min(answer.len());
            answer[..length].copy_from_slice(&frame[..length]);
        });
        process(&mut answer[..length]);
        if length > 0 {
            // A frame that finds the interface down is lost, as on a cable.
            answered += u64::from(socket.send(&answer[..length]));
        }
    }
    answered
}

/// What one SubDevice does to a frame. Any bytes are allowed.
fn process(frame: &mut [u8]) {
    if let Some(byte) = frame.get_mut(SOURCE) {
        *byte |= PROCESSED;
    }
    let mut at = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
    while let Some(bytes) = frame.get(at..).and_then(<[u8]>::first_chunk::<HEADER_LEN>) {
        let header = Header::decode(bytes);
        let wkc_at = at + HEADER_LEN + usize::from(header.length);
        let Some(wkc) = frame.get_mut(wkc_at..).and_then(<[u8]>::first_chunk_mut::<WKC_LEN>) else { return };
        *wkc = u16::from_le_bytes(*wkc).wrapping_add(added(header.command)).to_le_bytes();
        if !header.more {
            return;
        }
        at = wkc_at + WKC_LEN;
    }
}

/// What a SubDevice with outputs and inputs adds.
fn added(command: Command) -> u16 {
    u16::from(command.reads()) + if command.reads() && command.writes() { 2 } else { u16::from(command.writes()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat::wire::address::LogicalAddress;
    use ringcat::wire::datagram::Target;
    use ringcat::wire::frame::{Frame, FrameBuilder, MacAddress};
    use ringcat::wire::register::map;

    // covers: bench
    #[test]
    fn working_counters_grow_and_the_source_address_is_marked() {
        let mut frame = vec![0; 1514];
        let source = MacAddress([0, 1, 2, 3, 4, 5]);
        let mut builder = FrameBuilder::ethernet(&mut frame, MacAddress::BROADCAST, source).expect("room");
        let logical = Target::Logical(LogicalAddress(0));
        for (command, target) in [
            (Command::Lrw, logical),
            (Command::Lwr, logical),
            (Command::Lrd, logical),
            (Command::Brd, Target::Broadcast(map::AL_STATUS)),
            (Command::Nop, Target::None),
        ] {
            builder.datagram(command, 0, target, 4).expect("room");
        }
        let length = builder.finish();
        process(&mut frame[..length]);
        assert_eq!(frame[SOURCE], PROCESSED);
        let answer = Frame::parse(&frame[..length]).expect("still a frame");
        let wkcs: Vec<u16> = answer.datagrams().map(|datagram| datagram.wkc.0).collect();
        assert_eq!(wkcs, [3, 1, 1, 1, 0]);
    }

    #[test]
    fn any_bytes_may_come() {
        for length in 0..80 {
            for byte in [0x00, 0x88, 0xff] {
                process(&mut vec![byte; length]);
            }
        }
    }
}
