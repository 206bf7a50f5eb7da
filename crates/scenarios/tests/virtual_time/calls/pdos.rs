//! Programs with other PDOs one after the other: each finds what the SubDevices hold, and reaches OP with what it has
//! chosen.

use std::time::Duration;

use ringcat::{PdoMapping, Position, SubDeviceInfo};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::calls::configure::{ChosenPdos, SyncInfo};

use super::*;

/// An assignment: SyncManager, PDOs with index, subindex and bits of their entries.
type Assigned = (u8, Vec<(u16, Vec<(u16, u8, u8)>)>);

/// What the dictionary of a device holds.
fn held(device: &Device) -> Vec<Assigned> {
    let dictionary = device.application.dictionary();
    let numbers = (0u8..16).filter(|number| dictionary.object(0x1C10 + u16::from(*number)).is_some());
    let entries = |pdo: u16| dictionary.mapped(pdo).map(|it| (it.index, it.sub_index, it.bit_length)).collect();
    numbers.map(|number| (number, dictionary.assigned(number).map(|pdo| (pdo, entries(pdo))).collect())).collect()
}

/// What the MainDevice says of it, for the same SyncManagers.
fn said(info: &SubDeviceInfo, held: &[Assigned]) -> Vec<Assigned> {
    let entries =
        |pdo: &ringcat::PdoInfo| pdo.entries.iter().map(|it| (it.index, it.sub_index, it.bit_length)).collect();
    let of = |number: u8| info.assigned_pdos(number).map(|pdo| (pdo.index, entries(pdo))).collect();
    held.iter().map(|(number, _)| (*number, of(*number))).collect()
}

/// What a program has chosen.
fn wanted(syncs: &[SyncInfo]) -> Vec<Assigned> {
    let entry = |it: &ringcat::PdoEntry| (it.index, it.sub_index, it.bit_length);
    let entries = |pdo: &PdoMapping| pdo.entries.iter().flatten().map(entry).collect();
    let pdos = |sync: &SyncInfo| sync.pdos.iter().map(|pdo| (pdo.index, entries(pdo))).collect();
    syncs.iter().map(|sync| (sync.index, pdos(sync))).collect()
}

/// The MainDevice reports what the SubDevices in PREOP hold.
fn assert_said(ecrt: &mut Ecrt, text: &str) {
    let found = ecrt.side.engine().subdevices();
    for (at, info) in found.iter().enumerate().filter(|(_, info)| info.protocols.coe()) {
        let held = held(ecrt.network().device(DeviceIndex(at)));
        assert_eq!(said(info, &held), held, "{text}: SubDevice {at}");
    }
}

/// Configures all, each with these PDOs; `None`: those that the MainDevice says it has.
fn configure_chosen(ecrt: &mut Ecrt, count: usize, chosen: Option<ChosenPdos>) {
    let Some(chosen) = chosen else {
        configure(ecrt, 0..count);
        return;
    };
    let domain = ecrt.create_domain().expect("it is requested");
    for (at, kind) in (0..).zip(&KINDS[..count]) {
        let config = ecrt.slave_config(0, at, identity(kind)).expect("it is new");
        let syncs = chosen.of(&describe(kind, kind));
        ecrt.pdos(config, &syncs);
        for entry in Ecrt::entries_of(&syncs) {
            ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0)).expect("it is declared");
        }
    }
}

/// Runs a program until all are in OP with what it has chosen.
fn run_chosen(ecrt: &mut Ecrt, count: usize, chosen: Option<ChosenPdos>, text: &str) {
    let before: Vec<Vec<Assigned>> = ecrt.network().devices().map(held).collect();
    configure_chosen(ecrt, count, chosen);
    ecrt.activate().expect("it fits");
    ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{text}: {error}"));
    ecrt.cycles(20);
    for (at, kind) in KINDS[..count].iter().enumerate() {
        let described = describe(kind, kind);
        let now = held(ecrt.network().device(DeviceIndex(at)));
        match chosen {
            Some(chosen) if described.has_coe() => {
                let wanted = wanted(&chosen.of(&described));
                let of_wanted: Vec<Assigned> =
                    now.into_iter().filter(|(number, _)| wanted.iter().any(|(other, _)| other == number)).collect();
                assert_eq!(of_wanted, wanted, "{text}: {kind}");
            }
            Some(_) => {}
            None => assert_eq!(now, before[at], "{text}: {kind}: nothing was chosen"),
        }
    }
}

/// Each choice after each other one, and nothing chosen.
const CHOICES: [Option<ChosenPdos>; 13] = {
    use ChosenPdos::{Named, Others, Shortened};
    let [one, two, three] = [Some(Named), Some(Others), Some(Shortened)];
    [None, two, None, one, two, one, three, two, three, one, None, three, None]
};

// covers: api, declaration, plan
#[test]
fn programs_with_any_pdos_follow_each_other_and_reach_op() {
    for (count, mut ecrt) in requested() {
        assert_said(&mut ecrt, "requested");
        for (round, chosen) in CHOICES.into_iter().enumerate() {
            let text = format!("{count}, round {round}: {chosen:?}");
            run_chosen(&mut ecrt, count, chosen, &text);
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
            assert_said(&mut ecrt, &text);
        }
    }
}

// covers: api, declaration, plan, stop
#[test]
fn programs_with_any_pdos_follow_killed_ones_and_reach_op() {
    for (count, mut ecrt) in requested() {
        for (round, chosen) in CHOICES.into_iter().enumerate() {
            let text = format!("{count}, round {round}: {chosen:?}");
            run_chosen(&mut ecrt, count, chosen, &text);
            ecrt.killed();
            ecrt.request().expect("it is free");
            assert_said(&mut ecrt, &text);
        }
    }
}

/// Some SubDevices are back at the PDOs of power-on whenever they were in INIT, others are not.
// covers: api, declaration, plan
#[test]
fn pdos_are_right_whether_subdevices_keep_them_in_init_or_not() {
    for kind in ["servo", "analog-input-4", "analog-output-4"] {
        let mut device = describe(kind, kind);
        device.forgets_pdos_in_init = true;
        let mut ecrt = Ecrt::new(line(vec![device.clone()], NetworkOptions::default()));
        ecrt.request().expect("it is free");
        for chosen in CHOICES {
            let domain = ecrt.create_domain().expect("it is requested");
            let key = (device.identity.vendor_id, device.identity.product_code);
            let config = ecrt.slave_config(0, 0, key).expect("it is new");
            let syncs = chosen.map(|chosen| chosen.of(&device));
            ecrt.pdos(config, syncs.as_deref().unwrap_or_default());
            let entries = syncs.as_deref().map_or_else(|| ecrt.default_entries(config), Ecrt::entries_of);
            for entry in entries {
                ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0)).expect("it is mapped");
            }
            ecrt.activate().expect("it fits");
            ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{kind}, {chosen:?}: {error}"));
            if let Some(syncs) = syncs {
                let now = held(ecrt.network().device(DeviceIndex(0)));
                assert!(wanted(&syncs).iter().all(|one| now.contains(one)), "{kind}, {chosen:?}: {now:x?}");
            }
            ecrt.deactivate().expect("all follow");
            assert_said(&mut ecrt, &format!("{kind}, after {chosen:?}"));
        }
    }
}

// covers: api, declaration, recovery
#[test]
fn chosen_pdos_are_restored_after_a_loss_of_power() {
    for (count, mut ecrt) in requested() {
        for chosen in [Some(ChosenPdos::Others), None, Some(ChosenPdos::Shortened), Some(ChosenPdos::Named)] {
            let text = format!("{count}: {chosen:?}");
            run_chosen(&mut ecrt, count, chosen, &text);
            ecrt.network().apply(ringcat_sim::fault::Fault::PowerOff(DeviceIndex(0)));
            ecrt.cycles(100);
            ecrt.network().apply(ringcat_sim::fault::Fault::PowerOn(DeviceIndex(0)));
            ecrt.cycles(20);
            ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{text}: {error}"));
            ecrt.deactivate().expect("all follow");
            assert_said(&mut ecrt, &text);
        }
    }
}

// covers: states
#[test]
fn undeclared_subdevices_reach_op_after_a_program_with_other_pdos() {
    for (count, mut ecrt) in requested() {
        for (round, chosen) in CHOICES.into_iter().enumerate() {
            let text = format!("{count}, round {round}: {chosen:?}");
            run_chosen(&mut ecrt, count, chosen, &text);
            if round % 2 == 0 {
                ecrt.deactivate().expect("all follow");
            } else {
                ecrt.killed();
                ecrt.request().expect("it is free");
            }
            for (at, kind) in (0..).zip(&KINDS[..count]) {
                let main_device = ecrt.side.main_device().expect("no program is active");
                let requested = main_device.subdevice(Position(at)).request_state(AlState::Op);
                requested.unwrap_or_else(|error| panic!("{text}: {kind}: {error}"));
            }
            ecrt.pause(Duration::from_secs(2));
            let op = AlStatus::new(AlState::Op);
            assert!(ecrt.network().devices().all(|device| device.al_status() == op), "{text}");
            ecrt.release();
            ecrt.request().expect("it is free");
        }
    }
}

/// A program that was not written for the device changes its PDOs by SDO; the next one finds them.
// covers: states, mailbox
#[test]
fn pdos_that_are_changed_by_sdo_are_known_within_100_ms() {
    for (count, mut ecrt) in requested() {
        let write = |ecrt: &mut Ecrt, writes: &[(u16, u8, &[u8])]| {
            for (index, sub_index, data) in writes {
                ecrt.sdo_download(0, *index, *sub_index, data).expect("it is in PREOP");
            }
        };
        write(&mut ecrt, &[(0x1C12, 0, &[0]), (0x1C12, 1, &[0x01, 0x16]), (0x1C12, 0, &[1])]);
        ecrt.pause(Duration::from_millis(200));
        assert_said(&mut ecrt, "an assignment");
        assert_eq!(ecrt.side.engine().subdevices()[0].assigned_pdos(2).next().map(|pdo| pdo.index), Some(0x1601));
        write(&mut ecrt, &[(0x1C13, 0, &[0]), (0x1A00, 0, &[2]), (0x1C13, 0, &[1])]);
        ecrt.pause(Duration::from_millis(200));
        assert_said(&mut ecrt, "a mapping");
        run_chosen(&mut ecrt, count, Some(ChosenPdos::Named), "named");
        ecrt.deactivate().expect("all follow");
    }
}

/// The same where an application begins or ends right after it: mailboxes end then.
// covers: states, mailbox
#[test]
fn pdos_that_are_changed_by_sdo_beside_an_application_are_known_after_it() {
    for (_, mut ecrt) in requested() {
        let assign = |ecrt: &mut Ecrt, pdo: u16| {
            let [low, high] = pdo.to_le_bytes();
            for (sub_index, data) in [(0, &[0][..]), (1, &[low, high]), (0, &[1])] {
                ecrt.sdo_download(0, 0x1C12, sub_index, data).expect("it is in PREOP");
            }
        };
        for (pdo, text) in [(0x1601, "before the activation"), (0x1600, "before the end")] {
            if text == "before the activation" {
                assign(&mut ecrt, pdo);
            }
            ecrt.activate().expect("nothing is declared");
            ecrt.cycles(5);
            if text == "before the end" {
                assign(&mut ecrt, pdo);
            }
            ecrt.deactivate().expect("all follow");
            ecrt.pause(Duration::from_millis(300));
            assert_said(&mut ecrt, text);
            let assigned = ecrt.side.engine().subdevices()[0].assigned_pdos(2).next().map(|pdo| pdo.index);
            assert_eq!(assigned, Some(pdo), "{text}");
        }
    }
}

/// The same where nothing is assigned any more, at each moment of the 100 ms between two checks for it.
// covers: states, mailbox
#[test]
fn pdos_that_are_removed_by_sdo_right_before_the_end_are_known_after_it() {
    for (count, mut ecrt) in requested() {
        for cycles in (0..100).step_by(9) {
            ecrt.activate().expect("nothing is declared");
            ecrt.cycles(cycles);
            ecrt.sdo_download(0, 0x1C13, 0, &[0]).expect("it is in PREOP");
            ecrt.deactivate().expect("all follow");
            ecrt.pause(Duration::from_millis(300));
            assert_said(&mut ecrt, &format!("{count}, {cycles} cycles"));
            ecrt.sdo_download(0, 0x1C13, 0, &[1]).expect("it is in PREOP");
            ecrt.pause(Duration::from_millis(300));
            assert_said(&mut ecrt, &format!("{count}, {cycles} cycles, assigned again"));
        }
    }
}

/// The events of a program since the last call.
fn said_by(ecrt: &mut Ecrt) -> Vec<ringcat::Event> {
    ecrt.look();
    ecrt.events.replace(Vec::new()).unwrap_or_default()
}

/// A program that names other PDOs for a SubDevice without CoE: a warning, and it goes on as declared.
// covers: api, declaration, plan
#[test]
fn other_pdos_of_a_subdevice_without_coe_are_a_warning() {
    use ringcat::Event;
    // With another name it fits; with another length the SubDevice decides: a controller alone accepts it.
    for (kind, bits, is_operational) in
        [("digital-output-8", 8, true), ("digital-output-8", 16, false), ("emulated-output-8", 16, true)]
    {
        for is_named in [true, false] {
            let text = format!("{kind}, {bits} bits, {is_named}");
            let mut ecrt = Ecrt::new(line(descriptions(&["coupler", kind]), NetworkOptions::default()));
            ecrt.request().expect("it is free");
            let domain = ecrt.create_domain().expect("it is requested");
            let config = ecrt.slave_config(0, 1, identity(kind)).expect("it is new");
            if is_named {
                let pdos = vec![PdoMapping::of(0x16FF, vec![ringcat::PdoEntry::new(0x7FF0, 1, bits)])];
                ecrt.pdos(config, &[SyncInfo { index: 0, direction: ringcat::Direction::Outputs, pdos }]);
                assert_eq!(ecrt.reg_pdo_entry(config, (0x7FF0, 1), domain, None), Ok(0), "{text}");
            } else {
                ecrt.pdos(config, &syncs_of(&describe(kind, kind)));
                assert_eq!(ecrt.reg_pdo_entry(config, (0x7000, 1), domain, None), Ok(0), "{text}");
            }
            assert_eq!(ecrt.domain_size(domain), if is_named { usize::from(bits) / 8 } else { 1 }, "{text}");
            said_by(&mut ecrt);
            ecrt.activate().expect("it is no error");
            let events = said_by(&mut ecrt);
            let warns =
                |event: &Event| matches!(event, Event::DeclarationWarning { what, .. } if what.contains("without CoE"));
            assert_eq!(events.iter().any(warns), is_named, "{text}: {events:?}");
            ecrt.cycles(1_000);
            let status = ecrt.slave_config_state(config).expect("it is configured");
            assert_eq!(status.operational, is_operational || !is_named, "{text}: {status:?}");
        }
    }
}

/// A SubDevice whose dictionary refuses what the program names.
// covers: api, declaration, refused-states
#[test]
fn refused_pdos_are_a_warning_for_programs_and_the_subdevice_decides() {
    use ringcat::Event;
    for (pdo, accepts) in [(0x1605, false), (0x1600, true)] {
        let mut device = describe("servo", "servo");
        if accepts {
            // It shows none of its PDOs, so they cannot be written either.
            device.left_out = vec![0x1C12, 0x1C13, 0x1600];
        }
        let mut ecrt = Ecrt::new(line(vec![device.clone()], NetworkOptions::default()));
        ecrt.request().expect("it is free");
        let domain = ecrt.create_domain().expect("it is requested");
        let key = (device.identity.vendor_id, device.identity.product_code);
        let config = ecrt.slave_config(0, 0, key).expect("it is new");
        let mut entries = syncs_of(&device).remove(0).pdos.remove(0).entries.expect("it has some");
        // Other names for the same length.
        if accepts {
            entries[0].index = 0x6042;
        } else {
            entries.truncate(1);
        }
        let first = (entries[0].index, entries[0].sub_index);
        let pdos = vec![PdoMapping::of(pdo, entries)];
        ecrt.pdos(config, &[SyncInfo { index: 2, direction: ringcat::Direction::Outputs, pdos }]);
        ecrt.reg_pdo_entry(config, first, domain, None).expect("it is declared");
        said_by(&mut ecrt);
        ecrt.activate().expect("it is no error");
        ecrt.cycles(1_500);
        let events = said_by(&mut ecrt);
        let warns =
            |event: &Event| matches!(event, Event::DeclarationWarning { what, .. } if what.contains("not as declared"));
        assert!(events.iter().any(warns), "{events:?}");
        let status = ecrt.slave_config_state(config).expect("it is configured");
        assert_eq!(status.operational, accepts, "{pdo:#x}: {status:?}, {events:?}");
    }
}
