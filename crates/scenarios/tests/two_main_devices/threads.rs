//! Two MainDevices of the library, each with its halves in two threads, at one ring in real time. What depends on the
//! load of the machine is not checked: no output goes back, each state is reached in the end, and cycles in both roles
//! and with both changes of role neither allocate nor free memory.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant as WallClock};

use ringcat::shared_segment::{Plant, SharedSegment};
use ringcat::standby::{Policy, RoleCause, RoleRequest, StandbyEvent, StandbyOptions};
use ringcat::{
    Application, CyclicThread, Direction, DomainId, Event, MainDeviceRole, Options, Scan, SubDeviceId,
    SupervisorThread, automatic,
};
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_wire::al::{AlState, AlStatus};

use super::outside_links::{OutsideLinks, used};
use super::ring_of_two;

const CYCLE: Duration = Duration::from_millis(5);
/// Cycles in each role, at least.
const COUNTED: u64 = 100;
/// A machine that is busy reaches a state within this time.
const LIMIT: Duration = Duration::from_secs(20);

/// The outputs of the next cycle: both controllers count on, so values compare.
static NEXT: AtomicU64 = AtomicU64::new(1);
/// Cycles of both as ACTIVE and as INACTIVE, and what they have allocated and freed.
static CYCLES: [AtomicU64; 2] = [const { AtomicU64::new(0) }; 2];
static USED: AtomicU64 = AtomicU64::new(0);

type Halves = (SharedSegment, SharedSegment);
type Cyclic = OutsideLinks<SharedSegment>;
type Member = CyclicThread<Cyclic>;

/// Joins with both threads, and runs cycles.
fn join((cyclic, acyclic): Halves) -> Member {
    let options = Options::default().with_standby(StandbyOptions::default());
    let supervisor = SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts");
    let policy = Policy::default().with_time_out(6, Duration::ZERO).with_listen(Duration::from_millis(300));
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
    let cyclic = OutsideLinks(cyclic);
    let application = supervisor.join(&policy, declare, cyclic).unwrap_or_else(|refused| panic!("{}", refused.error));
    run(application)
}

fn run(application: Application<Cyclic, SupervisorThread>) -> Member {
    let count = application.states().len();
    let areas = (0..count).flat_map(|subdevice| application.directory().areas(SubDeviceId(subdevice)).to_vec());
    let outputs: Vec<_> = areas
        .filter(|area| area.direction == Direction::Outputs && area.placed.area.length >= 2)
        .map(|area| area.placed.image_offset as usize..area.placed.image_offset as usize + 2)
        .collect();
    let mut used_before = None;
    let work = move |data: &mut ringcat::ProcessData<'_>| {
        let is_active = data.role() == MainDeviceRole::Active;
        // From one cycle to the next.
        let used = used();
        USED.fetch_add(used - used_before.replace(used).unwrap_or(used), Ordering::Relaxed);
        CYCLES[usize::from(is_active)].fetch_add(1, Ordering::Relaxed);
        if is_active {
            let number = (NEXT.fetch_add(1, Ordering::Relaxed) as u16).to_le_bytes();
            for area in outputs.iter().cloned() {
                data.outputs_mut(DomainId(0), area).expect("they are outputs").copy_from_slice(&number);
            }
        }
        ControlFlow::Continue(())
    };
    application.start_cycles(|| (), work).expect("a thread starts")
}

/// Looks into the SubDevices until a condition holds; no output goes back meanwhile.
fn until(plant: &Plant, last: &mut Vec<u16>, what: &str, mut condition: impl FnMut() -> bool) {
    let begin = WallClock::now();
    loop {
        plant.with_network(|network| {
            last.resize(network.devices().len(), 0);
            for (device, last) in network.devices().zip(last.iter_mut()) {
                let Some(number) = device.outputs().first_chunk().map(|bytes| u16::from_le_bytes(*bytes)) else {
                    continue;
                };
                assert!(number == 0 || number >= *last, "{what}: {} goes back from {last} to {number}", device.name());
                *last = number.max(*last);
            }
        });
        if condition() {
            return;
        }
        assert!(begin.elapsed() < LIMIT, "not within {LIMIT:?}: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn all_in_op(plant: &Plant) -> bool {
    plant.with_network(|network| network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Op)))
}

/// Takes the links of a host down, or brings them up.
fn switch(plant: &Plant, host: Host, up: bool) {
    plant.with_network(|network| host.links().into_iter().for_each(|link| network.disconnect(link, !up)));
}

/// The role of a member, by its handle for any thread.
fn role(member: &Member) -> MainDeviceRole {
    member.supervisor().role_control().expect("its thread runs").role()
}

fn standby_events(member: &Member) -> Vec<StandbyEvent> {
    let mut events = Vec::new();
    while let Some(event) = member.supervisor().pop_event() {
        if let Event::Standby(event) = event.event {
            events.push(event);
        }
    }
    events
}

// covers: standby, threads, no-allocation, MR-01, MR-07, REQ015
#[test]
fn two_with_cycles_in_threads_join_hand_over_and_take_over() {
    let [first, second] = SharedSegment::halves_of_two(ring_of_two(4, Host::First));
    let (plant, mut last) = (first.0.plant(), Vec::new());
    // Until its program forwards they are off.
    switch(&plant, Host::Second, false);
    let first = join(first);
    until(&plant, &mut last, "the first one brings all to OP", || all_in_op(&plant));
    switch(&plant, Host::Second, true);
    let second = join(second);
    let mut events = Vec::new();
    until(&plant, &mut last, "the second one is ready", || {
        events.extend(standby_events(&first));
        events.iter().any(|event| matches!(event, StandbyEvent::Partner(partner) if partner.is_ready()))
    });
    assert_eq!((role(&first), role(&second)), (MainDeviceRole::Active, MainDeviceRole::Inactive));

    first.supervisor().role_control().expect("its thread runs").request(RoleRequest::HandOver);
    until(&plant, &mut last, "the second one is ACTIVE", || role(&second) == MainDeviceRole::Active);
    until(&plant, &mut last, "all are in OP, the first one follows", || {
        all_in_op(&plant) && role(&first) == MainDeviceRole::Inactive && second.supervisor().all_settled()
    });
    let is_handed = |event: &StandbyEvent| {
        matches!(event, StandbyEvent::RoleChanged { role: MainDeviceRole::Active, cause: RoleCause::HandedOver })
    };
    // Its acyclic half reports the change that its cyclic half has made.
    let mut handed = Vec::new();
    until(&plant, &mut last, "the second one has reported it", || {
        handed.extend(standby_events(&second));
        handed.iter().any(is_handed)
    });

    // It fails: its threads end, its links go down.
    let is_ready = |event: &StandbyEvent| matches!(event, StandbyEvent::Partner(partner) if partner.is_ready());
    until(&plant, &mut last, "the first one is ready again", || {
        handed.extend(standby_events(&second));
        // Behind the hand-over.
        handed.iter().skip_while(|event| !is_handed(event)).any(is_ready)
    });
    let counted = || [&CYCLES[0], &CYCLES[1]].map(|cycles| cycles.load(Ordering::Relaxed));
    until(&plant, &mut last, "cycles in both roles", || counted().into_iter().all(|cycles| cycles >= COUNTED));
    drop(second);
    switch(&plant, Host::Second, false);
    until(&plant, &mut last, "the first one is ACTIVE again", || role(&first) == MainDeviceRole::Active);
    let outputs = || plant.with_network(|network| network.device(DeviceIndex(3)).outputs().to_vec());
    let before = outputs();
    until(&plant, &mut last, "outputs go on, all are in OP", || outputs() != before && all_in_op(&plant));
    assert!(last.iter().any(|number| *number > 5), "outputs were checked: {last:?}");
    drop(first.end());
    let [inactive, active] = counted();
    let used = USED.load(Ordering::Relaxed);
    println!("{active} cycles as ACTIVE, {inactive} as INACTIVE: {used} allocations and deallocations");
    assert_eq!(used, 0, "in {active} and {inactive} cycles");
}
