//! Delay of the store-and-forward of an INACTIVE MainDevice, against a bare forwarder that waits in the same way.
//!
//! In a namespace of its own there are two veth pairs. A frame is sent at the near end of the first one; a thread
//! forwards it from the far end of the first to the far end of the second; the kernel stamps its arrival at the near
//! end of the second. The delay is the time from the call that sends it to that stamp: two veth pairs, the wake-up of
//! the thread, its work, and the call that sends it on. Both forwarders run in turn, in blocks.

mod bare;

use std::process::{Command, ExitCode};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::standby::StoreAndForward;
use ringcat::{Link, Links, realtime};
use scenarios::figures::{Figures, median, skipped, verdict};
use scenarios::namespaces::Namespaces;

type Tried<T> = Result<T, String>;

/// Most of the delay of a bare forwarder.
const BAR: f64 = 1.3;
/// Lengths of frames, without FCS.
const LENGTHS: [usize; 2] = [60, 1_500];
/// Pairs of blocks, and frames of a block.
const BLOCKS: usize = 7;
const FRAMES: usize = 500;
/// Between two frames.
const PAUSE: Duration = Duration::from_micros(500);
/// A frame that has not arrived by then is lost.
const LOST: Duration = Duration::from_millis(50);
/// Interval at which a forwarder checks whether it is to end.
const LOOK: Duration = Duration::from_millis(5);
/// Most frames of a block that may be lost: those while its forwarder starts.
const MOST_LOST: usize = FRAMES / 10;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => in_a_namespace(),
        ["inside"] => inside(),
        _ => Err("usage: forward".to_owned()),
    };
    match result {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("forward: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs this program in a namespace of its own.
fn in_a_namespace() -> Tried<bool> {
    let namespaces = match Namespaces::new() {
        Ok(namespaces) => namespaces,
        Err(reason) => {
            return Ok(skipped(&format!("network namespaces need root and iproute2: {reason}")));
        }
    };
    let program = std::env::current_exe().map_err(said)?;
    let status = namespaces.near(program).arg("inside").status().map_err(said)?;
    Ok(status.success())
}

/// Measures on interfaces that it makes in this namespace.
fn inside() -> Tried<bool> {
    for pair in ["first", "second"] {
        ip(&format!("link add {pair}0 type veth peer name {pair}1"))?;
        for interface in [format!("{pair}0"), format!("{pair}1")] {
            // With IPv6 addresses the host would send frames of its own.
            let _ = ip(&format!("link set {interface} addrgenmode none"));
            ip(&format!("link set {interface} up"))?;
        }
    }
    let mut met = true;
    for (mode, words) in [(ReceiveMode::Blocking, "blocking"), (ReceiveMode::BusyPoll, "spinning")] {
        met &= compare(mode, words)?;
    }
    Ok(met)
}

fn compare(mode: ReceiveMode, words: &str) -> Tried<bool> {
    let mut figures = Figures::new(&format!("delay of store-and-forward, {words} receive, median of {FRAMES} frames"));
    for length in LENGTHS {
        let (mut ratios, mut ours, mut bare) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..BLOCKS {
            ours.push(block(length, mode, store_and_forward)?);
            bare.push(block(length, mode, bare::forward)?);
            ratios.push(ours[ours.len() - 1] / bare[bare.len() - 1]);
        }
        figures.at_most_in_blocks(&format!("{length} bytes, of a bare forwarder's"), &ratios, BAR, "x");
        figures.show("   INACTIVE MainDevice", format!("{:.1} us", median(&ours)));
        figures.show("   bare forwarder", format!("{:.1} us", median(&bare)));
    }
    Ok(figures.print())
}

/// What forwards from `first1` to `second1` until it is to end.
type Forwarder = fn(ReceiveMode, &AtomicBool) -> Tried<()>;

/// The forwarder of an INACTIVE MainDevice.
fn store_and_forward(mode: ReceiveMode, is_over: &AtomicBool) -> Tried<()> {
    let mut links = PacketLinks::open_forwarding("first1", "second1", mode).map_err(said)?;
    let mut forwarder = StoreAndForward::new(links.addresses()).map_err(said)?;
    while !is_over.load(Ordering::Relaxed) {
        links.wait(links.now() + LOOK);
        forwarder.forward(&mut links);
    }
    Ok(())
}

/// The median delay of frames through a forwarder, in microseconds.
fn block(length: usize, mode: ReceiveMode, forwarder: Forwarder) -> Tried<f64> {
    let is_over = Arc::new(AtomicBool::new(false));
    let thread = std::thread::spawn({
        let is_over = is_over.clone();
        move || {
            realtime::precise_timers();
            forwarder(mode, &is_over)
        }
    });
    let delays = measure(length);
    is_over.store(true, Ordering::Relaxed);
    thread.join().map_err(|_| "a forwarder panics".to_owned())??;
    let delays = delays?;
    if delays.len() + MOST_LOST < FRAMES {
        return Err(format!("only {} of {FRAMES} frames arrive", delays.len()));
    }
    Ok(median(&delays))
}

/// Sends frames, one after the other; the delays of those that arrive.
fn measure(length: usize) -> Tried<Vec<f64>> {
    realtime::precise_timers();
    let mut links = PacketLinks::open("first0", Some("second0"), ReceiveMode::Blocking).map_err(said)?;
    std::thread::sleep(LOOK * 4);
    let mut delays = Vec::with_capacity(FRAMES);
    for number in 0..FRAMES {
        let (frame, sent_at) = (frame(length, number as u8), links.now());
        links.send(Link::Main, &frame);
        let until = sent_at + LOST;
        let mut has_come = false;
        while !has_come && links.now() < until {
            links.wait(until);
            let mut take = |link, bytes: &[u8]| has_come |= link == Link::Redundant && bytes.get(17) == frame.get(17);
            links.receive(&mut take);
        }
        let now = links.now();
        if let Some(at) = links.received_at(sent_at, now).filter(|_| has_come) {
            delays.push((at.0 - sent_at.0) as f64 / 1e3);
        }
        links.sleep(links.now() + PAUSE);
    }
    Ok(delays)
}

/// A frame of an ACTIVE MainDevice after its SubDevices, with one datagram that does nothing.
fn frame(length: usize, index: u8) -> Vec<u8> {
    let mut frame = vec![0; length];
    frame[..6].fill(0xFF);
    frame[6..12].copy_from_slice(&[0x02, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
    let payload = (length - 16) as u16;
    frame[12..14].copy_from_slice(&[0x88, 0xA4]);
    frame[14..16].copy_from_slice(&(payload | 0x1000).to_le_bytes());
    frame[17] = index;
    frame[22..24].copy_from_slice(&(payload - 12).to_le_bytes());
    frame
}

fn ip(arguments: &str) -> Tried<()> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(said)?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}

fn said(error: impl ToString) -> String {
    error.to_string()
}
