//! Ports of junctions that were closed on purpose, while rings without returned frames are examined (protocol 2.2).

use std::time::Duration;

use ringcat::{Event, JunctionMode, RawDatagram, SubDeviceId, SubDeviceState};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_wire::address::Position;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlStatus, LoopControl, map};
use scenarios::world::{CYCLE, World};

use super::second_breaks::{ends_of_two, two_rings};
use super::{change, in_op, reports};

/// One register controls all ports of a junction: a port that the application had closed stays closed.
// covers: 2.2, junctions
#[test]
fn a_port_closed_on_purpose_stays_closed_while_rings_are_examined() {
    for by_name in [false, true] {
        let mut world = in_op(43, two_rings(), (JunctionMode::Automatic, &[]));
        let engine = world.application_mut().engine_mut();
        if by_name {
            let block = engine.start_block(SubDeviceId(6));
            assert_eq!(world.finish(CYCLE * 1_000, block).map(|ports| ports.len()), Ok(1));
        } else {
            let set = engine.start_port_set(SubDeviceId(3), 2, LoopControl::Closed);
            assert_eq!(world.finish(CYCLE * 1_000, set), Ok(()));
        }
        let is_gone = |world: &World| world.application().states()[6] == SubDeviceState::Absent;
        world.until(Duration::from_secs(1), "6 is gone", is_gone);
        world.run_cycles(20);
        let stays_closed = |world: &mut World, cycles| {
            for _ in 0..cycles {
                world.cycle();
                let bytes = world.network().device(DeviceIndex(3)).controller.register(map::DL_STATUS, 2);
                let port = DlStatus::decode(&[bytes[0], bytes[1]]).ports[2];
                assert!(port.loop_closed, "by name: {by_name}");
            }
        };
        let mark = world.mark();
        world.cut(CableId(2));
        world.cut(CableId(6));
        stays_closed(&mut world, 1_500);
        let place = |cable, broken, breaks| {
            let (near, far) = ends_of_two(cable);
            change(Some(near), far, broken, breaks)
        };
        let blocked = |blocked, breaks| Event::JunctionsBlocked { blocked, breaks };
        assert_eq!(reports(&world, mark), [blocked(true, 0), place(2, true, 1), place(6, true, 2)]);
        world.heal(CableId(6));
        stays_closed(&mut world, 1_500);
        world.heal(CableId(2));
        stays_closed(&mut world, 200);
        assert!(is_gone(&world));
        let engine = world.application_mut().engine_mut();
        if by_name {
            let open = engine.start_open_blocked();
            assert_eq!(world.finish(CYCLE * 1_000, open), Ok(1));
        } else {
            let set = engine.start_port_set(SubDeviceId(3), 2, LoopControl::Auto);
            assert_eq!(world.finish(CYCLE * 1_000, set), Ok(()));
        }
        world.until(Duration::from_secs(3), "all in OP", |w| w.all_in_op() && w.application().all_settled());
    }
}

/// Starts to close port 2 of junction 3 of [`two_rings`], in one of several ways. The returned function gives the
/// result when it is known.
fn close_port(world: &mut World, way: usize) -> Box<dyn FnMut() -> Option<bool>> {
    let loops = vec![LoopControl::Closed.code() << 4];
    let register = map::DL_CONTROL.offset(1);
    let engine = world.application_mut().engine_mut();
    match way {
        0 => {
            let mut work = engine.start_port_set(SubDeviceId(3), 2, LoopControl::Closed);
            Box::new(move || work.take().map(|result| result.is_ok()))
        }
        1 => {
            let mut work = engine.start_block(SubDeviceId(6));
            Box::new(move || work.take().map(|result| result.is_ok()))
        }
        2 => {
            let mut work = engine.start_register_write(SubDeviceId(3), register, loops);
            Box::new(move || work.take().map(|result| result.is_ok()))
        }
        _ => {
            let target = Target::Position(Position(3), register);
            let order = RawDatagram::new(Command::Apwr, target, loops);
            let mut work = engine.start_datagrams(vec![order]);
            Box::new(move || work.take().map(|result| matches!(result.as_deref(), Ok([Ok(_)]))))
        }
    }
}

/// The request to close a port and both breaks occur within some milliseconds: the last read port control of the
/// junction is outdated, and the response to the request may be lost. A closed port stays closed.
// covers: 2.2, junctions
#[test]
fn a_port_closed_right_before_two_rings_break_stays_closed() {
    let is_closed = |world: &World| {
        let bytes = world.network().device(DeviceIndex(3)).controller.register(map::DL_STATUS, 2);
        DlStatus::decode(&[bytes[0], bytes[1]]).ports[2].loop_closed
    };
    let mut unanswered = 0;
    for (number, after_us) in [20, 700].into_iter().enumerate() {
        for way in 0..4 {
            let mut world = in_op(100 + number as u64, two_rings(), (JunctionMode::Automatic, &[]));
            let mut result = close_port(&mut world, way);
            for cable in [2, 6] {
                world.fault_in(Duration::from_micros(after_us), Fault::Cut(CableId(cable)));
            }
            let (mut was_closed, mut answer) = (false, None);
            for cycle in 0..1_500 {
                world.cycle();
                answer = answer.or_else(&mut result);
                unanswered += usize::from(cycle == 10 && was_closed && answer.is_none());
                let closed = is_closed(&world);
                let what = format!("after {after_us} us, way {way}, cycle {cycle}, {answer:?}");
                assert!(closed || !was_closed, "{what}: it opened");
                was_closed |= closed;
            }
            let blocked = |event: &Event| matches!(event, Event::JunctionsBlocked { blocked: true, .. });
            assert!(world.saw(world.beginning(), blocked), "after {after_us} us, way {way}");
        }
    }
    assert!(unanswered > 0, "in some of them the rings broke before the response came back");
}
