//! Both halves in threads of their own, on a simulated segment in real time. The machine may be busy with anything:
//! what is asked for is that things happen, not how soon.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::shared_segment::SharedSegment;
use ringcat::{
    CycleJob, Direction, DomainId, Ended, Error, FramesIn, JobProbe, LastOutputs, Link, Links, MainDeviceRole,
    NoSnapshot, Options, Position, Services, SubDeviceId, SupervisorThread, automatic,
};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::frame::MacAddress;
use ringcat_wire::register::map;

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\n\
                       type = \"digital-output-8\"\n\
                       [[device]]\ntype = \"servo\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);

fn network() -> Network {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    Network::from_description(segment).expect("it can be built")
}

/// Waits for something that another thread does.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let end = Instant::now() + LIMIT;
    while !holds() {
        assert!(Instant::now() < end, "{what}");
        sleep(Duration::from_millis(1));
    }
}

// covers: threads
#[test]
fn two_threads_reach_op_exchange_data_and_stop_in_order() -> Result<(), Error> {
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let plant = cyclic.plant();
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    assert_eq!(scan.subdevices.len(), 3);
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    assert_eq!(application.supervisor().subdevices()?.len(), 3);
    let output = application.entry(SubDeviceId(1), 0x7000, 1).expect("the terminal's first channel");
    let cycles = application.start_cycles(
        || (),
        move |data| {
            data.write(&output, 1).expect("it is an output");
            ControlFlow::Continue(())
        },
    )?;
    until("all are in OP", || cycles.supervisor().all_settled());
    until("outputs arrive", || plant.with_network(|network| outputs(network)[0] == [1]));
    // On a busy machine a frame may be late.
    until("a cycle is complete", || {
        cycles.cyclic_status().status(DomainId(0)).is_ok_and(|status| status.expected > 0 && status.wkc > 0)
    });
    let events: Vec<_> = std::iter::from_fn(|| cycles.supervisor().pop_event()).collect();
    assert!(events.len() >= 3, "{events:?}");
    assert!(cycles.cyclic_status().pace().cycles > 0 && cycles.cyclic_status().counters().sent > 0);
    assert!(cycles.cyclic_status().round_trips().count() > 0);

    let Ended { supervisor, links, .. } = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    plant.with_network(|network| {
        assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Init)));
        assert!(outputs(network).iter().flatten().all(|byte| *byte == 0));
    });
    assert_eq!(supervisor.scan()?.subdevices.len(), 3, "a stopped MainDevice scans again");
    assert!(links.now() > ringcat::Instant(0));
    Ok(())
}

/// A measurement of delays has opened the ring: the next owner of the segment finds it closed.
// covers: daemon, ring-goes-on
#[test]
fn a_hand_over_waits_for_the_end_of_a_measurement_that_has_opened_the_ring() -> Result<(), Error> {
    let loops = |network: &mut Network| -> Vec<u8> {
        network.devices().map(|device| device.controller.register(map::DL_CONTROL, 2)[1]).collect()
    };
    let mut opened = 0;
    for _ in 0..100 {
        if opened == 5 {
            break;
        }
        let (cyclic, acyclic) = SharedSegment::halves(network());
        let plant = cyclic.plant();
        let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
        supervisor.scan()?;
        let mut report = supervisor.background().port_report();
        let is_open = || plant.with_network(|network| loops(network) != [0; 3]);
        until("it ends, or the ring is open", || is_open() || report.take().is_some());
        opened += u32::from(is_open());
        assert!(supervisor.hand_over()?.is_some());
        assert_eq!(plant.with_network(loops), [0; 3]);
    }
    assert_eq!(opened, 5, "it is seen open");
    Ok(())
}

/// An application ends without a further frame where another MainDevice has the segment.
// covers: 9.11, threads, stop
#[test]
fn no_cycle_runs_in_role_inactive_when_an_application_stops_or_deactivates() -> Result<(), Error> {
    for deactivates in [true, false] {
        let (cyclic, acyclic) = SharedSegment::halves(network());
        let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
        let scan = supervisor.scan()?;
        let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
        let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
        until("all are in OP", || cycles.supervisor().all_settled());
        let status = cycles.cyclic_status_handle();
        let supervisor = cycles.supervisor().clone();
        let application = cycles.end()?;
        supervisor.with(|engine| engine.set_role(MainDeviceRole::Inactive))?;
        let before = (status.pace().cycles, status.counters().sent);
        assert!(before.1 > 0);
        let error = match deactivates {
            true => application.deactivate(LastOutputs::Zero, LIMIT).map(drop).expect_err("it is refused").error,
            false => application.stop(LastOutputs::Zero, AlState::Init, LIMIT).map(drop).expect_err("it is refused"),
        };
        assert!(error.to_string().contains("INACTIVE"), "{error}");
        assert_eq!((status.pace().cycles, status.counters().sent), before);
    }
    Ok(())
}

// covers: threads, cycles
#[test]
fn several_threads_read_whole_snapshots_while_cycles_run() -> Result<(), Error> {
    const SNAPSHOTS: usize = 60;
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    let observer = application.observer();
    let none = observer.snapshot(Duration::from_millis(1)).expect_err("no cycle runs");
    assert!(matches!(none, NoSnapshot { limit, .. } if limit == Duration::from_millis(1)));
    let all = (0..scan.subdevices.len()).map(SubDeviceId);
    let areas = all.flat_map(|subdevice| application.directory().areas(subdevice));
    let outputs: Vec<usize> = areas
        .filter(|area| area.direction == Direction::Outputs)
        .flat_map(|area| (0..usize::from(area.placed.area.length)).map(|at| area.placed.image_offset as usize + at))
        .collect();
    assert!(outputs.len() > 4, "{outputs:?}");
    let (jobs, returns) = (JobProbe::default(), Arc::new(std::sync::atomic::AtomicU64::new(0)));
    let (times, count) = (jobs.times().clone(), returns.clone());
    let count_return = move |_at: ringcat::Instant| {
        count.fetch_add(1, Ordering::Relaxed);
    };
    let probe = (jobs, FramesIn::new(count_return));
    let cycles = application.start_cycles_probed(
        probe,
        || (),
        |data| {
            data.fill_outputs(data.cycle() as u8);
            ControlFlow::Continue(())
        },
    )?;
    let read = |observer: ringcat::Observer, outputs: Vec<usize>| {
        move || {
            let mut last = 0;
            for _ in 0..SNAPSHOTS {
                let snapshot = observer.snapshot(LIMIT).expect("cycles run");
                let image = &snapshot.domains[0].image;
                assert!(outputs.iter().all(|at| image[*at] == image[outputs[0]]), "of two cycles: {image:02x?}");
                // Outputs of the cycle before, from the second one on.
                let wanted = snapshot.cycle.saturating_sub(1) as u8;
                assert!(snapshot.cycle < 2 || image[outputs[0]] == wanted, "{}: {image:02x?}", snapshot.cycle);
                assert!(snapshot.cycle >= last, "it goes back");
                last = snapshot.cycle;
            }
        }
    };
    let readers: Vec<_> = (0..4).map(|_| std::thread::spawn(read(observer.clone(), outputs.clone()))).collect();
    readers.into_iter().for_each(|reader| reader.join().expect("whole snapshots"));
    until("frames of the links are counted", || observer.link(Link::Redundant).frames > 100);
    until("frames came back", || returns.load(Ordering::Relaxed) > 10);
    let counts = CycleJob::ALL.map(|job| times.of(job).histogram().count());
    assert!(counts[1..].iter().all(|count| *count > 10) && counts[0] > 0, "{counts:?}");
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    let observed = observer.snapshot(Duration::from_millis(1));
    assert!(observed.is_err(), "the cycles have ended");
    Ok(())
}

fn outputs(network: &Network) -> Vec<Vec<u8>> {
    network.devices().map(|device| device.outputs().to_vec()).filter(|bytes| !bytes.is_empty()).collect()
}

// covers: threads
#[test]
fn an_application_whose_closure_breaks_comes_back_and_goes_on_by_hand() -> Result<(), Error> {
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    let mut left = 10;
    let cycles = application.start_cycles(
        || (),
        move |_| {
            left -= 1;
            if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    )?;
    until("the closure breaks", || cycles.has_ended());
    let mut application = cycles.end()?;
    assert_eq!(application.pace().cycles, 10);
    until("all are in OP", || {
        application.cycle(|_| ());
        application.all_settled()
    });
    assert_eq!(application.states().len(), 3);
    Ok(())
}

// covers: threads
#[test]
fn a_refused_declaration_leaves_both_parts_for_another_try() -> Result<(), Error> {
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let good = automatic(&supervisor.scan()?.subdevices, PERIOD);
    let mut wrong = good.clone();
    wrong.domains[0].members[0].subdevice = SubDeviceId(99);
    let refused = supervisor.activate(wrong, cyclic).expect_err("there is no SubDevice 99");
    assert!(refused.error.to_string().starts_with("activation: "), "{}", refused.error);
    let Ended { supervisor, links: cyclic, .. } = refused.main_device;
    assert!(supervisor.activate(good, cyclic).is_ok());
    Ok(())
}

/// Of some batches the best: the machine may be busy. A thread that looked once in a millisecond would take one for
/// each question, however idle the machine is.
// covers: threads
#[test]
fn consecutive_requests_do_not_wait_a_millisecond_each() -> Result<(), Error> {
    const QUESTIONS: u32 = 20;
    let (_cyclic, acyclic) = SharedSegment::halves(network());
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let mut best = Duration::MAX;
    for _ in 0..20 {
        let begin = Instant::now();
        for _ in 0..QUESTIONS {
            supervisor.with(|_| ())?;
        }
        best = best.min(begin.elapsed());
    }
    println!("{:?} for a question", best / QUESTIONS);
    assert!(best < QUESTIONS * Duration::from_micros(600), "{best:?}");
    Ok(())
}

// covers: signals
#[test]
fn a_panic_of_the_closure_is_an_error_of_its_own_and_the_bus_is_stopped_in_order() -> Result<(), Error> {
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let plant = cyclic.plant();
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    let output = application.entry(SubDeviceId(1), 0x7000, 1).expect("the terminal's first channel");
    let panics = Arc::new(AtomicBool::new(false));
    let asked = panics.clone();
    let cycles = application.start_cycles(
        || (),
        move |data| {
            data.write(&output, 1).expect("it is an output");
            assert!(!asked.load(Ordering::Relaxed), "the recipe has no step {}", 7);
            ControlFlow::Continue(())
        },
    )?;
    until("all are in OP", || cycles.supervisor().all_settled());
    until("outputs arrive", || plant.with_network(|network| outputs(network)[0] == [1]));
    assert!(!cycles.has_ended());
    panics.store(true, Ordering::Relaxed);
    until("the closure runs no more", || cycles.has_ended());
    until("outputs are zero", || plant.with_network(|network| outputs(network)[0] == [0]));
    // Longer than any watchdog: cycles go on, so the SubDevices stay in OP until they are stopped. One that has left OP
    // because the machine ran no cycle for a while comes back by these cycles only.
    let before = cycles.cyclic_status().pace().cycles;
    sleep(Duration::from_millis(300));
    assert!(cycles.cyclic_status().pace().cycles > before);
    until("all are in OP still", || cycles.supervisor().all_settled());

    let panicked = cycles.end().expect_err("the closure has panicked");
    assert_eq!(panicked.message, "the recipe has no step 7");
    let words = "the application's closure has panicked: the recipe has no step 7";
    assert_eq!(panicked.to_string(), words);
    panicked.application.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    plant.with_network(|network| {
        assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Init)));
    });
    assert_eq!(Error::Panicked(panicked.message).to_string(), words);
    Ok(())
}

/// Links that are deaf while they sleep, as those on network interfaces are. Of two copies the one comes first that has
/// passed all SubDevices, and the other one after it was taken.
struct Deaf {
    links: SharedSegment,
    arrived: Vec<(Link, Vec<u8>)>,
    has_taken: bool,
}

impl Links for Deaf {
    fn now(&self) -> ringcat::Instant {
        self.links.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.links.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let Deaf { links, arrived, has_taken } = self;
        while links.receive(&mut |link, frame| arrived.push((link, frame.to_vec()))) {}
        if std::mem::replace(has_taken, false) || arrived.is_empty() {
            return false;
        }
        let first = arrived.iter().position(|(link, _)| *link == Link::Redundant).unwrap_or(0);
        let (link, frame) = arrived.remove(first);
        take(link, &frame);
        *has_taken = true;
        true
    }

    fn wait(&mut self, until: ringcat::Instant) {
        if self.arrived.is_empty() {
            self.links.wait(until);
        }
    }

    fn sleep(&mut self, until: ringcat::Instant) {
        sleep(until.since(self.now()));
    }
}

// covers: links
#[test]
fn second_copies_are_waited_for_and_no_round_trip_is_as_long_as_a_cycle() -> Result<(), Error> {
    // Long beside the way of a frame, and beside what a busy machine adds to it.
    const LONG: Duration = Duration::from_millis(40);
    let (cyclic, acyclic) = SharedSegment::halves(network());
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let application = supervisor
        .activate(automatic(&scan.subdevices, LONG), Deaf { links: cyclic, arrived: Vec::new(), has_taken: false })?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    until("all are in OP", || cycles.supervisor().all_settled());
    cycles.cyclic_status().restart_histograms();
    let before = cycles.cyclic_status().counters().received;
    until("frames return", || cycles.cyclic_status().counters().received > before + 20);
    let trips = cycles.cyclic_status().round_trips();
    assert!(trips.count() > 20 && trips.quantile(800_000) < LONG / 4, "{trips}");
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}

// covers: threads, stop
#[test]
fn two_threads_deactivate_and_activate_another_declaration() -> Result<(), Error> {
    let (mut cyclic, acyclic) = SharedSegment::halves(network());
    let plant = cyclic.plant();
    let options = Options::default().with_idle_operation(true);
    let mut supervisor = SupervisorThread::start(acyclic, &options, || ())?;
    let preop = AlStatus::new(AlState::PreOp);
    let all_in_preop = || plant.with_network(|network| network.devices().all(|device| device.al_status() == preop));
    until("idle operation brings all to PREOP", all_in_preop);
    for round in 0..3 {
        let found = supervisor.subdevices()?;
        let declaration = automatic(&found[..=round], PERIOD);
        let application = supervisor.activate(declaration, cyclic)?;
        let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
        until("all declared are in OP", || cycles.supervisor().all_settled());
        let op = AlStatus::new(AlState::Op);
        let in_op = || plant.with_network(|network| network.devices().filter(|it| it.al_status() == op).count());
        until("these and no others are in OP", || in_op() == round + 1);
        Ended { supervisor, links: cyclic, .. } = cycles.end()?.deactivate(LastOutputs::Zero, LIMIT)?;
        assert!(all_in_preop());
        assert!(supervisor.subdevice(Position(2)).sdo_read::<u32>(0x1018, 1)? > 0);
    }
    Ok(())
}
