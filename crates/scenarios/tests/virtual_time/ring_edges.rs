//! A copy that is looped back at a cut behind the other copy: outputs arrive twice, with the same bytes. This is
//! visible only if the copy comes back (a working counter above the expected one is an incomplete cycle).

use std::time::Duration;

use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::check::Delivery;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

/// Number of SubDevices: the redundant copy is still under way when the main copy has passed [`CUT`].
const COUNT: usize = 64;
/// The cable that is cut.
const CUT: usize = 5;
/// Outputs: next to the cut, and far behind it.
const OUTPUTS: [usize; 2] = [CUT, 50];

/// Little process data, so that frames are short: couplers, two outputs and an input before the cut and one behind it.
fn segment() -> Network {
    let mut kinds = ["coupler"; COUNT];
    OUTPUTS.into_iter().for_each(|at| kinds[at] = "digital-output-8");
    [2, 60].into_iter().for_each(|at| kinds[at] = "digital-input-8");
    ring(descriptions(&kinds), NetworkOptions::default().with_detection_delay(Duration::from_micros(1)))
}

fn latched(world: &World) -> [u64; 2] {
    let counts: Vec<u64> = world.network().devices().map(Device::outputs_latched).collect();
    OUTPUTS.map(|at| counts[at])
}

/// Number of outputs behind the cut in the cycle of a cut at this moment, and the status of this cycle.
fn cut_after(world: &mut World, moment: Duration) -> ([u64; 2], Delivery, Vec<usize>) {
    let (before, mark) = (latched(world), world.mark());
    world.fault_in(moment, Fault::Cut(CableId(CUT)));
    world.cycle();
    let now = latched(world);
    let evaluated = world.evaluated(mark).last().expect("a cycle is evaluated before the next one");
    let result = ([now[0] - before[0], now[1] - before[1]], evaluated.delivery, evaluated.stale.clone());
    world.run_cycles(4);
    world.heal(CableId(CUT));
    world.run_cycles(20);
    result
}

// covers: ring-merge
#[test]
fn outputs_doubled_at_a_cut_are_incomplete_if_the_second_copy_returns() {
    let mut world = World::in_op(0, segment());
    let mut twice = Vec::new();
    for moment in (0..40_000).step_by(500).map(Duration::from_nanos) {
        let (times, delivery, stale) = cut_after(&mut world, moment);
        match times {
            [1, 1] => {}
            // All SubDevices behind the cut process the copy that was looped back.
            [2, 2] => {
                assert_eq!(delivery, Delivery::Incomplete, "cut after {moment:?}");
                assert_eq!(stale, [], "cut after {moment:?}: its inputs came with each copy");
                twice.push(moment);
            }
            _ => assert_ne!(delivery, Delivery::Complete, "cut after {moment:?}: {times:?}"),
        }
    }
    assert!(twice.len() >= 5, "{twice:?}");
}

/// All SubDevices have processed the other copy, with all inputs. The effects of the lost copy cannot be detected.
// covers: ring-merge
#[test]
fn outputs_doubled_at_a_cut_are_complete_if_the_second_copy_is_lost() {
    let mut world = World::in_op(0, segment());
    let mut twice = 0;
    for moment in (0..40_000).step_by(500).map(Duration::from_nanos) {
        // It is lost behind device 5, where the main copy has passed long before.
        let drop = Fault::Drop { cable: CableId(CUT + 1), direction: Some(Direction::AToB), count: 1 };
        world.fault_in(moment + Duration::from_micros(2), drop);
        let (times, delivery, _) = cut_after(&mut world, moment);
        if times == [2, 1] {
            assert_eq!(delivery, Delivery::Complete, "cut after {moment:?}");
            twice += 1;
        }
    }
    assert!(twice >= 5, "{twice}");
}
