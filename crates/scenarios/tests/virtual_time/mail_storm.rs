//! Random interleaving of protocols, losses, mail faults, cut cables, power cycles and BOOT, by seed: no response
//! reaches another request, all requests end in bounded time, and nothing remains in mailboxes, procedures and
//! datagrams. Besides the procedures, a request of the cyclic thread, a client of the gateway and a host with a
//! download through the Ethernet port use each device. The list of a drive contains a checksum, since discarded
//! fragments cannot be detected otherwise.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{ConfigureError, Event, Limits, SdoFailure, SubDeviceId, SubDeviceState};
use ringcat_engine::UnderWay;
use ringcat_engine::mail::eoe::EthernetPort;
use ringcat_engine::main_device::Pending;
use ringcat_sim::application::mailbox::faults::MailFault;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::foe::FoeErrorCode;
use ringcat_wire::mailbox::sdo::AbortCode;
use scenarios::dice::Dice;
use scenarios::ethernet_host::{Addresses, download};
use scenarios::loss::Loss;
use scenarios::mailbox_requests::{KINDS, Kind, Requester};
use scenarios::mailbox_users::MailboxUsers;
use scenarios::seeds;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

/// Responses later than twice this time cannot be distinguished from those to the next request in SoE, FoE and EoE
/// (decision 0007): no fault here delays a response that long.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(250));
const PLANT: [&str; 3] = ["all-protocols", "digital-input-8", "all-protocols"];
/// IP address of the first device; requests write that of the other one.
const DEVICE: [u8; 4] = [10, 0, 0, 2];
/// The devices with all protocols, and the addresses of their mailboxes.
const ALL: [usize; 2] = [0, 2];
const RECEIVE: u16 = 0x1000;
const SEND: u16 = 0x1400;
/// Number of faults in a run.
const HAPPENINGS: u32 = 12;
/// Bytes of a download through the Ethernet port of a device, and its time limit.
const DOWNLOAD: (usize, Duration) = (5_000, Duration::from_millis(120));
/// Cycles within which all transfers are idle once.
const QUIET: usize = 60;
/// Time limit of the requests under way after the last fault: several times three limits each.
const END: Duration = Duration::from_secs(5);

/// Sum of the results of all runs.
#[derive(Default)]
struct Tally {
    answered: Cell<u32>,
    failed: Cell<u32>,
    downloads: Cell<u32>,
    emergencies: Cell<u32>,
    /// Those of the cyclic thread and of the gateway among them.
    beside: Cell<u32>,
}

/// A random fault of a device's mail.
fn mail_fault(dice: &mut Dice) -> MailFault {
    let count = 1 + dice.below(3) as u32;
    match dice.below(10) {
        0 => MailFault::LoseAnswers { count },
        1 => MailFault::LoseRequests { count },
        2 => MailFault::RepeatAnswers { count },
        3 => MailFault::DelayAnswers { count, by: Duration::from_millis(dice.below(90)) },
        4 => MailFault::WrongCounter { count: 1, counter: dice.below(8) as u8 },
        5 => MailFault::EmergencyBefore { count, code: dice.roll() as u16 },
        6 => MailFault::Refuse { count, detail: *dice.pick(&[ErrorReply::NO_MORE_MEMORY, 0x08]) },
        7 => MailFault::AbortSdo { count, code: AbortCode::GENERAL },
        8 => MailFault::BusyFoe { count },
        _ => *dice.pick(&[
            MailFault::FailFoe { code: FoeErrorCode::DISK_FULL },
            MailFault::Full { during: Duration::from_millis(60) },
        ]),
    }
}

/// A random fault; cables and power are restored after a while.
fn happen(world: &mut World, beside: &mut MailboxUsers, dice: &mut Dice, emergencies: &mut BTreeMap<u16, u32>) {
    let device = *dice.pick(&ALL);
    let station = world.station_of(device);
    match dice.below(9) {
        0..=2 => {
            let fault = mail_fault(dice);
            if let MailFault::EmergencyBefore { count, code } = fault {
                *emergencies.entry(code).or_default() += count;
            }
            world.fault(Fault::Mail(DeviceIndex(device), fault));
        }
        3 | 4 => {
            let loss = if dice.one_in(2) { Loss::of_read(station, SEND) } else { Loss::of_write(station, RECEIVE) };
            let loss = if dice.one_in(2) { loss.on_the_way_back() } else { loss };
            world.lose(loss.times(1 + dice.below(4) as u32, dice.below(4) as u32));
        }
        5 | 6 => {
            let cable = CableId(dice.below(PLANT.len() as u64 + 1) as usize);
            world.cut(cable);
            beside.run_cycles(world, 1 + dice.below(20));
            world.heal(cable);
        }
        7 => {
            world.power_off(DeviceIndex(device));
            beside.run_cycles(world, 2 + dice.below(40));
            world.power_on(DeviceIndex(device));
        }
        // In BOOT it has another mailbox, which serves only files.
        _ => {
            change_state(world, beside, device, AlState::Boot);
            beside.run_cycles(world, 2 + dice.below(40));
            change_state(world, beside, device, AlState::Op);
        }
    }
}

/// Requests a state of a device, and waits for it while its users go on. A request that meets a device without power
/// fails, and the device reaches the state after its return. One that gets an injected abort, as the assignment of PDOs
/// may, fails and leaves the device where it was: it is made again.
fn change_state(world: &mut World, beside: &mut MailboxUsers, device: usize, state: AlState) {
    let mut request = world.application_mut().engine_mut().start_state_request(SubDeviceId(device), state);
    let until = world.application().now() + END;
    let mut result = None;
    while world.application().states()[device] != SubDeviceState::Settled(state) {
        assert!(world.application().now() < until, "device {device} does not reach {state:?}: {result:?}");
        beside.run_cycles(world, 1);
        result = result.or_else(|| request.take());
        if result.as_ref().is_some_and(is_injected_abort) {
            request = world.application_mut().engine_mut().start_state_request(SubDeviceId(device), state);
            result = None;
        }
    }
    if let Some(Err(error)) = result {
        assert!(!matches!(error, ConfigureError::State(_)), "device {device} refused {state:?}: {error}");
    }
}

fn is_injected_abort(result: &Result<(), ConfigureError>) -> bool {
    let Err(ConfigureError::Sdo(error)) = result else { return false };
    error.cause == SdoFailure::Aborted(AbortCode::GENERAL)
}

/// Sends requests of one kind, one after the other, until the stop; dropped ones are not counted.
fn start(world: &mut World, device: usize, at: usize, stop: &Rc<Cell<bool>>, tally: &Rc<Tally>) -> Pending<()> {
    let mailbox = world.mailbox(device);
    let bus = mailbox.bus().clone();
    let mut requester = Requester::new(KINDS[at], mailbox, LIMITS, true);
    let (stop, tally) = (stop.clone(), tally.clone());
    world.start(async move {
        // Numbers differ between devices, kinds and requests.
        let mut number = (device * 16 + at) as u32;
        while !stop.get() {
            number += 64;
            let count = if requester.ask(number).await.is_ok() { &tally.answered } else { &tally.failed };
            count.set(count.get() + 1);
            bus.sleep(Duration::from_micros(300)).await;
        }
    })
}

/// Downloads through the Ethernet port of a device, one after the other. An interrupted download is not a failure,
/// wrong bytes are.
fn start_downloads(world: &mut World, device: usize, stop: &Rc<Cell<bool>>, tally: &Rc<Tally>) -> Pending<()> {
    let (mailbox, stop, tally) = (world.mailbox(device), stop.clone(), tally.clone());
    let addresses = Addresses { mac: [2, 0, 0, 0, 0, 9], host: [10, 0, 0, 1], device: DEVICE };
    world.start(async move {
        let port = EthernetPort::open(&mailbox).expect("the port is free");
        while !stop.get() {
            match download(mailbox.bus().clone(), &port, addresses, DOWNLOAD.0, DOWNLOAD.1).await {
                Ok(_) => tally.downloads.set(tally.downloads.get() + 1),
                Err(error) => assert!(!error.contains("not what was sent"), "{error}"),
            }
            mailbox.bus().sleep(Duration::from_millis(1)).await;
        }
    })
}

/// The minimum of transfers under way within some cycles.
fn quiet_moment(world: &mut World) -> UnderWay {
    let loads = (0..QUIET).map(|_| {
        world.cycle();
        world.application().engine().under_way()
    });
    loads.min_by_key(|load| (load.procedures, load.datagrams)).expect("some cycles")
}

fn run(seed: u64, tally: &Rc<Tally>) {
    let mut dice = Dice::new(seed);
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10 + dice.below(2000)));
    let mut plant = descriptions(&PLANT);
    plant[ALL[0]].services.eoe.address = Some(DEVICE.into());
    plant[ALL[0]].services.eoe.mask = Some([255, 255, 255, 0].into());
    let mut world = World::in_op(seed, ring(plant, options));
    world.evaluate_latched(false);
    let before = quiet_moment(&mut world);
    let stop = Rc::new(Cell::new(false));
    let mut works = Vec::new();
    let mut beside = MailboxUsers::new(&mut world, &ALL);
    let mut emergencies = BTreeMap::new();
    for device in ALL {
        // About five of the nine kinds, none twice.
        for at in (0..KINDS.len()).filter(|_| !dice.one_in(3)) {
            // The download needs its address.
            if device != ALL[0] || KINDS[at] != Kind::Address {
                works.push(start(&mut world, device, at, &stop, tally));
            }
        }
    }
    works.push(start_downloads(&mut world, ALL[0], &stop, tally));
    for _ in 0..HAPPENINGS {
        beside.run_cycles(&mut world, 2 + dice.below(12));
        happen(&mut world, &mut beside, &mut dice, &mut emergencies);
        // Drops a procedure at a random moment.
        if dice.one_in(4) && works.len() > 2 {
            drop(works.swap_remove(dice.below(works.len() as u64) as usize));
        }
    }
    for device in ALL {
        world.fault(Fault::Mail(DeviceIndex(device), MailFault::Heal));
    }
    stop.set(true);
    for work in works {
        world.finish(END, work);
    }
    world.settle();
    end(&mut beside, &mut world, seed);
    tally.answered.set(tally.answered.get() + beside.answered);
    tally.failed.set(tally.failed.get() + beside.failed);
    tally.beside.set(tally.beside.get() + beside.answered + beside.failed);
    // An error reply does not identify its request (decision 0007): a delayed one would end the first new request.
    world.run_cycles(100);
    // A remaining injected loss would affect the next frame.
    all_answer(&mut world, seed);
    world.run_cycles(90);
    let after = quiet_moment(&mut world);
    assert!(
        after.procedures <= before.procedures && after.datagrams <= before.datagrams,
        "seed {seed}: {before:?} {after:?}"
    );
    each_emergency_came_once(&world, seed, emergencies, tally);
    mailboxes_are_idle(&mut world, seed);
}

/// Ends the other users.
fn end(beside: &mut MailboxUsers, world: &mut World, seed: u64) {
    let until = world.application().now() + END;
    while !beside.stop(world) {
        assert!(world.application().now() < until, "seed {seed}: {beside:?}");
        world.cycle();
    }
}

/// Every device responds to every kind of request that it supports.
fn all_answer(world: &mut World, seed: u64) {
    for (device, kind) in ALL.into_iter().flat_map(|device| KINDS.map(|kind| (device, kind))) {
        if (device, kind) == (ALL[0], Kind::Address) {
            continue;
        }
        let mut requester = Requester::new(kind, world.mailbox(device), ringcat::Limits::new(END, END), true);
        let result = world.run(async move { requester.ask(0xFFFF).await });
        assert_eq!(result, Ok(()), "seed {seed}, device {device}, {kind:?}");
    }
}

/// Each injected emergency arrived once.
fn each_emergency_came_once(world: &World, seed: u64, mut left_of: BTreeMap<u16, u32>, tally: &Tally) {
    for event in world.events(world.beginning()) {
        if let Event::Emergency { emergency, .. } = event.event {
            tally.emergencies.set(tally.emergencies.get() + 1);
            let left = left_of.get_mut(&emergency.error_code).expect("sent on purpose");
            assert!(*left > 0, "seed {seed}: {:#06x} came twice", emergency.error_code);
            *left -= 1;
        }
    }
}

fn mailboxes_are_idle(world: &mut World, seed: u64) {
    for device in ALL {
        let mailbox = world.mailbox(device);
        let counters = mailbox.counters();
        // A mailbox that is being polled is not idle.
        let is_idle = (0..QUIET).any(|_| {
            world.cycle();
            mailbox.is_idle()
        });
        assert!(is_idle, "seed {seed}, device {device}: {counters:?}");
        assert_eq!((counters.malformed, counters.refused), (0, 0), "seed {seed}, device {device}");
    }
    assert_eq!(world.application().acyclic_counters().mails_dropped, 0, "seed {seed}");
}

// covers: mailbox-faults
#[test]
fn each_response_finds_its_request_and_no_mail_remains() {
    let tally = Rc::new(Tally::default());
    let seeds = seeds::from_environment().unwrap_or(0..30);
    let runs = (seeds.end - seeds.start) as u32;
    seeds.for_each(|seed| run(seed, &tally));
    let (answered, failed, downloads) = (tally.answered.get(), tally.failed.get(), tally.downloads.get());
    let (beside, emergencies) = (tally.beside.get(), tally.emergencies.get());
    println!("{runs} runs: {answered} questions answered, {failed} failed, {beside} of them beside procedures");
    println!("{downloads} downloads, {emergencies} emergencies");
    if runs < 30 {
        // A few selected seeds are not representative.
        return;
    }
    assert!(answered > 20 * runs && failed > runs && beside > 20 * runs, "{answered} answered, {failed} failed");
    assert!(downloads > runs / 3 && emergencies > runs / 10, "{downloads} downloads, {emergencies} emergencies");
}
