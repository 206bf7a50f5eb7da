//! Ethernet and gateway clients of SubDevices without a declaration: in idle operation, beside an application, and
//! across the beginning and the end of one.

use std::time::Duration;

use ringcat::{
    Address, Application, Declaration, DomainId, Error, LastOutputs, MainDevice, Options, Position, SubDeviceConfig,
    SubDeviceId,
};
use ringcat_engine::main_device::{EthernetSubDevice, MainDevice as Engine};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::{DeviceDescription, EoeEnd};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::mailbox::sdo::{SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Header, Message, Protocol, gateway};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

const KINDS: [&str; 5] = ["coupler", "ethernet-terminal", "digital-output-8", "all-protocols", "servo"];
/// Devices with EoE.
const TERMINAL: u16 = 1;
const ALL: u16 = 3;
const SERVO: u16 = 4;
const FOLLOWED: Duration = Duration::from_millis(400);
const LIMIT: Duration = Duration::from_secs(1);
const CLIENT: u64 = 7;
const FRAME: [u8; 600] = [0xA5; 600];

fn segment() -> Vec<DeviceDescription> {
    let mut segment = descriptions(&KINDS);
    for device in [TERMINAL, ALL] {
        segment[usize::from(device)].services.eoe.end = EoeEnd::Loop;
    }
    segment
}

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(segment(), options()), ring(segment(), options())]
}

fn idle(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
    main_device.attend(FOLLOWED);
    main_device
}

fn activate(main_device: MainDevice<Tap>, declared: &[u16]) -> Application<Tap> {
    let found = main_device.subdevices();
    let mut declaration = Declaration::new(CYCLE);
    for at in declared {
        declaration.add(SubDeviceConfig::from_info(&found[usize::from(*at)]));
    }
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    (0..500).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled(), "{:?}", application.states());
    application
}

/// The engine, and time that passes.
trait Bench {
    fn ask<T: Send + 'static>(&mut self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T;
    fn pass(&mut self, ms: u64);
    fn station(&mut self, device: u16) -> u16;
}

fn station(network: &Network, device: u16) -> u16 {
    let bytes = network.device(DeviceIndex(device.into())).controller.register(map::STATION_ADDRESS, 2);
    u16::from_le_bytes([bytes[0], bytes[1]])
}

impl Bench for MainDevice<Tap> {
    fn ask<T: Send + 'static>(&mut self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(self.engine_mut())
    }

    fn pass(&mut self, ms: u64) {
        self.attend(Duration::from_millis(ms));
    }

    fn station(&mut self, device: u16) -> u16 {
        station(self.links_mut().network(), device)
    }
}

impl Bench for Application<Tap> {
    fn ask<T: Send + 'static>(&mut self, act: impl FnOnce(&mut Engine) -> T + Send + 'static) -> T {
        act(self.engine_mut())
    }

    fn pass(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.cycle(|_| ()));
    }

    fn station(&mut self, device: u16) -> u16 {
        station(self.links().network(), device)
    }
}

/// Sends frames through the Ethernet of a SubDevice until all are back.
fn frames_return(bench: &mut impl Bench, subdevice: Address) {
    let send = move |engine: &mut Engine| {
        let port = engine.ethernet_port(subdevice).expect("it has a port");
        (0..8).for_each(|_| port.send(&FRAME).expect("it is up"));
    };
    bench.ask(send);
    bench.pass(200);
    let back = bench.ask(move |engine| {
        let port = engine.ethernet_port(subdevice).expect("it has a port");
        std::iter::from_fn(|| port.pop_frame()).map(|frame| frame.bytes).collect::<Vec<_>>()
    });
    assert_eq!(back, vec![FRAME.to_vec(); 8], "{subdevice}");
}

fn ethernet(bench: &mut impl Bench) -> Vec<EthernetSubDevice> {
    bench.ask(|engine| engine.ethernet_subdevices())
}

/// Vendor of a SubDevice, as a client of the gateway reads it.
fn vendor_by_gateway(bench: &mut impl Bench, device: u16) -> Option<Vec<u8>> {
    let request = SdoRequest::Upload { index: 0x1018, sub_index: 1, complete_access: false };
    let mut payload = [0; 16];
    let length = request.encode(&mut payload).expect("it fits");
    let header = Header { address: bench.station(device), ..Header::new(Protocol::Coe, 3, length as u16) };
    let mut bytes = [0; 32];
    let length = gateway::encode(&Message { header, payload: &payload[..length] }, &mut bytes).expect("it fits");
    bench.ask(move |engine| engine.relay(CLIENT, &bytes[..length]));
    for _ in 0..100 {
        bench.pass(1);
        if let Some(relayed) = bench.ask(|engine| engine.pop_relayed()) {
            let Message { header, payload } = gateway::decode(&relayed.bytes).expect("a message");
            return match (header.protocol, SdoResponse::decode(payload)) {
                (Protocol::Coe, Ok(SdoResponse::UploadExpedited { data, .. })) => Some(data.to_vec()),
                _ => None,
            };
        }
    }
    None
}

// covers: eoe-interfaces
#[test]
fn ethernet_of_undeclared_subdevices_works_idle_and_beside_an_application() {
    for network in networks() {
        let mut main_device = idle(network);
        let by_position = |at: u16| EthernetSubDevice::new(Position(at), Position(at), 0);
        assert_eq!(ethernet(&mut main_device), [by_position(TERMINAL), by_position(ALL)]);
        for at in [TERMINAL, ALL] {
            frames_return(&mut main_device, Position(at).into());
        }
        // One of them is declared, the other is not.
        let mut application = activate(main_device, &[0, 2, ALL]);
        let declared = EthernetSubDevice::new(SubDeviceId(2), Position(ALL), 0);
        let mut both = ethernet(&mut application);
        both.sort_by_key(|it| it.position);
        assert_eq!(both, [by_position(TERMINAL), declared]);
        assert!(declared.is_at_place_of(&by_position(ALL)));
        let before = application.process(DomainId(0));
        for address in [Position(TERMINAL).into(), SubDeviceId(2).into(), Position(ALL).into()] {
            frames_return(&mut application, address);
        }
        let after = application.process(DomainId(0));
        assert_eq!((after.wkc, after.skipped), (before.expected, before.skipped));
        // The list stays complete while an application ends.
        let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
        assert_eq!(ethernet(&mut ended), [by_position(TERMINAL), by_position(ALL)]);
        ended.attend(FOLLOWED);
        for at in [TERMINAL, ALL] {
            frames_return(&mut ended, Position(at).into());
        }
    }
}

// covers: eoe-interfaces
#[test]
fn ethernet_of_an_undeclared_subdevice_ends_and_returns_with_its_power() {
    for network in networks() {
        let mut main_device = idle(network);
        frames_return(&mut main_device, Position(ALL).into());
        for _ in 0..3 {
            let power = |main_device: &mut MainDevice<Tap>, fault| {
                main_device.links_mut().network_mut().apply(fault);
                main_device.attend(FOLLOWED);
            };
            power(&mut main_device, Fault::PowerOff(DeviceIndex(ALL.into())));
            let left = ethernet(&mut main_device);
            assert_eq!(left, [EthernetSubDevice::new(Position(TERMINAL), Position(TERMINAL), 0)]);
            frames_return(&mut main_device, Position(TERMINAL).into());
            power(&mut main_device, Fault::PowerOn(DeviceIndex(ALL.into())));
            frames_return(&mut main_device, Position(ALL).into());
            frames_return(&mut main_device, Position(TERMINAL).into());
        }
    }
}

// covers: eoe-interfaces
#[test]
fn ethernet_of_an_undeclared_subdevice_continues_at_another_position() {
    let [_, ring] = networks();
    let mut main_device = idle(ring);
    frames_return(&mut main_device, Position(ALL).into());
    for _ in 0..3 {
        main_device.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(usize::from(ALL) - 1)));
        main_device.attend(FOLLOWED);
        let moved = Position(ALL - 1);
        assert_eq!(ethernet(&mut main_device)[1], EthernetSubDevice::new(moved, moved, 0));
        frames_return(&mut main_device, moved.into());
        main_device.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(usize::from(ALL) - 1)));
        main_device.attend(FOLLOWED);
        frames_return(&mut main_device, Position(ALL).into());
    }
}

// covers: 10.1, gateway
#[test]
fn gateway_clients_reach_undeclared_subdevices_idle_and_beside_an_application() {
    for network in networks() {
        let mut main_device = idle(network);
        let vendor = |main_device: &mut MainDevice<Tap>, at: u16| {
            let vendor = main_device.subdevices()[usize::from(at)].identity.vendor_id;
            vendor.to_le_bytes().to_vec()
        };
        let vendors = [ALL, SERVO].map(|at| Some(vendor(&mut main_device, at)));
        assert_eq!([ALL, SERVO].map(|at| vendor_by_gateway(&mut main_device, at)), vendors);
        assert_eq!(vendor_by_gateway(&mut main_device, 2), None, "it has no mailbox");
        let mut application = activate(main_device, &[0, SERVO]);
        assert_eq!([ALL, SERVO].map(|at| vendor_by_gateway(&mut application, at)), vendors);
        let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
        ended.attend(FOLLOWED);
        assert_eq!([ALL, SERVO].map(|at| vendor_by_gateway(&mut ended, at)), vendors);
        // Without idle operation and without a visit there is no mailbox to pass it to.
        let counters = ended.ask(|engine| engine.relay_counters());
        assert_eq!(counters.unanswered, 0, "{counters:?}");
    }
}
