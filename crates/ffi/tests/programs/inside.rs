//! Settings of a program, checked inside the simulated SubDevices.

use std::io::{Read, Write};
use std::process::Stdio;

use ringcat::sim::application::mailbox::faults::MailFault;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::device::Device;
use ringcat::sim::fault::Fault;
use ringcat::wire::register::map;
use ringcat::{AlState, AlStatusCode};

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program};

const OUTPUTS: DeviceIndex = DeviceIndex(1);
const DRIVE: DeviceIndex = DeviceIndex(2);
const PROTOCOLS: DeviceIndex = DeviceIndex(3);
/// Following error.
const EMERGENCY: u16 = 0x8611;

/// An assigned PDO with index, subindex and bits of its entries.
type Pdo = (u16, Vec<(u16, u8, u8)>);

/// What the dictionary of a device assigns to a SyncManager.
fn assigned(device: &Device, sync_manager: u8) -> Vec<Pdo> {
    let dictionary = device.application.dictionary();
    let entries = |pdo: u16| dictionary.mapped(pdo).map(|it| (it.index, it.sub_index, it.bit_length)).collect();
    dictionary.assigned(sync_manager).map(|pdo| (pdo, entries(pdo))).collect()
}

fn check_pdos(bench: &Bench) {
    let pdos = bench.inside(|segment| {
        let network = segment.network_mut();
        let of = |device, sync_manager| assigned(network.device(device), sync_manager);
        [of(DRIVE, 2), of(DRIVE, 3), of(PROTOCOLS, 2), of(PROTOCOLS, 3)]
    });
    let [outputs, inputs, kept, left] = pdos;
    assert_eq!(outputs, [(0x1601, vec![(0x6060, 0, 8), (0, 0, 8), (0x6040, 0, 16)])]);
    assert_eq!(inputs.iter().map(|(pdo, _)| *pdo).collect::<Vec<_>>(), [0x1A00, 0x1A01]);
    assert_eq!(inputs[1].1, [(0x6041, 0, 16)]);
    assert_eq!(kept, [(0x1600, vec![(0x7000, 1, 32)])], "no entries: the default mapping");
    assert_eq!(left, [(0x1A00, vec![(0x6000, 1, 32)])], "no PDOs: the default assignment");
}

fn check_settings(bench: &Bench) {
    let (addresses, elements, owners) = bench.inside(|segment| {
        let network = segment.network_mut();
        let application = &network.device(PROTOCOLS).application;
        let addresses = application.servers().eoe().expect("it has EoE").addresses().clone();
        let elements = [1, 2, 3].map(|at| application.dictionary().read(0x2001, at).map(<[u8]>::to_vec));
        let owner = |device| network.device(device).controller.register(map::SII_CONFIGURATION, 1)[0] & 1;
        (addresses, elements, [owner(OUTPUTS), owner(DRIVE)])
    });
    assert_eq!(addresses.mac, [2, 0, 0, 0, 0, 9]);
    let all = [addresses.address, addresses.mask, addresses.gateway, addresses.dns];
    assert_eq!(all.map(|it| it.to_string()), ["10.1.2.3", "255.255.255.0", "10.1.2.1", "10.1.2.53"]);
    assert_eq!(addresses.name, b"protocols");
    assert_eq!(elements, [Ok(vec![0x11, 0x22]), Ok(vec![0x33, 0x44]), Ok(vec![3, 0])], "the third one stays");
    assert_eq!(owners, [1, 0], "the EEPROM is assigned to the PDI where the flag says so");
}

// covers: c-interface, daemon
#[test]
fn settings_of_a_program_reach_the_subdevices() {
    let Some(inside) = program(&here().join("tests/c/inside.c"), &[]) else { return };
    let bench = Bench::start(&here().join("tests/c/services.toml"), "inside");
    bench.inside(|segment| {
        let code = AlStatusCode(0x8042);
        let refuses = Fault::RefuseTransition { device: DRIVE, to: AlState::SafeOp, code, times: 1 };
        segment.network_mut().apply(refuses);
    });
    let mut command = bench.command(&inside);
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut lines = wait_for_line(&mut child, "op");
    check_pdos(&bench);
    check_settings(&bench);
    bench.inside(|segment| {
        let emergencies = MailFault::EmergencyBefore { count: 4, code: EMERGENCY };
        segment.network_mut().apply(Fault::Mail(DRIVE, emergencies));
    });
    child.stdin.take().expect("it is piped").write_all(b"go\n").expect("it reads");
    let mut said = String::new();
    lines.read_to_string(&mut said).expect("it is text");
    let output = child.wait_with_output().expect("it ends");
    let reported = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.ends_with("done\n"), "{said}\n{reported}");
    println!("{said}");
    let unknown = "EtherCAT: flag \"NoSuchFlag\" is unknown and has no effect";
    assert_eq!(reported.lines().filter(|line| *line == unknown).count(), 1, "{reported}");
    bench.wait_for_preop();
}
