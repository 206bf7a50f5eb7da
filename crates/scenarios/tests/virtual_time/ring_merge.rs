//! The merged result of a split ring is that of the unsplit one (facts 9.3): random trees with a ring through them,
//! junctions and branches on any port, random breaks of the ring, random commands. CR-05.

use std::time::Duration;

use ringcat_engine::supervisor::Reply;
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{Fmmu, map};
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, devices};
use scenarios::world::World;

/// RAM of the controller that nobody uses.
const USER_RAM: u16 = 0x0F80;
/// Where random logical commands go: far from process data.
const LOGICAL: u32 = 0x7000_0000;
/// Bytes that each SubDevice maps there.
const MAPPED: u16 = 4;

/// A tree with a way through it from MAIN to RED: first the trunk, then branches on free ports. Returns the cables of the
/// trunk.
fn segment(dice: &mut Dice) -> (Network, Vec<CableId>) {
    let trunk = 2 + dice.below(6) as usize;
    let total = trunk + dice.below(6) as usize;
    let mut free: Vec<Vec<Port>> = vec![vec![Port::B, Port::C, Port::D]; total];
    let mut cables = Vec::new();
    let at = |device: usize, port: Port| Endpoint::Device(DeviceIndex(device), port);
    let mut end = Endpoint::Host(HostLink::Main);
    for (device, ports) in free.iter_mut().enumerate().take(trunk) {
        cables.push((end, at(device, Port::A)));
        // The ring goes on through any port of a junction.
        let way_on = dice.below(ports.len() as u64) as usize;
        end = at(device, ports.swap_remove(way_on));
    }
    cables.push((end, Endpoint::Host(HostLink::Redundant)));
    for device in trunk..total {
        let parents: Vec<usize> = (0..device).filter(|parent| !free[*parent].is_empty()).collect();
        let parent = *dice.pick(&parents);
        let port = dice.below(free[parent].len() as u64) as usize;
        cables.push((at(parent, free[parent].swap_remove(port)), at(device, Port::A)));
    }
    let kinds = vec!["junction"; total];
    let builder = devices(descriptions(&kinds)).into_iter().fold(SegmentBuilder::new(), SegmentBuilder::device);
    let builder = cables.iter().fold(builder, |builder, (a, b)| builder.cable(*a, *b));
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    (builder.options(options).build().expect("a tree can be built"), (0..=trunk).map(CableId).collect())
}

/// A datagram to be sent.
#[derive(Clone, Debug)]
struct Random {
    command: Command,
    target: Target,
    data: Vec<u8>,
}

fn random(dice: &mut Dice, stations: &[u16]) -> Random {
    let station = StationAddress(*dice.pick(stations));
    let length = 1 + dice.below(16) as u16;
    let ram = RegisterAddress(USER_RAM + dice.below(64) as u16);
    // Registers that say the same wherever a break is.
    let constant = RegisterAddress(*dice.pick(&[0x0000, 0x0010, 0x0130, 0x0600, 0x0800, USER_RAM]));
    let logical = Target::Logical(LogicalAddress(LOGICAL + dice.below(40) as u32));
    let (command, target) = *dice.pick(&[
        (Command::Brd, Target::Broadcast(constant)),
        (Command::Bwr, Target::Broadcast(ram)),
        (Command::Fprd, Target::Station(station, constant)),
        (Command::Fpwr, Target::Station(station, ram)),
        (Command::Fprw, Target::Station(station, ram)),
        (Command::Lrd, logical),
        (Command::Lwr, logical),
        (Command::Nop, Target::None),
    ]);
    // Reads leave as zeros (facts 9.3).
    let reads = matches!(command, Command::Brd | Command::Fprd | Command::Lrd | Command::Nop);
    let data = (0..length).map(|_| if reads { 0 } else { dice.below(256) as u8 }).collect();
    Random { command, target, data }
}

fn send(world: &mut World, datagram: Random) -> Reply {
    let bus = world.application().engine().bus();
    let Random { command, target, data } = datagram;
    // One copy is enough for what must not travel twice: read 1, write 2.
    let expected = (command == Command::Fprw).then_some(Wkc(3));
    world.run(async move { bus.transfer(command, target, data, expected).await.expect("it comes back") })
}

/// Maps four bytes of user RAM of each SubDevice to the logical addresses, one behind the other.
fn map_ram(world: &mut World, stations: &[u16]) {
    let bus = world.application().engine().bus();
    let stations = stations.to_vec();
    world.run(async move {
        for (number, station) in (0..).zip(stations) {
            let fmmu = Fmmu {
                logical_start: LogicalAddress(LOGICAL + number * u32::from(MAPPED)),
                length: MAPPED,
                logical_start_bit: 0,
                logical_stop_bit: 7,
                physical_start: USER_RAM,
                physical_start_bit: 0,
                read: true,
                write: true,
                active: true,
                ..Fmmu::default()
            };
            bus.fpwr(StationAddress(station), map::fmmu(7), &fmmu.encode()).await.expect("it has eight FMMUs");
        }
    });
}

fn run(seed: u64) -> usize {
    let mut dice = Dice::new(seed);
    let (network, trunk) = segment(&mut dice);
    let (twin, _) = segment(&mut Dice::new(seed));
    let [mut split, mut whole] = [network, twin].map(|network| World::in_op(seed, network));
    let count = split.network().devices().len();
    let stations: Vec<u16> = (0..count).map(|device| split.station_of(device)).collect();
    for world in [&mut split, &mut whole] {
        map_ram(world, &stations);
    }
    let mut compared = 0;
    for _ in 0..3 {
        let cable = *dice.pick(&trunk);
        split.cut(cable);
        split.run_cycles(8);
        for _ in 0..25 {
            let datagram = random(&mut dice, &stations);
            let [got, expected] = [&mut split, &mut whole].map(|world| send(world, datagram.clone()));
            assert_eq!(
                (&got.data, got.wkc()),
                (&expected.data, expected.wkc()),
                "seed {seed}, {cable:?}: {datagram:?}"
            );
            compared += 1;
        }
        for device in (0..count).map(DeviceIndex) {
            let ram = |world: &World| {
                world.network().device(device).controller.register(RegisterAddress(USER_RAM), 64).to_vec()
            };
            assert_eq!(ram(&split), ram(&whole), "seed {seed}: what {device:?} holds");
        }
        split.heal(cable);
        split.run_cycles(30);
    }
    compared
}

#[test]
fn a_split_ring_answers_like_the_whole_one_seeds_0_to_59_cr_05_facts_9_3() {
    let compared: usize = (0..60).map(run).sum();
    assert_eq!(compared, 60 * 75);
}
