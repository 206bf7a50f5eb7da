//! The merged result of a broken ring equals that of a closed ring (protocol 9.3): random trees with a ring through
//! them, junctions and branches on any port, crossed SubDevices, random breaks of the ring, all commands. CR-05, CR-09.

use std::time::Duration;

use ringcat::RawDatagram;
use ringcat_engine::Reply;
use ringcat_sim::cable::CableId;
use ringcat_sim::device::Device;
use ringcat_sim::frame::Port;
use ringcat_sim::network::Network;
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{Fmmu, map};
use scenarios::dice::Dice;
use scenarios::segments::{MAIN, REDUNDANT, at, wired};
use scenarios::world::World;

/// Unused RAM of the controller.
const USER_RAM: u16 = 0x0F80;
/// Bytes of this RAM.
const RAM: usize = 80;
/// Logical address of random commands, away from process data.
const LOGICAL: u32 = 0x7000_0000;
/// Bytes that each SubDevice maps there.
const MAPPED: u16 = 4;

/// A tree with a path through it from MAIN to RED.
struct Segment {
    network: Network,
    /// The cables of the path.
    trunk: Vec<CableId>,
    /// A branch is behind the port from which the path continues, or a SubDevice is crossed: a break changes the
    /// processing order (CR-09).
    reordered: bool,
}

/// First the trunk, then branches on free ports.
fn segment(dice: &mut Dice) -> Segment {
    let trunk = 2 + dice.below(6) as usize;
    let total = trunk + dice.below(6) as usize;
    // In processing order.
    let mut free: Vec<Vec<Port>> = vec![vec![Port::D, Port::B, Port::C]; total];
    let mut behind: Vec<Vec<Port>> = vec![Vec::new(); total];
    let mut cables = Vec::new();
    let mut end = MAIN;
    let in_order = dice.one_in(3);
    let mut reordered = false;
    for (device, ports) in free.iter_mut().enumerate().take(trunk) {
        // The ring continues from any port of a junction.
        let way_on = if in_order { ports.len() - 1 } else { dice.below(ports.len() as u64) as usize };
        behind[device] = ports[way_on + 1..].to_vec();
        let mut ends = [at(device, Port::A), at(device, ports.remove(way_on))];
        if !in_order && dice.one_in(4) {
            ends.reverse();
            reordered = true;
        }
        cables.push((end, ends[0]));
        end = ends[1];
    }
    cables.push((end, REDUNDANT));
    for device in trunk..total {
        let parents: Vec<usize> = (0..device).filter(|parent| !free[*parent].is_empty()).collect();
        let parent = *dice.pick(&parents);
        let port = dice.below(free[parent].len() as u64) as usize;
        let port = free[parent].swap_remove(port);
        reordered |= behind[parent].contains(&port);
        cables.push((at(parent, port), at(device, Port::A)));
    }
    let network = wired(&vec!["junction"; total], &cables);
    Segment { network, trunk: (0..=trunk).map(CableId).collect(), reordered }
}

/// A datagram to be sent.
#[derive(Clone, Debug)]
struct Random {
    command: Command,
    target: Target,
    data: Vec<u8>,
}

impl Random {
    /// SubDevices write the present data of the datagram, which depends on the SubDevices before them.
    fn depends_on_the_way(&self) -> bool {
        matches!(self.command, Command::Brw | Command::Armw | Command::Frmw)
    }
}

fn random(dice: &mut Dice, stations: &[u16]) -> Random {
    let station = StationAddress(*dice.pick(stations));
    let position = Position(dice.below(stations.len() as u64) as u16);
    let ram = RegisterAddress(USER_RAM + dice.below(64) as u16);
    // Registers that do not depend on the place of a break.
    let constant = RegisterAddress(*dice.pick(&[0x0000, 0x0010, 0x0130, 0x0600, 0x0800, USER_RAM]));
    let logical = Target::Logical(LogicalAddress(LOGICAL + dice.below(40) as u32));
    // Of one SubDevice (protocol 9.2.2).
    let area = Target::Logical(LogicalAddress(LOGICAL + u32::from(MAPPED) * dice.below(stations.len() as u64) as u32));
    let commands = [
        (Command::Brd, Target::Broadcast(constant)),
        (Command::Bwr, Target::Broadcast(ram)),
        (Command::Brw, Target::Broadcast(ram)),
        (Command::Fprd, Target::Station(station, constant)),
        (Command::Fpwr, Target::Station(station, ram)),
        (Command::Fprw, Target::Station(station, ram)),
        (Command::Frmw, Target::Station(station, ram)),
        (Command::Lrd, logical),
        (Command::Lwr, logical),
        (Command::Lrw, area),
        (Command::Nop, Target::None),
        (Command::Aprd, Target::Position(position, constant)),
        (Command::Apwr, Target::Position(position, ram)),
        (Command::Aprw, Target::Position(position, ram)),
        (Command::Armw, Target::Position(position, ram)),
    ];
    let (command, target) = *dice.pick(&commands);
    let longest = if command == Command::Lrw { MAPPED.into() } else { 16 };
    let length = 1 + dice.below(longest) as u16;
    // Reads are sent as zeros (protocol 9.3).
    let reads = matches!(command, Command::Aprd | Command::Brd | Command::Fprd | Command::Lrd | Command::Nop);
    let data = (0..length).map(|_| if reads { 0 } else { dice.below(256) as u8 }).collect();
    Random { command, target, data }
}

fn send(world: &mut World, datagram: Random) -> Reply {
    let bus = world.application().engine().bus();
    let Random { command, target, data } = datagram;
    if matches!(target, Target::Position(..)) {
        // Only datagrams of the application use the positions of the scan.
        let resend = command == Command::Armw;
        let datagram = RawDatagram::new(command, target, data).with_resend(resend);
        let work = world.application_mut().engine_mut().start_datagrams(vec![datagram]);
        let replies = world.finish(Duration::from_secs(1), work).expect("one is not too many");
        return replies.into_iter().next().expect("one answer").expect("it comes back");
    }
    // One copy is enough for datagrams that must not be repeated: read 1, write 2. ARMW and FRMW count 1 per SubDevice.
    let all = world.network().devices().len() as u16;
    let expected = match command {
        Command::Fprw | Command::Lrw => Some(Wkc(3)),
        Command::Brw => Some(Wkc(3 * all)),
        Command::Frmw => Some(Wkc(all)),
        _ => None,
    };
    world.run(async move { bus.transfer(command, target, data, expected).await.expect("it comes back") })
}

/// Maps four bytes of user RAM of each SubDevice to consecutive logical addresses.
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

/// The RAM of all devices.
fn memories(world: &World) -> Vec<Vec<u8>> {
    let ram = |device: &Device| device.controller.register(RegisterAddress(USER_RAM), RAM).to_vec();
    world.network().devices().map(ram).collect()
}

/// Sends a datagram in both worlds; both replies and both segments must be equal afterwards.
fn compare(worlds: &mut [World; 2], datagram: Random, what: &str) {
    let [got, expected] = worlds.each_mut().map(|world| send(world, datagram.clone()));
    assert_eq!((&got.data, got.wkc()), (&expected.data, expected.wkc()), "{what}: {datagram:?}");
    if datagram.depends_on_the_way() {
        let target = Target::Broadcast(RegisterAddress(USER_RAM));
        for world in worlds.iter_mut() {
            send(world, Random { command: Command::Bwr, target, data: vec![0x5A; RAM] });
        }
    }
    let [split, whole] = worlds.each_ref().map(memories);
    assert_eq!(split, whole, "{what}: what they hold after {datagram:?}");
}

/// The data of the addressed SubDevice is sent with FRMW or ARMW: all SubDevices receive it, also on the other side of
/// a break.
fn distribute(worlds: &mut [World; 2], dice: &mut Dice, stations: &[u16], what: &str) {
    let (station, ram) = (StationAddress(*dice.pick(stations)), RegisterAddress(USER_RAM + dice.below(64) as u16));
    let own: Vec<u8> = (0..4).map(|_| dice.below(256) as u8).collect();
    let target = Target::Station(station, ram);
    compare(worlds, Random { command: Command::Fpwr, target, data: own.clone() }, what);
    let replies =
        worlds.each_mut().map(|world| send(world, Random { command: Command::Frmw, target, data: own.clone() }));
    assert!(replies.iter().all(|reply| reply.data == own && usize::from(reply.wkc().0) == stations.len()), "{what}");
    let [split, whole] = worlds.each_ref().map(memories);
    assert_eq!(split, whole, "{what}: FRMW of what {station} has");
}

/// Returns the number of compared datagrams, of those addressed by position, and of those with a changed order of
/// SubDevices among them.
fn run(seed: u64) -> [usize; 3] {
    let mut dice = Dice::new(seed);
    let Segment { network, trunk, reordered } = segment(&mut dice);
    let twin = segment(&mut Dice::new(seed)).network;
    let mut worlds = [network, twin].map(|network| World::in_op(seed, network));
    let count = worlds[0].network().devices().len();
    let stations: Vec<u16> = (0..count).map(|device| worlds[0].station_of(device)).collect();
    for world in &mut worlds {
        map_ram(world, &stations);
    }
    let [mut compared, mut by_position] = [0; 2];
    for _ in 0..3 {
        let cable = *dice.pick(&trunk);
        worlds[0].cut(cable);
        worlds[0].run_cycles(8);
        let what = format!("seed {seed}, {cable:?}");
        for _ in 0..25 {
            let datagram = random(&mut dice, &stations);
            by_position += usize::from(matches!(datagram.target, Target::Position(..)));
            compare(&mut worlds, datagram, &what);
            compared += 1;
        }
        distribute(&mut worlds, &mut dice, &stations, &what);
        worlds[0].heal(cable);
        worlds[0].run_cycles(30);
    }
    [compared, by_position, if reordered { by_position } else { 0 }]
}

// covers: CR-05, CR-09, CR-10, 9.3, ring-equals-line, sim-frames
#[test]
fn a_broken_ring_responds_like_a_closed_one_seeds_0_to_59() {
    let mut counts = [0; 3];
    for seed in 0..60 {
        counts.iter_mut().zip(run(seed)).for_each(|(count, more)| *count += more);
    }
    let [compared, by_position, reordered] = counts;
    println!("{compared} datagrams of all commands answered alike, {by_position} of them addressed by position,");
    println!("{reordered} of these where a break changes the order in which SubDevices are met");
    assert!(compared == 60 * 75 && by_position > 1000 && reordered > 500, "{counts:?}");
}
