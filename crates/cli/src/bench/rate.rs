//! The largest cycle rate: ever shorter cycles on a fixed grid, until one has to be left out.
//!
//! A cycle is skipped because its time has passed when the thread looks, or because the frames of the last one are
//! still out. Stalls of the machine do both at any rate and come by chance; they are counted apart: a thread that does
//! nothing but spin and run cycles is never [`STALL`] late by itself, nor is a segment that answers within less.

use std::ops::ControlFlow;
use std::time::Duration;

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::{AlState, Application, Instant, LastOutputs, Links, SupervisorThread};
use ringcat_link::monotonic;

use super::cycles::{DOMAIN, STOP_LIMIT, declare, reach_op};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, ThreadArguments};
use crate::output::say;
use crate::verdict::Verdict;

/// Cycle times that are tried, in microseconds.
const PERIODS_US: [u64; 17] = [1000, 500, 250, 200, 150, 125, 100, 80, 70, 60, 50, 40, 35, 30, 25, 20, 15];
/// How long each is held.
const HELD: Duration = Duration::from_millis(300);
/// Tries of each.
const TRIES: usize = 3;
/// What is later than this was held up by the machine.
const STALL: Duration = Duration::from_micros(30);

/// Options of `ringcat bench rate`.
#[derive(Args, Debug)]
pub struct RateArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// What a try has seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    cycles: u64,
    skipped: u64,
    /// Cycles skipped because the machine stalled, at this end or at the other.
    stalled: u64,
    latest: Duration,
    shortest_round_trip: Duration,
}

/// Measures. It has held where a rate was kept and SubDevices were stopped in order.
pub fn run(arguments: &RateArguments) -> Result<Verdict, Failure> {
    let thread = arguments.thread;
    let end = EndRequest::watch(thread.priority)?;
    let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
    let begin = monotonic::now_ns();
    let options = arguments.interfaces.options();
    let supervisor = SupervisorThread::start(acyclic, &options, move || thread.prepare_supervisor())?;
    let _awake = thread.apply();
    let declaration = declare(&supervisor.scan()?, begin);
    let mut application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
    let mut reasons = Vec::new();
    let mut shortest = None;
    match reach_op(&mut application, begin, &end) {
        Ok(()) => {
            for period in PERIODS_US.map(Duration::from_micros) {
                if end.is_asked() || tries(&mut application, period, &end).is_continue() {
                    break;
                }
                shortest = Some(period);
            }
            reasons.extend(end.by().map(|by| format!("ended by {by} before all rates were tried")));
        }
        Err(reason) => reasons.push(reason),
    }
    reasons.extend(application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).err().map(|error| error.to_string()));
    let rate = shortest.map(|period| format!("{:.0} Hz", 1.0 / period.as_secs_f64()));
    match &rate {
        Some(rate) => say!("largest rate without a skipped cycle: {rate}"),
        None if reasons.is_empty() => reasons.push("no rate was held without a skipped cycle".to_owned()),
        None => {}
    }
    Ok(Verdict::of(reasons, rate.unwrap_or_default()))
}

/// Breaks where the period is held.
fn tries(
    application: &mut Application<PacketLinks, SupervisorThread>,
    period: Duration,
    end: &EndRequest,
) -> ControlFlow<()> {
    for attempt in (1..=TRIES).take_while(|_| !end.is_asked()) {
        let Seen { cycles, skipped, stalled, latest, .. } = hold(application, period, end);
        say!(
            "every {} us, try {attempt}: {cycles} cycles, {skipped} skipped, {stalled} more in stalls of the machine, \
             the latest by {:.1} us",
            period.as_micros(),
            latest.as_nanos() as f64 / 1e3
        );
        if skipped == 0 && stalled < cycles / 2 {
            return ControlFlow::Break(());
        }
    }
    ControlFlow::Continue(())
}

/// Cycles on a grid, for a while.
fn hold(application: &mut Application<PacketLinks, SupervisorThread>, period: Duration, asked: &EndRequest) -> Seen {
    let mut seen =
        Seen { cycles: 0, skipped: 0, stalled: 0, latest: Duration::ZERO, shortest_round_trip: Duration::MAX };
    let end = application.now() + HELD;
    let mut next = application.now() + period;
    // When frames left that are out, and how many cycles have found them so.
    let (mut out, mut waiting) = (None, 0);
    while next < end && !asked.is_asked() {
        let now = wait_until(application, next, |now| {
            if let Some(sent) = out.take() {
                seen.returned(now.since(sent), waiting);
                waiting = 0;
            }
        });
        let delay = now.since(next);
        seen.latest = seen.latest.max(delay);
        let passed = (delay.as_nanos() / period.as_nanos()) as u64;
        next += Duration::from_nanos((passed + 1).saturating_mul(period.as_nanos() as u64));
        seen.cycles += 1;
        *seen.account(delay) += passed;
        if application.process(DOMAIN).pending {
            waiting += 1;
            continue;
        }
        application.queue(DOMAIN);
        application.send();
        out = Some(now);
    }
    seen
}

impl Seen {
    /// Where cycles are counted that were skipped with such a delay.
    fn account(&mut self, delay: Duration) -> &mut u64 {
        if delay >= STALL { &mut self.stalled } else { &mut self.skipped }
    }

    /// Frames are back that so many cycles have waited for.
    fn returned(&mut self, round_trip: Duration, waiting: u64) {
        self.shortest_round_trip = self.shortest_round_trip.min(round_trip);
        *self.account(round_trip - self.shortest_round_trip) += waiting;
    }
}

/// Takes in frames until the time has come, and tells when none is out any more; returns what time it is then.
fn wait_until(
    application: &mut Application<PacketLinks, SupervisorThread>,
    until: Instant,
    mut returned: impl FnMut(Instant),
) -> Instant {
    loop {
        application.receive();
        let now = application.now();
        if !application.exchange().in_flight() {
            returned(now);
        }
        if now >= until {
            return now;
        }
        application.links_mut().wait(until);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: bench
    #[test]
    fn what_a_stall_has_skipped_is_counted_apart() {
        let us = Duration::from_micros;
        let mut seen =
            Seen { cycles: 0, skipped: 0, stalled: 0, latest: Duration::ZERO, shortest_round_trip: Duration::MAX };
        seen.returned(us(20), 0);
        seen.returned(us(45), 1);
        assert_eq!((seen.skipped, seen.stalled), (1, 0));
        seen.returned(us(60), 3);
        *seen.account(us(200)) += 5;
        assert_eq!((seen.skipped, seen.stalled), (1, 8));
    }
}
