//! Services on single SubDevices besides the mailbox protocols: error counters, ports, resets, datagrams of the
//! application's own.

use std::time::Duration;

use ringcat::{Event, RawDatagram, SubDeviceId, SubDeviceState};
use ringcat_engine::main_device::MAX_DATAGRAMS;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::{LogicalAddress, StationAddress, Wkc};
use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{LoopControl, map};
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::World;

const KINDS: [&str; 5] = ["coupler", "digital-input-8", "digital-output-8", "all-protocols", "digital-input-16"];
const LIMIT: Duration = Duration::from_secs(2);
const OP: SubDeviceState = SubDeviceState::Settled(AlState::Op);

fn options() -> NetworkOptions {
    NetworkOptions::default().with_detection_delay(Duration::from_micros(10))
}

fn in_ring(seed: u64) -> World {
    World::in_op(seed, ring(descriptions(&KINDS), options()))
}

fn in_line(seed: u64) -> World {
    World::in_op(seed, line(descriptions(&KINDS), options()))
}

// covers: 2.5, cable-errors
#[test]
fn error_counters_are_kept_beyond_255_on_a_period_and_read_and_cleared_on_demand() {
    let mut world = in_line(1);
    world.application_mut().engine_mut().set_statistics_period(Some(Duration::from_millis(20)));
    world.run_cycles(50);
    let before = world.application().engine().statistics(SubDeviceId(2)).expect("it is declared");
    assert!(before.is_clean() && before.readings >= 2, "{before:?}");
    // Frames on the cable before the third SubDevice, in both directions: it counts those towards it, its neighbour
    // those on the way back.
    for _ in 0..40 {
        world.corrupt(CableId(2), 10);
        world.run_cycles(25);
    }
    let engine = world.application().engine();
    let [here, behind, neighbour] =
        [2, 3, 1].map(|subdevice| engine.statistics(SubDeviceId(subdevice)).expect("declared"));
    // Frames damaged on the way back are lost, so not all ten are counted in both directions.
    assert!(here.ports[0].invalid_frames >= 300, "{:?}", here.ports);
    assert_eq!(here.ports[0].forwarded, 0);
    assert!(behind.ports[0].forwarded >= 200 && behind.ports[0].invalid_frames == 0, "{:?}", behind.ports);
    assert!(neighbour.ports[1].invalid_frames > 0, "{:?}", neighbour.ports);
    assert!(here.registers.rx[0].invalid_frames < 0xFF, "it was cleared in time");
    world.application_mut().engine_mut().set_statistics_period(None);
    let readings = world.application().engine().statistics(SubDeviceId(2)).expect("declared").readings;
    world.run_cycles(100);
    assert_eq!(world.application().engine().statistics(SubDeviceId(2)).expect("declared").readings, readings);
    let read = world.application_mut().engine_mut().start_statistics_read(SubDeviceId(2));
    let read = world.finish(LIMIT, read).expect("it answers");
    assert_eq!((read.readings, read.ports[0].invalid_frames), (readings + 1, here.ports[0].invalid_frames));
    let clear = world.application_mut().engine_mut().start_statistics_clear(SubDeviceId(2));
    assert_eq!(world.finish(LIMIT, clear), Ok(()));
    assert!(world.application().engine().statistics(SubDeviceId(2)).expect("declared").is_clean());
    assert_eq!(world.network().device(DeviceIndex(2)).controller.register(map::RX_ERROR_COUNTER, 20), [0; 20]);
    world.fault(Fault::IdleSymbolErrors { cable: CableId(2), direction: None, count: 7 });
    let read = world.application_mut().engine_mut().start_statistics_read(SubDeviceId(2));
    let ports = world.finish(LIMIT, read).expect("it answers").ports;
    assert_eq!(ports.map(|port| (port.rx_errors, port.invalid_frames)), [(7, 0), (0, 0), (0, 0), (0, 0)]);
    world.fault(Fault::PdiErrors { device: DeviceIndex(2), code: 0x21, count: 3 });
    let read = world.application_mut().engine_mut().start_statistics_read(SubDeviceId(2));
    let read = world.finish(LIMIT, read).expect("it answers");
    assert_eq!((read.pdi, read.registers.pdi_code, read.is_clean()), (3, 0x21, false));
    let read = world.application_mut().engine_mut().start_statistics_read(SubDeviceId(99));
    assert!(world.finish(LIMIT, read).is_err() && world.application().engine().statistics(SubDeviceId(99)).is_none());
}

// covers: registers
#[test]
fn a_subdevice_blocked_in_a_ring_is_cut_off_alone_until_its_ports_open() {
    let mut world = in_ring(2);
    let mark = world.mark();
    let block = world.application_mut().engine_mut().start_block(SubDeviceId(2));
    let blocked = world.finish(LIMIT, block).expect("it has neighbours");
    assert_eq!(blocked.len(), 2);
    let gone = |world: &World| world.application().states()[2] == SubDeviceState::Absent;
    world.until(LIMIT, "cut off", gone);
    world.run_cycles(50);
    let states = world.application().states();
    assert!([0, 1, 3, 4].iter().all(|subdevice| states[*subdevice] == OP), "{states:?}");
    assert_eq!(world.left_op(mark), []);
    let open = world.application_mut().engine_mut().start_open_blocked();
    assert_eq!(world.finish(LIMIT, open), Ok(2));
    world.until(LIMIT, "back", |world| world.application().all_settled());
    world.recognise();
    world.run_cycles(50);
    assert!(world.all_in_op() && world.saw(mark, |event| *event == Event::Returned { subdevice: SubDeviceId(2) }));
    let open = world.application_mut().engine_mut().start_open_blocked();
    assert_eq!(world.finish(LIMIT, open), Ok(0));
    let block = world.application_mut().engine_mut().start_block(SubDeviceId(0));
    let error = world.finish(LIMIT, block).expect_err("it hangs on the link");
    assert!(error.to_string().contains("is connected to the main link"), "{error}");
}

// covers: 2.2, registers
#[test]
fn closing_a_port_cuts_off_subdevices_and_opening_restores_them() {
    let mut world = in_line(3);
    let set = |world: &mut World, control| {
        let set = world.application_mut().engine_mut().start_port_set(SubDeviceId(2), 1, control);
        assert_eq!(world.finish(LIMIT, set), Ok(()));
    };
    set(&mut world, LoopControl::Closed);
    let read = world.application_mut().engine_mut().start_port_read(SubDeviceId(2), 1);
    assert_eq!(world.finish(LIMIT, read), Ok(LoopControl::Closed));
    let gone = |world: &World| world.application().states()[3..] == [SubDeviceState::Absent; 2];
    world.until(LIMIT, "gone", gone);
    assert_eq!(world.application().states()[..3], [OP; 3]);
    set(&mut world, LoopControl::Auto);
    assert!(world.application_mut().engine_mut().force_topology_change());
    world.until(LIMIT, "back", |world| world.application().all_settled());
    // The same with the other method.
    let block = world.application_mut().engine_mut().start_block(SubDeviceId(3));
    assert_eq!(world.finish(LIMIT, block).map(|ports| ports.len()), Ok(1));
    world.until(LIMIT, "gone", gone);
    let open = world.application_mut().engine_mut().start_open_blocked();
    assert_eq!(world.finish(LIMIT, open), Ok(1));
    world.until(LIMIT, "back", |world| world.application().all_settled());
    let set = world.application_mut().engine_mut().start_port_set(SubDeviceId(2), 4, LoopControl::Auto);
    assert!(world.finish(LIMIT, set).expect_err("no such port").to_string().contains("only 0 to 3"));
}

// covers: 3.2, registers
#[test]
fn a_controller_reset_works_also_when_frames_are_lost() {
    for lost in [0, 1, 2, 3] {
        let mut world = in_ring(4);
        let starts = world.network().device(DeviceIndex(3)).controller.starts();
        let mark = world.mark();
        if lost > 0 {
            // Cyclic frames are among them.
            world.drop(CableId(3), lost);
            world.drop(CableId(4), lost);
        }
        let reset = world.application_mut().engine_mut().start_reset(SubDeviceId(3));
        assert_eq!(world.finish(LIMIT, reset), Ok(()), "{lost} frames lost");
        assert_eq!(world.network().device(DeviceIndex(3)).controller.starts(), starts + 1, "{lost} frames lost");
        world
            .until(LIMIT, "lost", |world| world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(3) }));
        world.until(LIMIT, "back", |world| world.application().all_settled());
        assert!(world.saw(mark, |event| *event == Event::Returned { subdevice: SubDeviceId(3) }));
        let others = world.left_op(mark).into_iter().filter(|device| *device != DeviceIndex(3)).count();
        assert_eq!(others, 0);
    }
}

// covers: own-datagrams
#[test]
fn datagrams_of_the_application_return_data_and_working_counter() {
    let mut world = in_ring(5);
    let station = StationAddress(world.station_of(1));
    let datagram = |command, target, data: &[u8]| RawDatagram::new(command, target, data.to_vec()).with_resend(true);
    let at = Target::Station(station, ringcat_wire::address::RegisterAddress(0x0F80));
    let datagrams = vec![
        datagram(Command::Brd, Target::Broadcast(map::TYPE), &[0]),
        datagram(Command::Fpwr, at, &[1, 2, 3, 4]),
        datagram(Command::Fprw, at, &[5, 6, 7, 8]),
        datagram(Command::Fprd, at, &[0; 4]),
        datagram(Command::Lrd, Target::Logical(LogicalAddress(0x7FFF_0000)), &[0; 8]),
        datagram(Command::Nop, Target::None, &[9; 3]),
    ];
    let sent = world.application().acyclic_counters().datagrams;
    let work = world.application_mut().engine_mut().start_datagrams(datagrams);
    let replies = world.finish(LIMIT, work).expect("not too many");
    let replies: Vec<_> = replies.into_iter().map(|reply| reply.expect("no frame was lost")).collect();
    let wkcs: Vec<_> = replies.iter().map(|reply| reply.wkc().0).collect();
    assert_eq!(wkcs, [5, 1, 3, 1, 0, 0]);
    assert_eq!((&replies[2].data, &replies[3].data), (&vec![1, 2, 3, 4], &vec![5, 6, 7, 8]));
    assert!(world.application().acyclic_counters().datagrams >= sent + 6);
    assert_eq!(replies[1].main, Wkc(1));
    let many = vec![datagram(Command::Nop, Target::None, &[0]); MAX_DATAGRAMS + 1];
    let work = world.application_mut().engine_mut().start_datagrams(many);
    assert!(world.finish(LIMIT, work).expect_err("too many").to_string().contains("at most 1024"));
    let long = vec![datagram(Command::Nop, Target::None, &[0; 1487])];
    let work = world.application_mut().engine_mut().start_datagrams(long);
    assert!(world.finish(LIMIT, work).expect("one").pop().expect("one").is_err());
}
