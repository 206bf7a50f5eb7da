//! Differences between a SubDevice on the bus and its description.

use std::time::Duration;

use ringcat_config::esi::{Choices, Device, Slots, SyncManager, select};
use ringcat_config::network::model::SubDevice;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::sii::{DcMode, SiiSyncManager, SyncManagerKind};

use crate::reading::acme;

const ANALOG: usize = 2;

// covers: esi-declare, ES-40, ES-47
#[test]
fn differences_of_a_subdevice_to_its_description_are_named_once_each() {
    let esi = acme();
    let device = &esi.devices[ANALOG];
    let choices = Choices::default();
    let selection = select(&esi, device, &choices).unwrap_or_else(|error| panic!("{error}"));
    let from =
        SubDevice::from_esi(&selection, Duration::from_millis(1), 1033).unwrap_or_else(|error| panic!("{error}"));
    let mut subdevice = from.subdevice;
    let mut info = as_described(device);
    assert_eq!(subdevice.differences_to_esi(device, &info, &[]), Vec::<String>::new(), "it was made of it");
    subdevice.revision = Some(0x0012_0000);
    subdevice.mailbox.as_mut().expect("it has one").read.length = 64;
    let pdo = |subdevice: &mut SubDevice, index: u16, change: fn(&mut Vec<ringcat_config::network::model::Entry>)| {
        let mut pdos = subdevice.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo);
        let found = pdos.find(|pdo| pdo.index == index).expect("it is assigned");
        change(found.entries.as_mut().expect("they are declared"));
    };
    pdo(&mut subdevice, 0x1A00, |entries| entries[2].bits = 32);
    pdo(&mut subdevice, 0x1A02, |entries| drop(entries.pop()));
    let expected = [
        "revision 0x00120000, the description is of 0x00110000",
        "64 bytes of read mailbox at 0x1080, in the description 128 at 0x1080",
        "PDO 0x1a00: entry 3 is 0x6000:11 with 32 bits, in the description 0x6000:11 with 16 bits",
        "PDO 0x1a02: entry 1 is none, in the description 0x6010:11 with 16 bits",
    ];
    assert_eq!(subdevice.differences_to_esi(device, &info, &[]), expected);
    info.sync_managers[3].start += 0x100;
    info.sync_managers[3].control ^= 0x40;
    info.sync_managers[3].length += 1;
    let sm = info.sync_managers[3];
    let described = (device.sync_managers[3].start.unwrap(), device.sync_managers[3].control.unwrap(), sm.length - 1);
    let more = [
        format!("SM 3 at {:#06x}, in the description at {:#06x}", sm.start, described.0),
        format!("control byte {:#04x} of SM 3, in the description {:#04x}", sm.control, described.1),
        format!("{} bytes of SM 3 by default, in the description {}", sm.length, described.2),
    ];
    assert_eq!(subdevice.differences_to_esi(device, &info, &[])[2..5], more);
    info.sync_managers.pop();
    assert_eq!(subdevice.differences_to_esi(device, &info, &[])[2..3], ["SM 3 is only in the description"]);
}

/// What a scan of a device finds that is as described.
fn as_described(device: &Device) -> SubDeviceInfo {
    let mut info = SubDeviceInfo::default();
    let sync_manager = |sm: &SyncManager| SiiSyncManager {
        start: sm.start.unwrap_or(0),
        length: sm.default_size.unwrap_or(0),
        control: sm.control.unwrap_or(0),
        status: 0,
        enable: 1,
        kind: SyncManagerKind::Unused,
    };
    info.sync_managers = device.sync_managers.iter().map(sync_manager).collect();
    let modes = device.clock.iter().flat_map(|clock| &clock.modes);
    info.dc_modes = modes.map(|it| DcMode { assign_activate: it.assign_activate, ..DcMode::default() }).collect();
    info
}

// covers: esi-declare, ES-40
#[test]
fn pdos_that_only_one_of_both_assigns_are_differences() {
    let esi = acme();
    let device = &esi.devices[ANALOG];
    let choices = Choices::default();
    let selection = select(&esi, device, &choices).unwrap_or_else(|error| panic!("{error}"));
    let made = || {
        let from = SubDevice::from_esi(&selection, Duration::from_millis(1), 1033);
        from.unwrap_or_else(|error| panic!("{error}")).subdevice
    };
    let info = as_described(device);
    let mut other = made();
    other.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo).find(|it| it.index == 0x1A00).unwrap().index = 0x1A0F;
    let differences = [
        "PDO 0x1a0f of SM 3 is not in the description",
        "PDO 0x1a00 is not assigned, in the description it is, to SM 3",
    ];
    assert_eq!(other.differences_to_esi(device, &info, &[]), differences);
    let mut modular = device.clone();
    modular.slots = Some(Slots::default());
    assert_eq!(other.differences_to_esi(&modular, &info, &[]), differences[1..], "it may be of an unknown module");
    let mut moved = device.clone();
    let pdo = moved.tx_pdos.iter_mut().find(|it| it.index.index == 0x1A00).unwrap();
    pdo.sync_manager = Some(2);
    let text = "PDO 0x1a00 is assigned to SM 3, in the description to SM 2";
    assert_eq!(made().differences_to_esi(&moved, &info, &[]), [text]);
    moved.tx_pdos.iter_mut().find(|it| it.index.index == 0x1A00).unwrap().sync_manager = None;
    let text = "PDO 0x1a00 is assigned to SM 3, in the description it is not";
    assert_eq!(made().differences_to_esi(&moved, &info, &[]), [text]);
}

// covers: esi-declare, ES-60
#[test]
fn operation_modes_of_the_clock_are_compared_where_the_sii_has_them() {
    let esi = acme();
    let device = esi.devices.iter().find(|it| it.clock.as_ref().is_some_and(|clock| !clock.modes.is_empty()));
    let device = device.expect("a device with a clock");
    let subdevice = SubDevice::default();
    let of_modes = |info: &SubDeviceInfo| -> Vec<String> {
        let all = subdevice.differences_to_esi(device, info, &[]).into_iter();
        all.filter(|it| it.contains("operation mode")).collect()
    };
    let mut info = as_described(device);
    assert_eq!(of_modes(&info), Vec::<String>::new());
    let described = info.dc_modes[0].assign_activate;
    info.dc_modes[0].assign_activate = 0x0720;
    let text = format!("AssignActivate 0x0720 of operation mode 1, in the description {described:#06x}");
    assert_eq!(of_modes(&info), [text]);
    let count = info.dc_modes.len();
    info.dc_modes.push(DcMode::default());
    assert_eq!(of_modes(&info), [format!("{} operation modes of the clock, in the description {count}", count + 1)]);
    info.dc_modes.clear();
    assert_eq!(of_modes(&info), Vec::<String>::new(), "many EEPROMs have none");
}
