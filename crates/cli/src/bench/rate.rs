//! The largest cycle rate: ever shorter cycles on a fixed grid, until a cycle has to be left out.
//!
//! A cycle is skipped because its time has passed when the thread checks, or because the frames of the last one are
//! still out. Stalls of the machine cause both at any rate, by chance; they are counted apart: a thread that only spins
//! and runs cycles is never [`STALL`] late by itself, nor is a segment that answers within less.

use std::ops::ControlFlow;
use std::time::Duration;

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::{AlState, Application, Instant, LastOutputs, Links, SiiExtent, SupervisorThread};
use ringcat_link::monotonic;

use super::cycles::{DOMAIN, STOP_LIMIT, declare, reach_op};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::InterfaceArguments;
use crate::json::bench;
use crate::json::data::Data;
use crate::output::say;
use crate::thread::ThreadArguments;
use crate::verdict::{Report, Verdict};

/// Cycle times that are tried, in microseconds.
const PERIODS_US: [u64; 17] = [1000, 500, 250, 200, 150, 125, 100, 80, 70, 60, 50, 40, 35, 30, 25, 20, 15];
/// How long each is tried.
const HELD: Duration = Duration::from_millis(300);
/// Tries of each.
const TRIES: usize = 3;
/// A delay of this length is a stall of the machine.
const STALL: Duration = Duration::from_micros(30);

/// Options of `ringcat bench rate`.
#[derive(Args, Debug)]
pub struct RateArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// Counters of one try.
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
pub fn run(arguments: &RateArguments) -> Result<Report, Failure> {
    let thread = arguments.thread;
    let end = EndRequest::watch(thread.priority)?;
    let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
    let begin = monotonic::now_ns();
    let options = arguments.interfaces.options().with_sii_extent(SiiExtent::Operation);
    let supervisor = SupervisorThread::start(acyclic, &options, move || thread.prepare_supervisor())?;
    let _awake = thread.apply();
    let (declaration, mut start_up) = declare(&supervisor.scan()?, begin);
    let mut application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
    let mut reasons = Vec::new();
    let (mut shortest, mut tried) = (None, Vec::new());
    match reach_op(&mut application, begin, &end) {
        Ok(after_ns) => {
            start_up.op_after_ns = Some(after_ns);
            for period in PERIODS_US.map(Duration::from_micros) {
                if end.is_asked() || tries(&mut application, period, &end, &mut tried).is_continue() {
                    break;
                }
                shortest = Some(period);
            }
            reasons.extend(end.by().map(|by| format!("ended by {by} before all rates were tried")));
        }
        Err(reason) => reasons.push(reason),
    }
    reasons.extend(application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).err().map(|error| error.to_string()));
    let data = bench::Rate {
        start_up,
        tries: tried,
        shortest_cycle_ns: shortest.map(|period| period.as_nanos() as u64),
        largest_rate_hz: shortest.map(|period| 1.0 / period.as_secs_f64()),
    };
    let rate = data.largest_rate_hz.map(|rate| format!("{rate:.0} Hz"));
    match &rate {
        Some(rate) => say!("largest rate without a skipped cycle: {rate}"),
        None if reasons.is_empty() => reasons.push("no rate was held without a skipped cycle".to_owned()),
        None => {}
    }
    Ok(Report { verdict: Verdict::of(reasons, rate.unwrap_or_default()), data: Data::Rate(data) })
}

/// Tries a period, and notes each try; breaks where the period is kept.
fn tries(
    application: &mut Application<PacketLinks, SupervisorThread>,
    period: Duration,
    end: &EndRequest,
    tried: &mut Vec<bench::Try>,
) -> ControlFlow<()> {
    for attempt in (1..=TRIES).take_while(|_| !end.is_asked()) {
        let Seen { cycles, skipped, stalled, latest, .. } = hold(application, period, end);
        say!(
            "every {} us, try {attempt}: {cycles} cycles, {skipped} skipped, {stalled} more in stalls of the machine, \
             the latest by {:.1} us",
            period.as_micros(),
            latest.as_nanos() as f64 / 1e3
        );
        tried.push(bench::Try {
            cycle_ns: period.as_nanos() as u64,
            cycles,
            skipped_cycles: skipped,
            stalled_cycles: stalled,
            longest_delay_ns: latest.as_nanos() as u64,
        });
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

/// Receives frames until the time has come, and calls `returned` when none is out any more; returns the time then.
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
    fn cycles_that_a_stall_has_skipped_are_counted_apart() {
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
