//! SubDevices with SyncManagers from a configuration file (protocol 8.1), which has priority over the SII.

use std::time::Duration;

use ringcat::{
    DeclaredSyncManager, DomainMember, Event, MainDevice, Options, PdoEntry, PdoMapping, Scan, SubDeviceConfig,
    SubDeviceId, SubDeviceInfo, SyncManagerRole, Transition, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::sii_image;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::SdoRequest;
use ringcat_wire::register::{SyncManager, SyncManagerControl, map};
use ringcat_wire::sii::SyncManagerKind;
use scenarios::check::{Delivery, troubles};
use scenarios::segments::{descriptions, line};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "servo", "digital-input-8"];
/// The SubDevice that the file configures.
const DRIVE: usize = 2;

fn declared(index: u8, role: SyncManagerRole, start: u16, length: u16, control: u8) -> DeclaredSyncManager {
    let mut register =
        SyncManager { start, length, control: SyncManagerControl::from_bits(control), ..SyncManager::default() };
    register.activate.enable = true;
    DeclaredSyncManager::new(index, role, register)
}

fn outputs() -> Vec<PdoMapping> {
    vec![PdoMapping::of(0x1600, [PdoEntry::new(0x60FF, 0, 32), PdoEntry::new(0x6040, 0, 16)])]
}

fn inputs() -> Vec<PdoMapping> {
    vec![PdoMapping::of(0x1A00, [PdoEntry::new(0x6064, 0, 32), PdoEntry::new(0x6041, 0, 16)])]
}

/// The servo drive of the catalogue as a file may have it: mailboxes where they are, six bytes each way instead of
/// twelve and fourteen.
fn of_file() -> Vec<DeclaredSyncManager> {
    let device = &descriptions(&KINDS)[DRIVE];
    let sm = |kind| *device.sync_managers.iter().find(|sm| sm.kind == kind).expect("a servo has all four");
    let (out, inward) = (sm(SyncManagerKind::MailboxOut), sm(SyncManagerKind::MailboxIn));
    let (write, read) = (sm(SyncManagerKind::Outputs), sm(SyncManagerKind::Inputs));
    vec![
        declared(0, SyncManagerRole::MailboxOut, out.start, out.length, 0x26),
        declared(1, SyncManagerRole::MailboxIn, inward.start, inward.length, 0x22),
        declared(2, SyncManagerRole::Outputs, write.start, 6, 0x64).with_pdos(outputs()),
        declared(3, SyncManagerRole::Inputs, read.start, 6, 0x20).with_pdos(inputs()),
    ]
}

/// The downloads of a file for this mapping, in an unusual order.
fn downloads() -> Vec<(u16, u8, Vec<u8>)> {
    let mut all = Vec::new();
    for (assignment, pdos) in [(0x1C13, inputs()), (0x1C12, outputs())] {
        all.push((assignment, 0, vec![0]));
        for PdoMapping { index, entries, .. } in pdos {
            all.push((index, 0, vec![0]));
            let entries = entries.expect("they are declared");
            for (sub_index, entry) in (1..).zip(&entries) {
                let object = u32::from(entry.index) << 16 | u32::from(entry.sub_index) << 8;
                all.push((index, sub_index, (object | u32::from(entry.bit_length)).to_le_bytes().to_vec()));
            }
            all.push((index, 0, vec![entries.len() as u8]));
            all.push((assignment, 1, index.to_le_bytes().to_vec()));
        }
        all.push((assignment, 0, vec![1]));
    }
    all
}

fn follow(config: SubDeviceConfig) -> SubDeviceConfig {
    let config = config.declared(of_file());
    let downloads = downloads().into_iter();
    downloads.fold(config, |config, (index, sub_index, data)| config.sdo_at(Transition::Ps, index, sub_index, data))
}

fn world(network: Network, change: impl Fn(SubDeviceConfig) -> SubDeviceConfig) -> World {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[DRIVE] = change(declaration.subdevices[DRIVE].clone());
        let drive = &declaration.subdevices[DRIVE];
        if drive.declared.is_some() && !declaration.domains[0].members.iter().any(|m| m.subdevice == SubDeviceId(DRIVE))
        {
            declaration.domains[0].members.push(DomainMember::new(SubDeviceId(DRIVE)));
        }
        declaration
    };
    let mut world = World::with(1, network, &Options::default(), declare).expect("scan and activation");
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    world
}

fn segment(change: impl FnOnce(&mut DeviceDescription)) -> Network {
    let mut devices = descriptions(&KINDS);
    change(&mut devices[DRIVE]);
    line(devices, NetworkOptions::default())
}

fn written(world: &World) -> Vec<(u16, u8, Vec<u8>)> {
    let mail = world.network().device(DeviceIndex(DRIVE)).application.served_mail();
    mail.iter()
        .filter_map(|mail| match SdoRequest::decode(&mail.payload).ok()? {
            SdoRequest::DownloadExpedited { index, sub_index, data, .. }
            | SdoRequest::DownloadNormal { index, sub_index, data, .. } => Some((index, sub_index, data.to_vec())),
            _ => None,
        })
        .collect()
}

fn exchanges(world: &mut World) {
    world.settle();
    world.run_cycles(100);
    let drive = world.network().device(DeviceIndex(DRIVE));
    assert_eq!((drive.outputs().len(), drive.inputs().len()), (6, 6));
    let entry = world.application().entry(SubDeviceId(DRIVE), 0x6041, 0).expect("the file says where it lies");
    assert_eq!((entry.bit_length, entry.bit_offset % 8), (16, 0));
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    let complete = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery);
    assert_eq!(complete, Some(Delivery::Complete));
    assert!(world.compared() > 0, "images are those of the devices");
}

// covers: 8.1, sync-managers-declared
#[test]
fn a_mapping_that_differs_from_the_sii_is_taken_from_the_file_alone() {
    let mut world = world(segment(|_| ()), follow);
    exchanges(&mut world);
    assert_eq!(written(&world), downloads(), "those of the file in its order, none of ours");
    let controller = &world.network().device(DeviceIndex(DRIVE)).controller;
    for sm in of_file() {
        let mut register =
            SyncManager::decode(controller.register(map::sync_manager(sm.index), 8).first_chunk().unwrap());
        register.status = sm.register.status;
        register.pdi_control = sm.register.pdi_control;
        assert_eq!(register, sm.register, "SM {}", sm.index);
    }
    // The same again when it comes back.
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(20);
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    world.power_on(DeviceIndex(DRIVE));
    world.settle();
    assert_eq!(written(&world), downloads());
}

// covers: 8.1, sync-managers-declared
#[test]
fn mailboxes_and_areas_of_the_file_override_a_wrong_or_empty_sii() {
    // An SII with the mailboxes of another product, and an SII without mailbox, PDOs and SyncManagers.
    let moved = |described: &mut DeviceDescription| {
        let mailbox = described.mailbox.as_mut().expect("a servo has one");
        mailbox.standard.receive_offset += 0x400;
        mailbox.standard.receive_size = 48;
    };
    let empty = |described: &mut DeviceDescription| {
        described.mailbox = None;
        described.pdos.clear();
        described.sync_managers.clear();
    };
    let wrongs: [fn(&mut DeviceDescription); 2] = [moved, empty];
    for wrong in wrongs {
        let network = segment(|device| {
            let mut described = device.clone();
            wrong(&mut described);
            device.sii_image = Some(sii_image::build(&described));
        });
        let mut world = world(network, follow);
        exchanges(&mut world);
        assert_eq!(written(&world), downloads());
    }
}

// covers: sync-managers-declared
#[test]
fn an_absent_subdevice_has_its_place_from_the_file_and_joins_there() {
    // The file describes all of them.
    let mut main_device = MainDevice::request(Tap::new(segment(|_| ())), &Options::default());
    let all: Vec<SubDeviceInfo> = main_device.scan().expect("a scan").subdevices;
    let mut network = segment(|_| ());
    network.power_off(DeviceIndex(3));
    network.power_off(DeviceIndex(DRIVE));
    let declare = |_: &Scan| {
        let mut declaration = automatic(&all, CYCLE);
        declaration.subdevices[DRIVE] = follow(declaration.subdevices[DRIVE].clone()).optional();
        declaration.subdevices[3] = declaration.subdevices[3].clone().optional();
        declaration
    };
    let mut world = World::with(2, network, &Options::default(), declare).expect("the others are there");
    world.run_cycles(100);
    let entry = world.application().entry(SubDeviceId(DRIVE), 0x6041, 0).expect("it has a place");
    assert_eq!(entry.bit_length, 16);
    world.power_on(DeviceIndex(DRIVE));
    world.until(Duration::from_secs(5), "in OP", |world| {
        world.network().device(DeviceIndex(DRIVE)).al_status().al_state() == Some(AlState::Op)
    });
    world.recognise();
    world.run_cycles(50);
    let drive = world.network().device(DeviceIndex(DRIVE));
    assert_eq!((drive.outputs().len(), drive.inputs().len()), (6, 6));
    assert_eq!(world.application().entry(SubDeviceId(DRIVE), 0x6041, 0), Some(entry), "nothing moves");
}

// covers: 3.1, sync-managers-declared
#[test]
fn a_file_that_exceeds_the_controller_is_refused_with_its_sync_manager() {
    let refused = |change: fn(&mut Vec<DeclaredSyncManager>)| {
        let declare = |scan: &Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            let mut declared = of_file();
            change(&mut declared);
            declaration.subdevices[DRIVE].declared = Some(declared);
            declaration
        };
        match World::with(0, segment(|_| ()), &Options::default(), declare) {
            Ok(_) => panic!("it was taken"),
            Err(error) => error.to_string(),
        }
    };
    let none = refused(|declared| declared[3].index = 16);
    assert!(none.contains("SubDevice 2") && none.contains("SM 16 is declared, the controller has"), "{none}");
    let overlap = refused(|declared| declared[3].register.start = declared[2].register.start + 4);
    assert!(overlap.contains("SM 2 (") && overlap.contains("overlap"), "{overlap}");
}
