//! The wire is shared fairly between SubDevices, and the byte budget of the acyclic half holds in every cycle.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{Options, RawDatagram, automatic};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::Bytes;
use ringcat_engine::mail::{Limits, Mailbox};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const LIMITS: Limits = Limits::new(Duration::from_secs(5), Duration::from_secs(5));
const BUDGET: usize = 4_000;
/// SubDevices with objects, followed by one with files.
const DRIVES: usize = 50;
const FILES: usize = DRIVES + 1;
const CYCLES: u64 = 250;

fn world(seed: u64) -> World {
    let mut kinds = vec!["coupler"];
    kinds.extend(["servo"; DRIVES]);
    kinds.push("all-protocols");
    let options = Options::default().with_acyclic_bytes(BUDGET);
    let network = line(descriptions(&kinds), NetworkOptions::default());
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
    let mut world = World::with(seed, network, &options, declare).expect("activation");
    world.settle();
    world
}

/// Reads objects one after the other, and counts.
async fn read_on(mailbox: Mailbox, count: Rc<Cell<u32>>) {
    let object = SdoAddress::new(0x1018, 1);
    while coe::read(&mailbox, object, LIMITS, 4).await.is_ok() {
        count.set(count.get() + 1);
    }
}

/// Completed SDOs per drive with continuous requests, and the maximum bytes of the acyclic half in a cycle.
fn answered(world: &mut World) -> (Vec<u32>, u64) {
    let counts: Vec<Rc<Cell<u32>>> = (0..DRIVES).map(|_| Rc::default()).collect();
    let drives: Vec<_> = (1..=DRIVES).map(|drive| world.mailbox(drive)).collect();
    let work: Vec<_> =
        drives.into_iter().zip(&counts).map(|(mailbox, count)| world.start(read_on(mailbox, count.clone()))).collect();
    // All have begun.
    world.run_cycles(30);
    counts.iter().for_each(|count| count.set(0));
    let mut most = 0;
    for _ in 0..CYCLES {
        let before = world.application().acyclic_counters().bytes;
        world.cycle();
        most = most.max(world.application().acyclic_counters().bytes - before);
    }
    drop(work);
    (counts.iter().map(|count| count.get()).collect(), most)
}

/// Completed SDOs per drive alone, and beside a file and a flood of datagrams, from some number of cycles on.
fn alone_and_beside(begin: u64) -> [Vec<u32>; 2] {
    let mut world = world(1);
    world.run_cycles(begin);
    let (alone, most) = answered(&mut world);
    assert!(most <= BUDGET as u64, "{most} bytes in a cycle");
    let least = *alone.iter().min().expect("fifty");
    assert!(least as usize * DRIVES * 10 >= alone.iter().sum::<u32>() as usize * 9, "equal requests: {alone:?}");
    // The requests exceed the budget.
    assert!(least >= 20 && most > BUDGET as u64 * 9 / 10, "{least} answers, {most} bytes in a cycle");
    let mailbox = world.mailbox(FILES);
    let file = world.start(async move {
        let options = FoeOptions::default().with_limits(LIMITS);
        let mut packets = 0;
        foe::write(&mailbox, "recipe", options, &mut Bytes::new(&[7; 1 << 20]), |_| packets += 1).await.map(drop)
    });
    // 1,024 datagrams of 400 bytes to the first one.
    let station = StationAddress(world.station_of(0));
    let read =
        RawDatagram::new(Command::Fprd, Target::Station(station, RegisterAddress(0)), vec![0; 388]).with_resend(true);
    let flood = world.application_mut().engine_mut().start_datagrams(vec![read; 1024]);
    let (beside, most) = answered(&mut world);
    assert!(most <= BUDGET as u64, "{most} bytes in a cycle");
    assert!(flood.is_running(), "it takes longer than that");
    drop((file, flood));
    assert!(world.all_in_op());
    [alone, beside]
}

/// The share of a single drive in a short time depends on the moment at which all begin, so several are added.
// covers: byte-budget
#[test]
fn a_file_and_a_datagram_flood_leave_others_their_share_of_the_budget() {
    let [mut alone, mut beside] = [vec![0; DRIVES], vec![0; DRIVES]];
    for begin in [0, 1, 2, 3, 5, 11] {
        let [one, other] = alone_and_beside(begin);
        let [all_alone, all] = [&one, &other].map(|counts| counts.iter().sum::<u32>());
        assert!(all * 100 >= all_alone * 84, "from cycle {begin}: {one:?} {other:?}");
        alone.iter_mut().zip(one).for_each(|(sum, count)| *sum += count);
        beside.iter_mut().zip(other).for_each(|(sum, count)| *sum += count);
    }
    let [least, fewest] = [&alone, &beside].map(|counts| *counts.iter().min().expect("fifty"));
    let [all_alone, all] = [&alone, &beside].map(|counts| counts.iter().sum::<u32>());
    println!("{all_alone} SDOs alone, {all} beside a file and a flood; at least {least} and {fewest} per drive");
    // Each drive would keep 50/52 of its throughput if it always had a datagram waiting. While all drives wait for
    // responses, the others use the rest of the budget.
    assert!(fewest * 100 >= least * 82, "{alone:?} {beside:?}");
}
