//! A segment that flaps: cables, carriers and power, at several rates and sizes. Procedures that need the segment for
//! themselves get their turns: a SubDevice that comes meanwhile is found and reaches OP, and each rescan ends in time.

use std::time::Duration;

use ringcat::{Pending, Rescan, ServiceError};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const KINDS: [&str; 4] = ["digital-output-8", "digital-input-8", "servo", "digital-input-16"];
const OP: AlStatus = AlStatus::new(AlState::Op);
/// Time limit of each rescan, and how much later its result may be known.
const RESCAN: Duration = Duration::from_millis(300);
const LATE: Duration = Duration::from_millis(120);
/// Longest time from power on to OP of a SubDevice that comes while another part of the segment flaps, where the
/// segment is the same for at least [`STEADY`].
const ARRIVAL: u64 = 4_000;
const STEADY: u64 = 50;
/// Cycles after the last change in which all recover.
const RECOVERY: Duration = Duration::from_secs(8);

/// The flapping part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// A cable in the middle.
    Cable,
    /// The cable of the redundant link, with its carrier.
    Carrier,
    /// The power of a SubDevice.
    Power,
}

impl Part {
    fn flip(self, world: &mut World, count: usize, is_on: bool) {
        let cable = if self == Part::Carrier { CableId(count) } else { CableId(count / 2) };
        match (self, is_on) {
            (Part::Power, true) => world.power_on(DeviceIndex(count / 3)),
            (Part::Power, false) => world.power_off(DeviceIndex(count / 3)),
            (_, true) => world.heal(cable),
            (_, false) => world.cut(cable),
        }
    }
}

/// What was measured, the longest of all cases.
#[derive(Default, Debug)]
struct Longest {
    rescan: Duration,
    arrival: u64,
    rescans: usize,
    stable: usize,
}

/// Rescans one after the other.
struct Rescans {
    pending: Option<(Pending<Result<Rescan, ServiceError>>, u64)>,
    cycle: u64,
}

impl Rescans {
    fn cycle(&mut self, world: &mut World, longest: &mut Longest, what: &str) {
        world.run_cycles(1);
        self.cycle += 1;
        let Some((pending, begun)) = &mut self.pending else {
            let pending = world.application_mut().engine_mut().start_rescan(RESCAN);
            self.pending = Some((pending, self.cycle));
            return;
        };
        let time = Duration::from_millis(self.cycle - *begun);
        let result = pending.take();
        assert!(result.is_some() || time <= RESCAN + LATE, "{what}: a rescan lasts for {time:?}");
        if let Some(result) = result {
            longest.rescan = longest.rescan.max(time);
            longest.rescans += 1;
            longest.stable += usize::from(result.is_ok());
            self.pending = None;
        }
    }
}

fn case(part: Part, count: usize, half_period: u64, longest: &mut Longest) {
    let what = format!("{part:?} of {count} SubDevices, every {half_period} ms");
    let kinds: Vec<&str> = KINDS.into_iter().cycle().take(count).collect();
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let mut world = World::in_op(7, ring(descriptions(&kinds), options));
    let comer = DeviceIndex(count - 1);
    world.power_off(comer);
    world.run_cycles(300);
    let (mut is_on, mut arrived) = (true, None);
    let mut rescans = Rescans { pending: None, cycle: 0 };
    let arrival = 500;
    let end = arrival + if half_period >= STEADY { ARRIVAL } else { 1_000 };
    for at in 0..end {
        if at % half_period == 0 {
            is_on = !is_on;
            part.flip(&mut world, count, is_on);
        }
        if at == arrival {
            world.power_on(comer);
        }
        rescans.cycle(&mut world, longest, &what);
        if at > arrival && arrived.is_none() && world.network().device(comer).al_status() == OP {
            arrived = Some(at - arrival);
            longest.arrival = longest.arrival.max(at - arrival);
        }
        if arrived.is_some() && at > arrival + 1_000 {
            break;
        }
    }
    assert!(half_period < STEADY || arrived.is_some(), "{what}: the new SubDevice is not in OP, {}", world.condition());
    if !is_on {
        part.flip(&mut world, count, true);
    }
    world.until(RECOVERY, &what, |world| world.all_in_op() && world.application().all_settled());
}

// covers: ring-flap, rescan
#[test]
fn a_flapping_segment_starves_neither_rescans_nor_subdevices_that_come() {
    let mut longest = Longest::default();
    for part in [Part::Cable, Part::Carrier, Part::Power] {
        for count in [4, 9, 20] {
            for half_period in [1, 3, 11, 60, 400] {
                case(part, count, half_period, &mut longest);
            }
        }
    }
    println!("{longest:?}");
    assert!(longest.rescans > 300 && longest.stable > 50, "{longest:?}");
}
