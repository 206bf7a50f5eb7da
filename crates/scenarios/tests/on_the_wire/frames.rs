//! Every frame is accounted for: a ring of 16 at 1 kHz for 30 s, or 10 minutes with RINGCAT_LONG=1. All frames that
//! RingCAT sent arrived in the segment, all frames from the segment were received by RingCAT, and the missing ones are
//! those that the simulator dropped on command. Frames may be late when this machine stalls, or find a full receive
//! ring; both are counted separately from lost frames.

use std::time::Duration;

use crate::bench::{Bench, await_op};
use crate::{RING_OF_16, show_summary};

/// Frames that the simulator drops, in each direction of the redundant cable.
const DROPPED: u64 = 5;

/// The number before a text.
fn figure(text: &str, words: &str) -> u64 {
    let at = text.find(words).unwrap_or_else(|| panic!("{words} in: {text}"));
    let number = text[..at].trim_end().rsplit([' ', ',']).next().and_then(|number| number.parse().ok());
    number.unwrap_or_else(|| panic!("no number before {words} in: {text}"))
}

/// The line that begins with this text.
fn line<'t>(text: &'t str, begin: &str) -> &'t str {
    let found = text.lines().find(|line| line.trim_start().starts_with(begin));
    found.unwrap_or_else(|| panic!("no line begins with {begin}: {text}"))
}

/// Counters of the interfaces of one link, at both ends.
#[derive(Debug)]
struct Link {
    /// Process data that RingCAT sent and received.
    sent: u64,
    received: u64,
    overrun: u64,
    /// All frames that the simulator received, lost because of a full receive ring, and sent.
    arrived: u64,
    arrived_overrun: u64,
    answered: u64,
    unanswered: u64,
    /// All frames that went into the segment and came out of it.
    inside: u64,
    outside: u64,
}

impl Link {
    fn read(ours: &str, status: &str, our_name: &str, name: &str) -> Link {
        let ours = line(ours, &format!("process data on {our_name}:"));
        let interface = line(status, &format!("{name} interface:"));
        let segment = line(status, &format!("{name}:"));
        Link {
            sent: figure(ours, " sent"),
            received: figure(ours, " received"),
            overrun: figure(ours, " overrun"),
            arrived: figure(interface, " frames received"),
            arrived_overrun: figure(interface, " lost in a full ring"),
            answered: figure(interface, " sent"),
            unanswered: figure(interface, " not sent"),
            inside: figure(segment, " frames into"),
            outside: figure(segment, " out of it"),
        }
    }
}

// covers: no-frame-lost
#[test]
fn a_ring_of_16_at_1_khz_loses_no_frame_that_the_simulator_did_not_drop() {
    let Some(mut bench) = Bench::new(2) else { return };
    let long = std::env::var("RINGCAT_LONG").is_ok_and(|value| value == "1");
    let (text, limit) = if long { ("10min", Duration::from_secs(700)) } else { ("30s", Duration::from_secs(90)) };
    bench.simulate(&RING_OF_16.segment(), true);
    let run = bench.run_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--for", text]);
    await_op(&bench, 16);
    std::thread::sleep(Duration::from_secs(1));
    bench.order(&format!("drop redundant {DROPPED}"));
    let (output, errors) = run.finish(limit);
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
    show_summary(&format!("ring of 16 at 1 kHz for {text}, {DROPPED} frames dropped in each direction"), &output);
    let status = bench.order("status");
    bench.show_simulator_lateness();
    let lost_inside: u64 = status.lines().filter(|line| line.starts_with("lost, ")).map(last_number).sum();

    let links = [Link::read(&output, &status, "MAIN", "main"), Link::read(&output, &status, "REDUNDANT", "redundant")];
    let sum = |figure: fn(&Link) -> u64| links.iter().map(figure).sum::<u64>();
    let copies = line(&output, "copies:");
    let other = line(&output, "everything else:");
    let acyclic = figure(other, " frames sent");
    let acyclic_missing = 2 * figure(other, " lost") + figure(other, " copies lost");
    let missing = sum(|link| link.sent) - sum(|link| link.received);
    let (late, overrun) = (figure(copies, " late"), sum(|link| link.overrun));
    println!(
        "copies of process data: {} sent, {missing} not received, {overrun} of them in a full ring; {late} late\n\
         simulator: {} frames into the segment, {lost_inside} dropped, {} out of it",
        sum(|link| link.sent),
        sum(|link| link.inside),
        sum(|link| link.outside)
    );
    for link in &links {
        let out = link.sent + acyclic;
        assert_eq!(out, link.arrived + link.arrived_overrun, "what we sent has arrived: {link:?}");
        assert_eq!((link.arrived, link.outside), (link.inside, link.answered), "all went in and out: {link:?}");
        assert_eq!(link.unanswered, 0, "all could be sent: {link:?}");
    }
    assert_eq!(lost_inside, 2 * DROPPED, "the simulator dropped what it was ordered to: {status}");
    assert_eq!(sum(|link| link.inside) - lost_inside, sum(|link| link.outside), "the segment lost nothing else");
    let dropped = lost_inside + sum(|link| link.arrived_overrun);
    // A dropped frame may have been an acyclic one.
    let range = dropped.saturating_sub(acyclic_missing)..=dropped;
    assert!(
        range.contains(&(missing - overrun)),
        "{missing} copies are missing, {overrun} found a full ring: {range:?}"
    );
}

fn last_number(line: &str) -> u64 {
    line.rsplit(' ').next().and_then(|number| number.parse().ok()).expect("a count")
}
