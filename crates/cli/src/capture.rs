//! `ringcat capture`: what passes on network interfaces, recorded without taking part.
//!
//! In go the interfaces of any MainDevice on this host, out comes one pcapng file with both directions of all of them.

use std::io::{IsTerminal, stdout};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use ringcat_link::{PacketSocket, ReceiveMode, Recorder, Sniffer, Tap, interface, monotonic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{describe_down, two_interfaces};
use crate::output::{say, write};
use crate::recording::{DESCRIPTIONS, lines};
use crate::times::time;
use crate::verdict::Verdict;

/// The user's wish to end, and the live line, are looked at so often.
const LOOK: Duration = Duration::from_millis(200);

/// What to do with the file.
const ABOUT_CAPTURE: &str = "\
Sees both directions of the interfaces and never sends; a MainDevice on them, of whatever make, does not notice. Open
the file with Wireshark, or: tshark -r FILE.pcapng

Where the MainDevice is `ringcat scan` or `ringcat run`, --capture of these does the same without a second program.";

/// Options of `ringcat capture`.
#[derive(Args, Debug)]
#[command(after_help = ABOUT_CAPTURE)]
pub struct CaptureArguments {
    /// Network interface that the first SubDevice is plugged into.
    #[arg(long, value_name = "IF")]
    main: String,
    /// Network interface at the other end of a ring.
    #[arg(long, value_name = "IF")]
    redundant: Option<String>,
    /// File to write, for Wireshark. An older one is overwritten.
    #[arg(long, value_name = "FILE.pcapng")]
    out: PathBuf,
    /// How long, such as 10s or 5min; until Ctrl-C by default.
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    lasts: Option<Duration>,
    /// Record frames of all protocols, not only EtherCAT (EtherType 0x88A4, with or without a VLAN tag).
    #[arg(long)]
    all: bool,
}

/// Records, and says how many frames there were.
pub fn run(arguments: &CaptureArguments) -> Result<Verdict, Failure> {
    let end = EndRequest::watch(None)?;
    let (main, redundant) = (arguments.main.as_str(), arguments.redundant.as_deref());
    two_interfaces(main, redundant)?;
    let names: Vec<&str> = std::iter::once(main).chain(redundant).collect();
    let mut sniffers = Vec::new();
    for name in &names {
        sniffers.push(Sniffer::open(name, arguments.all)?);
        if !interface::carrier(name).unwrap_or(true) {
            eprintln!("ringcat: {}", describe_down(name));
        }
    }
    let described: Vec<(&str, &str)> = names.iter().copied().zip(DESCRIPTIONS).collect();
    let recorder = Recorder::start(&arguments.out, &described)?;
    let mut tap = recorder.tap();
    let what = if arguments.all { "all frames" } else { "EtherCAT frames" };
    say!("recording {what} of {} into {}; Ctrl-C ends it", names.join(" and "), arguments.out.display());
    let lasts = arguments.lasts.map(|lasts| u64::try_from(lasts.as_nanos()).unwrap_or(u64::MAX));
    let until = lasts.map_or(u64::MAX, |lasts| monotonic::now_ns().saturating_add(lasts));
    let terminal = stdout().is_terminal();
    let (mut frames, mut shown) = (0, 0);
    while !end.is_asked() && monotonic::now_ns() < until && recorder.failure().is_none() {
        let sockets: Vec<&PacketSocket> = sniffers.iter().map(Sniffer::socket).collect();
        let look = monotonic::now_ns() + LOOK.as_nanos() as u64;
        ringcat_link::wait(&sockets, look.min(until), ReceiveMode::Blocking);
        frames += drain(&mut sniffers, &mut tap);
        let now = monotonic::now_ns();
        if terminal && now >= shown {
            shown = now + LOOK.as_nanos() as u64;
            write(format_args!("\r{frames:>9} frames "));
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
    for line in lines(names.into_iter(), &recorded) {
        say!("{line}");
    }
    let lacking: u64 = recorded.iter().map(|frames| frames.lost + frames.lost_by_kernel).sum();
    let lacking = (lacking > 0).then(|| format!("the capture lacks {lacking} frames"));
    Ok(Verdict::Held(format!("{frames} frames")).and(lacking).and(end.cut_short(arguments.lasts)))
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
