//! Random segments with rings behind junctions, nested or separate, hot connect groups inside or outside of them, one
//! link or two: groups join and leave, cables break and are repaired, the segment is rescanned, at any moment. Reports
//! are compared with the injected changes. Frames are lost meanwhile.
//!
//! `SEED=17 cargo test --workspace --test virtual_time junctions::explorer::seeds -- --nocapture` runs one seed,
//! `SEED=1000..2000` many.

use std::time::Duration;

use ringcat::{Event, RingState, SubDeviceId};
use ringcat_engine::main_device::Pending;
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::fault::Fault;
use scenarios::check::Delivery;
use scenarios::dice::Dice;
use scenarios::world::{Mark, World};

use super::plans::Plan;
use crate::hot_connect::LIMIT;

/// A run.
struct Run {
    plan: Plan,
    world: World,
    dice: Dice,
    group_is_on: bool,
    broken: Option<usize>,
    /// The group has joined or left as requested.
    is_settled: bool,
    /// A rescan has updated the cabling.
    is_known: bool,
    looking: Option<Pending<Result<ringcat::Rescan, ringcat::ServiceError>>>,
    /// The broken cable was reported while the cabling was known.
    was_reported: bool,
    mark: Mark,
}

impl Run {
    fn changes(&mut self, since: Mark) -> Vec<Event> {
        // SubDevices that have joined have an address since then.
        self.world.recognise();
        let events = self.world.events(since).iter().map(|timed| timed.event.clone());
        events.filter(|event| matches!(event, Event::JunctionChanged { .. })).collect()
    }

    /// Ports of the SubDevices in an event.
    fn ends(&self, event: &Event) -> [Option<(DeviceIndex, u8)>; 2] {
        let Event::JunctionChanged { near, far, declared, .. } = event else { return [None; 2] };
        let end = |port: Option<u8>, declared: Option<SubDeviceId>| Some((self.world.device_of(declared?.0)?, port?));
        [end(near.map(|near| near.port()), declared[0]), end(Some(far.port()), declared[1])]
    }

    fn is_of(&self, event: &Event, cable: usize, is_broken: bool) -> bool {
        let end = |end: Endpoint| match end {
            Endpoint::Device(device, port) => Some((device, port.index() as u8)),
            Endpoint::Host(_) => None,
        };
        let (one, other) = self.plan.cables[cable];
        let ends = [end(one), end(other)];
        let reports = self.ends(event);
        matches!(event, Event::JunctionChanged { broken, .. } if *broken == is_broken)
            && (reports == ends || reports == [ends[1], ends[0]])
    }

    fn cycles(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.world.cycle();
            if self.looking.as_mut().is_some_and(|pending| pending.take().is_some()) {
                self.looking = None;
            }
        }
    }

    fn is_closed(&self) -> bool {
        self.world.application().ring() == RingState::Closed || !self.plan.two_links
    }

    /// A rescan, which may continue during other changes.
    fn look(&mut self) {
        self.world.say("a look");
        self.looking = Some(self.world.application_mut().engine_mut().start_rescan(LIMIT));
        if self.dice.one_in(3) {
            // The next change happens during the rescan.
            let cycles = self.dice.below(4);
            return self.cycles(cycles);
        }
        self.finish_looking();
        self.is_known = self.is_closed() || self.is_known;
        self.cycles(60);
    }

    fn finish_looking(&mut self) {
        let begin = self.world.now();
        while self.looking.is_some() {
            self.cycles(1);
            assert!(self.world.now().since(begin) < 3 * LIMIT, "a rescan ends");
        }
    }

    fn toggle_group(&mut self) {
        self.group_is_on = !self.group_is_on;
        self.is_known = false;
        let mut devices = self.plan.group();
        if self.dice.one_in(2) {
            devices.reverse();
        }
        for device in devices {
            self.world.fault(if self.group_is_on { Fault::PowerOn(device) } else { Fault::PowerOff(device) });
            let pause = self.dice.below(4);
            self.cycles(pause);
        }
        // Sometimes the run does not wait until the group is settled.
        self.is_settled = false;
        if !self.dice.one_in(4) {
            self.settle();
        }
    }

    fn settle(&mut self) {
        let is_on = self.group_is_on;
        if self.plan.has_group {
            self.world.until(LIMIT, "the group has joined or left", |world| {
                let group = world.application().groups()[0];
                if is_on { group.has_joined() } else { group.present == 0 }
            });
            self.world.recognise();
        }
        self.cycles(200);
        self.is_settled = true;
        let last = self.world.evaluated(self.mark).last().map(|evaluated| evaluated.delivery);
        assert!(matches!(last, Some(Delivery::Complete | Delivery::WithoutAbsent)), "{last:?}");
    }

    fn cut_or_heal(&mut self) {
        if let Some(cable) = self.broken.take() {
            let mark = self.world.mark();
            self.world.heal(CableId(cable));
            self.cycles(150);
            let reports = self.changes(mark);
            let is_local = self.plan.local.contains(&cable);
            if is_local && self.was_reported && self.is_settled {
                assert_eq!(reports.len(), 1, "cable {cable}");
                assert!(!self.is_known || self.is_of(&reports[0], cable, false), "cable {cable}: {reports:?}");
            }
            return;
        }
        let cable = *self.dice.pick(&self.plan.redundant_cables());
        let of_group =
            |end: Endpoint| matches!(end, Endpoint::Device(device, _) if self.plan.group().contains(&device));
        let (one, other) = self.plan.cables[cable];
        // While the group is absent the ring is broken there already.
        if !self.group_is_on && (self.plan.in_ring || of_group(one) || of_group(other)) {
            return;
        }
        let is_exact = self.is_known && self.is_settled && self.looking.is_none();
        self.broken = Some(cable);
        let mark = self.world.mark();
        self.world.cut(CableId(cable));
        self.cycles(60);
        let reports = self.changes(mark);
        let is_local = self.plan.local.contains(&cable);
        assert!(reports.len() <= usize::from(is_local) || !self.is_settled, "cable {cable}: {reports:?}");
        self.was_reported = reports.iter().any(|event| matches!(event, Event::JunctionChanged { broken: true, .. }));
        if is_exact && is_local {
            assert!(self.was_reported && self.is_of(&reports[0], cable, true), "cable {cable}: {reports:?}");
        }
    }

    /// Frames are lost or damaged, without a change of cables.
    fn disturb(&mut self) {
        let cable = CableId(self.dice.below(self.plan.cables.len() as u64) as usize);
        let count = 1 + self.dice.below(2) as u32;
        let fault = if self.dice.one_in(2) {
            Fault::Drop { cable, direction: None, count }
        } else {
            Fault::Corrupt { cable, direction: None, count }
        };
        let pause = Duration::from_micros(self.dice.below(3_000));
        self.world.fault_in(pause, fault);
    }

    /// A plug with bad contact: at most one break and one repair are reported.
    fn flap(&mut self) {
        if self.broken.is_some() || !self.is_settled || (self.plan.in_ring && !self.group_is_on) {
            return;
        }
        let cable = *self.dice.pick(&self.plan.redundant_cables());
        let mark = self.world.mark();
        for _ in 0..1 + self.dice.below(3) {
            for fault in [Fault::Cut(CableId(cable)), Fault::Heal(CableId(cable))] {
                self.world.fault(fault);
                let pause = 1 + self.dice.below(15);
                self.cycles(pause);
            }
        }
        self.cycles(100);
        let reports = self.changes(mark);
        let is_broken = |event: &&Event| matches!(event, Event::JunctionChanged { broken: true, .. });
        let broken = reports.iter().filter(is_broken).count();
        assert!(broken <= 1 && reports.len() == 2 * broken, "cable {cable}: {reports:?}");
    }

    /// More breaks than tolerated: two cables of local rings. Both are reported, with their places if the cabling is
    /// known, and all SubDevices return after the repair.
    fn break_two(&mut self) {
        if self.broken.is_some() || self.looking.is_some() || !self.is_settled || !self.is_known {
            return;
        }
        if !self.group_is_on && self.plan.in_ring {
            return;
        }
        let one = *self.dice.pick(&self.plan.local);
        let other = *self.dice.pick(&self.plan.local);
        let (mark, apart) = (self.world.mark(), Duration::from_micros(self.dice.below(1_500)));
        self.world.cut(CableId(one));
        self.world.fault_in(apart, Fault::Cut(CableId(other)));
        self.cycles(400);
        let reports = self.changes(mark);
        for cable in [one, other] {
            let is_reported = reports.iter().filter(|event| self.is_of(event, cable, true)).count();
            assert_eq!(is_reported, 1, "cables {one} and {other}: {reports:?}");
        }
        let crossed = |event: &Event| matches!(event, Event::LineCrossed { .. } | Event::JunctionUnknown { .. });
        self.world.heal(CableId(other));
        let pause = self.dice.below(100);
        self.cycles(pause);
        self.world.heal(CableId(one));
        self.world.until(2 * LIMIT, "all back", |world| {
            let last = world.evaluated(mark).last().map(|evaluated| evaluated.delivery);
            let is_well = matches!(last, Some(Delivery::Complete | Delivery::WithoutAbsent));
            is_well && world.application().all_settled()
        });
        self.settle();
        let reports = self.changes(mark);
        assert!(matches!(reports.last(), Some(Event::JunctionChanged { broken: false, breaks: 0, .. })), "{reports:?}");
        assert!(!self.world.saw(mark, crossed), "cables {one} and {other}");
        self.mark = self.world.mark();
    }

    fn step(&mut self) {
        if self.dice.one_in(3) {
            self.disturb();
        }
        match self.dice.below(8) {
            7 => self.break_two(),
            6 => self.flap(),
            0 | 1 if self.looking.is_none() => self.look(),
            2 if self.plan.has_group && (self.broken.is_none() || !self.plan.in_ring) => self.toggle_group(),
            3..=5 => self.cut_or_heal(),
            _ => self.cycles(20),
        }
    }

    /// Checks that hold at all times.
    fn check(&self) {
        let group = if self.plan.has_group { self.plan.group().to_vec() } else { Vec::new() };
        let left: Vec<DeviceIndex> =
            self.world.left_op(self.mark).into_iter().filter(|it| !group.contains(it)).collect();
        assert_eq!(left, [], "only the group leaves OP");
        let is_wrong = |event: &Event| {
            matches!(
                event,
                Event::LineCrossed { .. }
                    | Event::JunctionUnknown { .. }
                    | Event::Moved { .. }
                    | Event::JunctionsBlocked { .. }
                    | Event::Unexpected { .. }
                    | Event::ConfigurationFailed { .. }
                    | Event::ScanFailed { .. }
            )
        };
        assert!(!self.world.saw(self.mark, is_wrong), "{:?}", self.world.events(self.mark));
    }
}

fn run(seed: u64) {
    let mut dice = Dice::new(seed);
    let plan = Plan::random(&mut dice);
    let strict = plan.connections.iter().all(|it| it.head_port == 1) && dice.one_in(2);
    // A ring with an absent end is not learned.
    let is_tail = plan.connections.iter().any(|it| it.tail >= SubDeviceId(plan.kinds.len()));
    let group_is_on = plan.has_group && (is_tail || dice.one_in(2));
    let mut world = plan.world(seed, strict, group_is_on);
    world.say(format!("{plan:?}, strict: {strict}"));
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    world.recognise();
    // Joining SubDevices latch former outputs.
    world.evaluate_latched(false);
    world.run_cycles(60);
    let mark = world.mark();
    // While the group is absent its ring is broken at its place.
    let is_known = !plan.in_ring || group_is_on;
    let mut run = Run {
        plan,
        world,
        dice,
        group_is_on,
        broken: None,
        is_known,
        is_settled: true,
        looking: None,
        was_reported: false,
        mark,
    };
    for _ in 0..12 {
        run.step();
        run.check();
    }
    run.finish_looking();
    if run.broken.is_some() {
        run.cut_or_heal();
    }
    if run.plan.has_group && !run.group_is_on {
        run.toggle_group();
    }
    run.settle();
    run.look();
    run.finish_looking();
    run.cycles(60);
    run.is_known = true;
    // Then every cable of a ring is reported with its true place.
    for cable in run.plan.local.clone() {
        for broken in [true, false] {
            let mark = run.world.mark();
            run.world.fault(if broken { Fault::Cut(CableId(cable)) } else { Fault::Heal(CableId(cable)) });
            run.cycles(100);
            let reports = run.changes(mark);
            assert!(reports.len() == 1 && run.is_of(&reports[0], cable, broken), "cable {cable}: {reports:?}");
            let Event::JunctionChanged { breaks, .. } = reports[0] else { unreachable!() };
            assert_eq!(breaks, usize::from(broken), "cable {cable}");
        }
    }
    run.check();
}

fn runs(seeds: impl IntoIterator<Item = u64>) {
    let failed: Vec<u64> = seeds.into_iter().filter(|seed| std::panic::catch_unwind(|| run(*seed)).is_err()).collect();
    assert_eq!(failed, [], "seeds that fail");
}

// covers: CR-17, JR-07, junctions
#[test]
fn reports_on_random_rings_groups_and_rescans_match_the_changes() {
    // The last seeds have found faults.
    runs([0, 1, 2, 3, 12, 36, 70, 77]);
}

#[test]
fn seeds_from_the_environment() {
    crate::explorer::from_environment(run, runs);
}
