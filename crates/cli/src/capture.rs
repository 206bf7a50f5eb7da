//! `ringcat capture`: what passes on network interfaces, recorded without taking part.
//!
//! Input: the interfaces of any MainDevice on this host. Output: one pcapng file with both directions of all of them.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use ringcat_link::{PacketSocket, ReceiveMode, Recorder, Sniffer, Tap, interface, monotonic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{LinkNames, describe_down};
use crate::json::capture::{Capture, Interface};
use crate::json::data::Data;
use crate::output::{draw, is_terminal, say, warn};
use crate::recording::{DESCRIPTIONS, lines};
use crate::times::time;
use crate::verdict::{Report, Verdict};

/// Period of checks for the end, and of the live line.
const LOOK: Duration = Duration::from_millis(200);

/// What to do with the file.
const ABOUT_CAPTURE: &str = "\
Records both directions of the interfaces and never sends; a MainDevice on them,
of whatever make, does not notice. Open the file with Wireshark, or:
tshark -r FILE.pcapng

Where the MainDevice is `ringcat scan` or `ringcat run`, their option --capture
does the same without a second program.";

/// Options of `ringcat capture`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_CAPTURE)]
pub struct CaptureArguments {
    #[command(flatten)]
    links: LinkNames,
    /// File to write, for Wireshark
    ///
    /// An existing file is overwritten.
    #[arg(long, value_name = "FILE.pcapng", help_heading = "Output")]
    out: PathBuf,
    /// How long, such as 10s or 5min; until Ctrl-C by default
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Output")]
    lasts: Option<Duration>,
    /// Record frames of all protocols, not only EtherCAT
    ///
    /// Without it only frames with EtherType 0x88A4 are recorded, with or without a VLAN tag.
    #[arg(long, help_heading = "Output")]
    all: bool,
}

/// Records, and says how many frames there were.
pub fn run(arguments: &CaptureArguments) -> Result<Report, Failure> {
    let end = EndRequest::watch(None)?;
    arguments.links.check()?;
    let names: Vec<&str> = arguments.links.all().collect();
    let mut sniffers = Vec::new();
    for name in &names {
        sniffers.push(Sniffer::open(name, arguments.all)?);
        if !interface::carrier(name).unwrap_or(true) {
            warn(describe_down(name));
        }
    }
    let described: Vec<(&str, &str)> = names.iter().copied().zip(DESCRIPTIONS).collect();
    let recorder = Recorder::start(&arguments.out, &described)?;
    let mut tap = recorder.tap();
    let what = if arguments.all { "all frames" } else { "EtherCAT frames" };
    say!("recording {what} of {} into {}; Ctrl-C ends it", names.join(" and "), arguments.out.display());
    let lasts = arguments.lasts.map(|lasts| u64::try_from(lasts.as_nanos()).unwrap_or(u64::MAX));
    let until = lasts.map_or(u64::MAX, |lasts| monotonic::now_ns().saturating_add(lasts));
    let terminal = is_terminal();
    let (mut frames, mut shown) = (0, 0);
    while !end.is_asked() && monotonic::now_ns() < until && recorder.failure().is_none() {
        let sockets: Vec<&PacketSocket> = sniffers.iter().map(Sniffer::socket).collect();
        let look = monotonic::now_ns() + LOOK.as_nanos() as u64;
        ringcat_link::wait(&sockets, look.min(until), ReceiveMode::Blocking);
        frames += drain(&mut sniffers, &mut tap);
        let now = monotonic::now_ns();
        if terminal && now >= shown {
            shown = now + LOOK.as_nanos() as u64;
            draw(format_args!("\r{frames:>9} frames "));
        }
    }
    if terminal {
        say!();
    }
    frames += drain(&mut sniffers, &mut tap);
    for (number, sniffer) in sniffers.iter().enumerate() {
        recorder.set_lost_by_kernel(number, sniffer.lost());
    }
    let recorded = recorder.finish()?;
    for line in lines(names.iter().copied(), &recorded) {
        say!("{line}");
    }
    let interfaces = names.iter().zip(&recorded).map(|(name, recorded)| Interface {
        interface: (*name).to_owned(),
        received_frames: recorded.received,
        sent_frames: recorded.sent,
        unrecorded_frames: recorded.lost + recorded.lost_by_kernel,
    });
    let file = arguments.out.display().to_string();
    let data = Data::Capture(Capture { file, frames, interfaces: interfaces.collect() });
    let lacking: u64 = recorded.iter().map(|frames| frames.lost + frames.lost_by_kernel).sum();
    let lacking = (lacking > 0).then(|| format!("the capture lacks {lacking} frames"));
    let verdict = Verdict::Held(format!("{frames} frames")).and(lacking).and(end.cut_short(arguments.lasts));
    Ok(Report { verdict, data })
}

/// Records what has passed so far; how many frames that is. Bounded, however fast they come.
fn drain(sniffers: &mut [Sniffer], tap: &mut Tap) -> u64 {
    const AT_ONCE: u64 = 10_000;
    let mut frames = 0;
    for (number, sniffer) in sniffers.iter_mut().enumerate() {
        let before = frames;
        while frames - before < AT_ONCE
            && sniffer.next(&mut |passed| {
                tap.record_beginning(number, passed.direction, passed.unix_time_ns, passed.frame, passed.length);
            })
        {
            frames += 1;
        }
    }
    frames
}
