//! The live status of SubDevices, segment and links, compared with the devices in every cycle.

use std::time::Duration;

use ringcat::{AlState, AlStatusCode, DomainId, Link, Options, Scan, SubDeviceId, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use scenarios::live_truth::LiveTruth;
use scenarios::segments::{SIXTEEN, descriptions, line, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
/// A change that the cyclic frames show: until a round of supervision has read all SubDevices.
const ROUND: Duration = Duration::from_millis(50);
/// A change that the OR of all AL states hides: until the routine round.
const ROUTINE: Duration = Duration::from_millis(1050);

/// Looks per cycle.
const STEPS: u64 = 20;

/// A world with its check.
struct Scene {
    world: World,
    truth: LiveTruth,
    /// The first device that no link reaches, in a line.
    cut_before: usize,
}

impl Scene {
    fn new(world: World) -> Scene {
        let devices: Vec<usize> = (0..SIXTEEN.len()).collect();
        let truth = LiveTruth::new(&world, &devices);
        Scene { world, truth, cut_before: usize::MAX }
    }

    fn run(&mut self, cycles: u64, limit: Duration) {
        for _ in 0..cycles {
            self.world.cycle();
            let end = self.cut_before;
            self.truth.look(&self.world, limit, |device| device.0 < end);
        }
    }

    /// Cycles in parts, with a look every 50 us.
    fn run_finely(&mut self, cycles: u64, mut each: impl FnMut(&World)) {
        for step in 0..cycles * STEPS {
            let application = self.world.application_mut();
            application.receive();
            if step % STEPS == 0 {
                application.process(DomainId(0));
                application.queue(DomainId(0));
                application.send();
            }
            self.world.network_mut().advance_by(CYCLE / STEPS as u32);
            self.truth.look(&self.world, ROUTINE, |_| true);
            each(&self.world);
        }
    }

    fn run_until_op(&mut self) {
        for _ in 0..5_000 {
            self.run(1, ROUTINE);
            if self.world.all_in_op() && self.world.application().all_settled() {
                return;
            }
        }
        panic!("not in OP");
    }
}

fn sixteen_in_a_line(seed: u64) -> World {
    World::new(seed, line(descriptions(&SIXTEEN), NetworkOptions::default().with_detection_delay(FAST)))
}

// covers: threads
#[test]
fn start_up_power_loss_and_return_are_shown_within_a_round() {
    let mut scene = Scene::new(World::new(1, ring_of_16(FAST)));
    scene.run_until_op();
    scene.run(50, ROUND);
    for device in [0, 2, 7, 15] {
        scene.world.power_off(DeviceIndex(device));
        scene.run(100, ROUND);
        let status = scene.world.application().live_status().subdevice(SubDeviceId(device)).expect("declared");
        assert!(!status.online && !status.operational && status.al_state.is_none());
        scene.world.power_on(DeviceIndex(device));
        scene.run_until_op();
        scene.run(50, ROUND);
    }
    println!("{} states compared, the slowest shown after {:?}", scene.truth.compared, scene.truth.slowest);
    assert!(scene.truth.compared > 10_000 && scene.truth.slowest < ROUTINE);
}

// covers: threads
#[test]
fn a_cut_line_shows_the_subdevices_behind_it_offline_until_they_are_back() {
    let mut scene = Scene::new(sixteen_in_a_line(2));
    scene.run_until_op();
    scene.run(50, ROUND);
    let live = scene.world.application().live_status();
    for cable in [12, 5, 0] {
        scene.world.cut(CableId(cable));
        scene.cut_before = cable;
        scene.run(100, ROUND);
        assert_eq!(usize::from(live.segment().responding), cable);
        assert_eq!(usize::from(live.link(Link::Main).answering), cable);
        scene.world.heal(CableId(cable));
        scene.cut_before = usize::MAX;
        scene.run_until_op();
        scene.run(1100, ROUTINE);
        scene.run(1, ROUND);
        assert_eq!(live.segment().responding, 16);
    }
}

// covers: threads
#[test]
fn a_cut_ring_shows_both_sides_and_a_single_loss_shows_nothing() {
    let mut scene = Scene::new(World::in_op(3, ring_of_16(FAST)));
    scene.run(20, ROUND);
    let live = scene.world.application().live_status();
    let counts = || Link::ALL.map(|link| live.link(link).answering);
    assert_eq!(counts(), [16, 0]);
    for cable in [0, 4, 16] {
        scene.world.cut(CableId(cable));
        scene.run(40, ROUND);
        assert_eq!(counts(), [cable as u16, 16 - cable as u16], "cable {cable}");
        assert!(
            Link::ALL
                .iter()
                .all(|link| live.link(*link).al_states == if live.link(*link).answering > 0 { 8 } else { 0 })
        );
        scene.world.heal(CableId(cable));
        scene.run(40, ROUND);
        assert_eq!(counts(), [16, 0]);
    }
    let before = Link::ALL.map(|link| live.lost(link));
    // Both copies of one cyclic frame.
    scene.world.drop(CableId(8), 1);
    for _ in 0..20 {
        scene.run(1, ROUND);
        assert_eq!(live.segment().responding, 16);
    }
    let after = Link::ALL.map(|link| live.lost(link));
    let lost: u64 = before.iter().zip(&after).map(|(before, after)| after.copies - before.copies).sum();
    assert!((1..=2).contains(&lost), "{before:?} {after:?}");
    assert!(
        after.iter().zip(&before).all(|(after, before)| (after.bytes > before.bytes) == (after.copies > before.copies))
    );
}

// covers: threads
#[test]
fn subdevices_that_leave_op_show_their_error_and_code_until_they_are_back() {
    let mut scene = Scene::new(sixteen_in_a_line(4));
    scene.run_until_op();
    scene.run(50, ROUND);
    let live = scene.world.application().live_status();
    // Longer than the watchdogs of outputs.
    scene.world.stall(Duration::from_millis(300));
    let mut codes = 0;
    scene.run_finely(100, |_| {
        let shown = (0..16).filter_map(|number| live.subdevice(SubDeviceId(number)));
        codes += shown.filter(|status| status.code == AlStatusCode::SYNC_MANAGER_WATCHDOG).count();
    });
    assert!(codes > 0, "a watchdog was shown");
    // The checks of single cycles need cycles in one piece.
    let Scene { world, .. } = scene;
    drop(world);
    let mut scene = Scene::new(sixteen_in_a_line(5));
    scene.run_until_op();
    let live = scene.world.application().live_status();
    // States on request.
    for state in [AlState::SafeOp, AlState::PreOp, AlState::Init] {
        let requested = scene.world.application_mut().engine_mut().start_state_request(SubDeviceId(7), state);
        scene.run(60, ROUND);
        drop(requested);
        let status = live.subdevice(SubDeviceId(7)).expect("declared");
        assert_eq!((status.online, status.operational, status.al_state), (true, false, Some(state)));
        let requested = scene.world.application_mut().engine_mut().start_state_request(SubDeviceId(7), AlState::Op);
        scene.run_until_op();
        drop(requested);
    }
    scene.run(10, ROUND);
    assert_eq!(live.segment().al_states, AlState::Op.code());
}

// covers: threads
#[test]
fn subdevices_without_a_declaration_count_in_the_segment() {
    let declare = |scan: &Scan| automatic(&scan.subdevices[..14], CYCLE);
    let network = line(descriptions(&SIXTEEN), NetworkOptions::default().with_detection_delay(FAST));
    let world = World::with(5, network, &Options::default(), declare).expect("activation");
    let devices: Vec<usize> = (0..14).collect();
    let truth = LiveTruth::new(&world, &devices);
    let mut scene = Scene { world, truth, cut_before: usize::MAX };
    for _ in 0..2_000 {
        scene.run(1, ROUTINE);
    }
    let live = scene.world.application().live_status();
    assert_eq!((live.segment().responding, live.segment().al_states), (16, 0x08 | 0x01));
    assert_eq!(live.subdevice(SubDeviceId(14)), None);
    scene.world.power_off(DeviceIndex(15));
    scene.run(50, ROUND);
    assert_eq!(live.segment().responding, 15);
    scene.world.power_off(DeviceIndex(0));
    scene.cut_before = 0;
    scene.run(50, ROUND);
    assert_eq!((live.segment().responding, live.link(Link::Main).al_states), (0, 0));
    assert!((0..14).all(|number| !live.subdevice(SubDeviceId(number)).expect("declared").online));
}

// covers: threads
#[test]
fn nothing_is_online_after_the_end_of_the_application() {
    let mut scene = Scene::new(World::in_op(6, ring_of_16(FAST)));
    scene.run(20, ROUND);
    let live = scene.world.application().live_status();
    let now = scene.world.application().now();
    assert_eq!(live.segment().responding, 16);
    scene.world.application_mut().engine_mut().start_stop(AlState::Init, Duration::from_secs(1), now);
    assert_eq!(live.segment(), ringcat::SegmentStatus::default());
    assert!((0..16).all(|number| !live.subdevice(SubDeviceId(number)).expect("declared").online));
}
