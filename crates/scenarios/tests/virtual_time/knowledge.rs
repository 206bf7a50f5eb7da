//! Knowledge that travels: another process goes on with a segment from bytes, without a scan, handed over in order or
//! after a crash (decision 0061).

mod bars;
mod bytes;
mod changes;
mod clocks;
mod crashes;
mod dictionaries;
mod frames;
mod mail;
mod pdos;
mod rounds;
mod under_way;

use std::time::Duration;

use ringcat::{
    Application, ClockConfig, Declaration, DomainId, Error, Event, Handover, JunctionMode, Knowledge, LastOutputs,
    MainDevice, Options, PdoSource, Position, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::segments::{MAIN, RING_BEHIND_JUNCTION, RING_IN_RING, at, descriptions, line, ring, wired};
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

/// Two with a mailbox, two with device emulation, two with neither.
const MIXED: [&str; 6] =
    ["servo", "digital-output-8", "emulated-output-8", "servo", "emulated-input-8", "digital-input-8"];
const PREOP: AlStatus = AlStatus::new(AlState::PreOp);
const OP: AlStatus = AlStatus::new(AlState::Op);
const HANDOVERS: [Handover; 2] = [Handover::Orderly, Handover::AfterCrash];
const LIMIT: Duration = Duration::from_secs(1);
/// Within this time a change is followed.
const FOLLOWED: Duration = Duration::from_millis(400);
/// An SDO that is not lost is answered within this time.
const ANSWERED: Duration = Duration::from_millis(20);

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&MIXED), options()), ring(descriptions(&MIXED), options())]
}

/// A line, a ring, a tree, a ring behind a junction, and a ring within a ring.
fn all_networks() -> Vec<Network> {
    use ringcat_sim::frame::Port::{A, B, C, D};
    let tree = [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(0, B), at(2, A)), (at(0, C), at(3, A))];
    let seven = ["digital-output-8", "junction", "servo", "digital-input-8", "block", "coupler", "analog-input-4"];
    let mut networks: Vec<Network> = networks().into();
    networks.push(wired(&["junction", "servo", "digital-input-8", "servo"], &tree));
    networks.push(wired(&seven, &RING_BEHIND_JUNCTION));
    networks.push(wired(&seven[..5], &RING_IN_RING));
    networks
}

fn options() -> Options {
    Options::default().with_idle_operation(true).with_junctions(JunctionMode::Automatic)
}

/// Works until all are in PREOP.
fn idle(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(Duration::from_secs(1));
    assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
    events(&mut main_device);
    main_device
}

/// Another process goes on.
fn resumed(links: Tap, bytes: &[u8], handover: Handover) -> MainDevice<Tap> {
    let knowledge = Knowledge::from_bytes(bytes).expect("they were written");
    let mut main_device = MainDevice::request(links, &options());
    main_device.resume(knowledge, handover).expect("the segment answers");
    main_device
}

fn to_bytes(main_device: &MainDevice<Tap>) -> Vec<u8> {
    main_device.knowledge().expect("it is scanned").to_bytes()
}

fn hand_over(main_device: MainDevice<Tap>, handover: Handover) -> MainDevice<Tap> {
    let bytes = to_bytes(&main_device);
    resumed(main_device.into_links(), &bytes, handover)
}

/// From now on a word that is read from an SII is wrong.
fn spoil_siis(main_device: &mut MainDevice<Tap>) {
    let network = main_device.links_mut().network_mut();
    let count = network.devices().len();
    (0..count).for_each(|at| network.device_mut(DeviceIndex(at)).controller.sii_image_mut().fill(0));
}

fn statuses(main_device: &mut MainDevice<Tap>) -> Vec<AlStatus> {
    main_device.links_mut().network().devices().map(|device| device.al_status()).collect()
}

fn events(main_device: &mut MainDevice<Tap>) -> Vec<Event> {
    std::iter::from_fn(|| main_device.pop_event()).map(|timed| timed.event).collect()
}

fn register(device: &Device, at: ringcat::RegisterAddress, length: usize) -> Vec<u8> {
    device.controller.register(at, length).to_vec()
}

/// Registers that a scan, or another MainDevice, would change: station address, alias, port control, SyncManagers,
/// offsets and delays of clocks.
fn kept_registers(main_device: &mut MainDevice<Tap>) -> Vec<Vec<u8>> {
    let of = |device: &Device| {
        let managers = 8 * usize::from(device.controller.config().sync_manager_count);
        let places = [(map::STATION_ADDRESS, 4), (map::DL_CONTROL, 4), (map::DC_SYSTEM_TIME_OFFSET, 8)];
        let more = [(map::DC_SYSTEM_TIME_DELAY, 4), (map::DC_SPEED_COUNTER_START, 2)];
        let mut bytes: Vec<u8> =
            places.into_iter().chain(more).flat_map(|(at, length)| register(device, at, length)).collect();
        // Status and repeat bits of mailboxes change.
        let managers = register(device, map::SYNC_MANAGER_BASE, managers);
        bytes.extend(managers.chunks(8).flat_map(|manager| manager[..5].to_vec()));
        bytes
    };
    main_device.links_mut().network().devices().map(of).collect()
}

/// Positions of SubDevices with SDOs.
fn with_objects(main_device: &MainDevice<Tap>) -> Vec<Position> {
    let with = |info: &ringcat::SubDeviceInfo| info.mailbox.is_some() && info.protocols.coe();
    main_device.subdevices().iter().filter(|info| with(info)).map(|info| info.position).collect()
}

/// Reads an object of each; an SDO whose mail is lost or dropped takes longer.
fn exchange_sdos(main_device: &mut MainDevice<Tap>) {
    for position in with_objects(main_device) {
        let begun = main_device.now();
        let vendor = main_device.subdevice(position).sdo_read::<u32>(0x1018, 1).expect("it answers");
        let took = main_device.now().since(begun);
        assert_eq!(vendor, main_device.subdevices()[usize::from(position.0)].identity.vendor_id);
        assert!(took < ANSWERED, "{position:?}: {took:?}");
    }
}

fn activate(main_device: MainDevice<Tap>) -> Application<Tap> {
    let declaration = automatic(&main_device.subdevices(), CYCLE);
    main_device.activate(declaration).map_err(Error::from).expect("it fits")
}

fn cycles(application: &mut Application<Tap>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

fn settle(application: &mut Application<Tap>) {
    let end = application.now() + Duration::from_secs(3);
    while !application.all_settled() {
        assert!(application.now() < end, "{:?}", application.states());
        application.cycle(|_| ());
    }
}

// covers: states
#[test]
fn a_known_segment_goes_on_without_a_scan() {
    for handover in HANDOVERS {
        for (number, network) in all_networks().into_iter().enumerate() {
            let mut former = idle(network);
            exchange_sdos(&mut former);
            spoil_siis(&mut former);
            let (mut known, kept) = (former.subdevices(), kept_registers(&mut former));
            let topology = former.knowledge().expect("it is scanned").topology;
            let mut main_device = hand_over(former, handover);
            if handover == Handover::AfterCrash {
                // Nothing is known of what the former owner has written since.
                known.iter_mut().for_each(|info| info.pdo_source = PdoSource::Outdated);
            }
            assert_eq!(main_device.subdevices(), known, "network {number}");
            assert_eq!(main_device.knowledge().expect("it is known").topology, topology);
            exchange_sdos(&mut main_device);
            for _ in 0..3_000 {
                main_device.attend(Duration::from_millis(1));
                assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
            }
            let count = known.len();
            let expected = Event::Resumed { subdevices: count, in_state: count, differs: false };
            assert_eq!(events(&mut main_device), [expected], "network {number}");
            assert_eq!(kept_registers(&mut main_device), kept);
            exchange_sdos(&mut main_device);
        }
    }
}

// covers: states
#[test]
fn a_declaration_is_activated_on_a_known_segment() {
    for handover in HANDOVERS {
        for network in all_networks() {
            let mut former = idle(network);
            spoil_siis(&mut former);
            let mut main_device = hand_over(former, handover);
            for _ in 0..2 {
                let mut application = activate(main_device);
                settle(&mut application);
                cycles(&mut application, 50);
                let status = application.process(DomainId(0));
                assert_eq!(status.wkc, status.expected);
                assert!(application.links().network().devices().all(|device| device.al_status() == OP));
                main_device = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                main_device = hand_over(main_device, handover);
                exchange_sdos(&mut main_device);
            }
        }
    }
}

// covers: states
#[test]
fn without_idle_operation_a_known_segment_stays_as_it_is() {
    for network in networks() {
        let mut former = MainDevice::request(Tap::new(network), &Options::default());
        let scan = former.scan().expect("it can be scanned");
        former.subdevice(Position(3)).request_state(AlState::PreOp).expect("it follows");
        spoil_siis(&mut former);
        let before = statuses(&mut former);
        let bytes = to_bytes(&former);
        let mut main_device = MainDevice::request(former.into_links(), &Options::default());
        let knowledge = Knowledge::from_bytes(&bytes).expect("they were written");
        let found = main_device.resume(knowledge, Handover::Orderly).expect("the segment answers");
        assert_eq!(found.subdevices, scan.subdevices);
        assert_eq!(statuses(&mut main_device), before);
        main_device.subdevice(Position(3)).sdo_read::<u32>(0x1018, 1).expect("its mailbox is in use");
        assert_eq!(statuses(&mut main_device), before);
        settle(&mut activate(main_device));
    }
}

// covers: states
#[test]
fn a_main_device_that_scans_or_is_active_does_not_go_on_with_other_knowledge() {
    let former = idle(networks().into_iter().next().expect("a line"));
    let knowledge = former.knowledge().expect("it is scanned");
    let mut application = activate(former);
    let refused = application.engine_mut().resume(knowledge.clone(), Handover::Orderly);
    assert!(refused.is_err());
    settle(&mut application);
    let mut main_device = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
    main_device.resume(knowledge, Handover::Orderly).expect("it is the segment");
    exchange_sdos(&mut main_device);
    let empty = MainDevice::request(main_device.into_links(), &options());
    assert!(empty.knowledge().is_none(), "nothing is known before a scan");
}

// covers: states, dc-lock
#[test]
fn offsets_of_clocks_stay_and_the_clocks_of_the_next_owner_lock() {
    for handover in HANDOVERS {
        for network in networks() {
            let mut main_device = idle(network);
            for round in 0..3 {
                let declaration = automatic(&main_device.subdevices(), CYCLE).with_clocks(ClockConfig::default());
                let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
                let end = application.now() + Duration::from_secs(10);
                while !(application.all_settled() && application.engine().clocks_locked()) {
                    assert!(application.now() < end, "round {round}: the clocks do not lock");
                    application.cycle(|_| ());
                }
                main_device = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                let kept = kept_registers(&mut main_device);
                let offset = |bytes: &Vec<u8>| bytes[8..16].iter().any(|byte| *byte != 0);
                assert!(kept.iter().any(offset), "offsets were written");
                main_device = hand_over(main_device, handover);
                main_device.attend(Duration::from_secs(1));
                assert_eq!(kept_registers(&mut main_device), kept);
            }
        }
    }
}

// covers: states
#[test]
fn states_that_were_requested_or_forced_travel() {
    for network in networks() {
        let mut former = idle(network);
        for (at, state) in [(0, AlState::Op), (1, AlState::Op), (3, AlState::SafeOp), (5, AlState::Init)] {
            former.subdevice(Position(at)).request_state(state).expect("it follows");
        }
        former.attend(FOLLOWED);
        let before = statuses(&mut former);
        let mut main_device = hand_over(former, Handover::Orderly);
        for _ in 0..1_000 {
            main_device.attend(Duration::from_millis(1));
            assert_eq!(statuses(&mut main_device), before, "outputs in OP are written in time");
        }
        exchange_sdos(&mut main_device);
        // After a crash it is not known what was requested since.
        let mut main_device = hand_over(main_device, Handover::AfterCrash);
        main_device.attend(FOLLOWED);
        assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
        exchange_sdos(&mut main_device);
        let declaration = Declaration::new(CYCLE);
        assert!(main_device.activate(declaration).is_ok());
    }
}
