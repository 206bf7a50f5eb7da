//! A round: something happens to a controller, the other one goes on, and the first one comes back as its standby.

use std::time::{Duration, Instant};

use super::GUARD;
use super::stalls::Stalls;
use super::stopped_thread::StoppedThread;
use crate::bench::await_op;
use crate::running::Running;
use crate::states;
use crate::takeover::{Pair, await_that};

/// All of a round has happened by then; an INACTIVE that has gone is noticed much earlier.
const SETTLED: Duration = Duration::from_millis(60);
/// Before the first round.
const CALM: Duration = Duration::from_millis(500);
/// A switchover has happened by then.
const SWITCHED: Duration = Duration::from_millis(10);
/// A controller that goes on after its guard has acted ends within this time.
const ENDS_WITHIN: Duration = Duration::from_secs(10);
/// The thread of a controller with the cycles.
const CYCLES: &str = "cycles";
const READY: &str = "ready: either MainDevice can fail";
const GUARD_HAS_ACTED: &str = "the guard has switched both off: this program did not run for";
const TAKEN_OVER: &str = "taken over: 10 SubDevices go on as they are";

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// SIGKILL.
    Killed,
    /// SIGSTOP, later SIGCONT.
    Stopped,
    /// Both interfaces are switched off.
    Down,
    /// The thread with its cycles hangs, all others go on.
    Hangs,
    /// It ends in order: as ACTIVE it hands its role over, a switchover.
    Ends,
}

impl Kind {
    /// All.
    pub const ALL: [Kind; 5] = [Kind::Killed, Kind::Stopped, Kind::Down, Kind::Hangs, Kind::Ends];
}

/// The controller to which it happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Victim {
    Active,
    Inactive,
}

impl Victim {
    /// Both.
    pub const ALL: [Victim; 2] = [Victim::Active, Victim::Inactive];
}

/// What the SubDevices have seen of it, the worst of all.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    pub gap: Duration,
    /// Recorded stalls of the host.
    pub stalls: Duration,
    /// How often the MainDevice changed that sent their outputs.
    pub changes: u32,
    pub expected_changes: u32,
    /// Outputs that were older than those before.
    pub back: u32,
}

/// Both controllers.
pub struct Ring<'a> {
    pair: &'a Pair,
    /// By host: `None` while it is not there.
    controllers: [Option<Running>; 2],
    active: usize,
    stalls: Stalls,
    /// Controllers that were started twice in a round.
    pub restarts: usize,
}

impl<'a> Ring<'a> {
    /// The first one is ACTIVE, the other one is ready.
    pub fn start(pair: &'a Pair) -> Ring<'a> {
        let first = pair.first(&[]);
        await_op(&pair.bench, 10);
        let second = pair.second(&[]);
        await_that("both are ready", &[&first, &second], || first.said().so_far().contains(READY));
        let stalls = Stalls::record();
        pair.bench.order("gaps");
        std::thread::sleep(CALM);
        Ring { pair, controllers: [Some(first), Some(second)], active: 0, stalls, restarts: 0 }
    }

    fn controller(&self, host: usize) -> &Running {
        self.controllers[host].as_ref().expect("it runs")
    }

    /// How often a controller has said something.
    fn count(&self, host: usize, words: &str) -> usize {
        self.controller(host).said().so_far().matches(words).count()
    }

    fn await_more(&self, host: usize, words: &str, before: usize) {
        let controllers: Vec<&Running> = self.controllers.iter().flatten().collect();
        await_that(words, &controllers, || self.count(host, words) > before);
    }

    /// Waits until both are ready. A controller whose guard has acted while it began, because the host stalled, is
    /// started again, as a service is.
    fn await_ready(&mut self, active: usize, before: usize) {
        let standby = 1 - active;
        loop {
            let controllers: Vec<&Running> = self.controllers.iter().flatten().collect();
            let was_stalled = || self.count(standby, GUARD_HAS_ACTED) > 0;
            await_that(READY, &controllers, || self.count(active, READY) > before || was_stalled());
            if !was_stalled() {
                return;
            }
            self.restarts += 1;
            self.controllers[standby].take().expect("it runs").finish(ENDS_WITHIN);
            self.start_one(standby);
        }
    }

    fn start_one(&mut self, host: usize) {
        self.controllers[host] = Some(if host == 0 { self.pair.first(&[]) } else { self.pair.second(&[]) });
    }

    /// Plays a round.
    pub fn play(&mut self, kind: Kind, victim: Victim) -> Round {
        let here = if victim == Victim::Active { self.active } else { 1 - self.active };
        let other = 1 - here;
        let changes_role = victim == Victim::Active;
        let taken_over = if kind == Kind::Ends { "ACTIVE (handed over)" } else { TAKEN_OVER };
        self.pair.bench.order("gaps");
        let before = self.count(other, taken_over);
        let begin = Instant::now();
        let mut stopped = None;
        match kind {
            Kind::Killed => self.controller(here).signal("-KILL"),
            Kind::Stopped => self.controller(here).signal("-STOP"),
            Kind::Down => self.pair.switch(here, "down"),
            Kind::Hangs => stopped = Some(StoppedThread::stop(self.controller(here).process(), CYCLES)),
            Kind::Ends => self.controller(here).signal("-INT"),
        }
        if changes_role {
            self.await_more(other, taken_over, before);
        } else {
            std::thread::sleep(GUARD);
        }
        // After a switchover the one that ends leaves the ring, which is no part of it.
        std::thread::sleep(if kind == Kind::Ends && changes_role { SWITCHED } else { SETTLED });
        let mut round = seen(&self.pair.bench.order("gaps"));
        (round.stalls, round.expected_changes) = (self.stalls.since(begin), u32::from(changes_role));
        assert_eq!(
            states(&self.pair.bench, "OP"),
            10,
            "{kind:?} of the {victim:?}: {}",
            self.pair.bench.order("status")
        );
        self.active = other;
        let ready = self.count(other, READY);
        match kind {
            Kind::Down => self.pair.switch(here, "up"),
            Kind::Stopped => self.controller(here).signal("-CONT"),
            Kind::Killed | Kind::Hangs | Kind::Ends => drop(stopped),
        }
        if kind != Kind::Down {
            let ended = self.controllers[here].take().expect("it runs");
            ended.finish(ENDS_WITHIN);
            self.start_one(here);
        }
        self.await_ready(other, ready);
        round
    }
}

/// The worst of the lines of all SubDevices.
fn seen(lines: &str) -> Round {
    let none = Duration::ZERO;
    let mut round = Round { gap: none, stalls: none, changes: 0, expected_changes: 0, back: 0 };
    for line in lines.lines() {
        let (_, figures) = line.split_once("\": ").unwrap_or_else(|| panic!("{line}"));
        let figures: Vec<&str> = figures.split(' ').collect();
        let number = |at: usize| figures[at].parse::<f64>().unwrap_or_else(|_| panic!("{line}"));
        round.gap = round.gap.max(Duration::from_secs_f64(number(2) / 1e3));
        round.changes = round.changes.max(number(8) as u32);
        round.back += number(13) as u32;
    }
    assert!(round.gap > none, "SubDevices take outputs: {lines}");
    round
}
