//! PDOs in the dictionaries travel: in order they are known, after a crash they count as unknown.

use super::*;
use ringcat::{Direction, PdoEntry, PdoMapping, SubDeviceConfig};

/// What a device holds for its outputs: PDOs, and bits of all.
fn held(main_device: &mut MainDevice<Tap>, at: usize) -> (Vec<u16>, u32) {
    let device = main_device.links_mut().network().device(DeviceIndex(at));
    let dictionary = device.application.dictionary();
    (dictionary.assigned(2).collect(), dictionary.assigned_bits(2))
}

/// What the MainDevice says of it.
fn said(main_device: &MainDevice<Tap>, at: usize) -> (Vec<u16>, u32) {
    let info = &main_device.subdevices()[at];
    let bits = info.assigned_pdos(2).map(|pdo| pdo.bit_length()).sum();
    (info.assigned_pdos(2).map(|pdo| pdo.index).collect(), bits)
}

/// An application in which both servos have other PDOs than by default.
fn with_others(main_device: MainDevice<Tap>) -> Application<Tap> {
    let mut declaration = automatic(&main_device.subdevices(), CYCLE);
    for (at, config) in declaration.subdevices.iter_mut().enumerate().filter(|(at, _)| [0, 3].contains(at)) {
        let controlword = PdoEntry::new(0x6040, 0, 16);
        // One by assignment, the other by mapping.
        let outputs = PdoMapping::of(if at == 0 { 0x1601 } else { 0x1600 }, vec![controlword]);
        let inputs = PdoMapping::from_sii(if at == 0 { 0x1A01 } else { 0x1A00 });
        let own: SubDeviceConfig = config.clone();
        *config = own.assign(2, Direction::Outputs, vec![outputs]).assign(3, Direction::Inputs, vec![inputs]);
    }
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    settle(&mut application);
    cycles(&mut application, 20);
    application
}

/// All ways to the next owner: handed over while active, after a deactivation, and after a crash of either, with bytes
/// from before the application or from its time.
// covers: states, plan
#[test]
fn any_owner_gets_the_pdos_of_the_one_before_and_reaches_op_with_its_own() {
    for (is_active, handover, are_bytes_old) in [
        (true, Handover::Orderly, false),
        (false, Handover::Orderly, false),
        (true, Handover::AfterCrash, false),
        (true, Handover::AfterCrash, true),
        (false, Handover::AfterCrash, true),
        (false, Handover::AfterCrash, false),
    ] {
        for network in networks() {
            let text = format!("active {is_active}, {handover:?}, old bytes {are_bytes_old}");
            let former = idle(network);
            let old = to_bytes(&former);
            let application = with_others(former);
            let (links, bytes) = if is_active {
                let bytes = application.engine().knowledge().expect("it is scanned").to_bytes();
                (application.into_links(), bytes)
            } else {
                let ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                let bytes = to_bytes(&ended);
                (ended.into_links(), bytes)
            };
            let mut next = resumed(links, if are_bytes_old { &old } else { &bytes }, handover);
            next.attend(FOLLOWED);
            assert_eq!(statuses(&mut next), [PREOP; MIXED.len()], "{text}");
            for (at, pdos) in [(0, 0x1601), (3, 0x1600)] {
                let now = held(&mut next, at);
                assert_eq!(said(&next, at), now, "{text}: {at}");
                assert_eq!(now, (vec![pdos], 16), "{text}: {at}: nothing was written");
            }
            // The next application has the default PDOs, by name.
            let mut declaration = automatic(&next.subdevices(), CYCLE);
            for at in [0, 3] {
                let described = scenarios::segments::describe("servo", "servo");
                for sync in scenarios::calls::configure::syncs_of(&described) {
                    let config = declaration.subdevices[at].clone();
                    declaration.subdevices[at] = config.assign(sync.index, sync.direction, sync.pdos);
                }
            }
            let mut application = next.activate(declaration).map_err(Error::from).expect("it fits");
            settle(&mut application);
            cycles(&mut application, 20);
            let status = application.process(DomainId(0));
            assert_eq!(status.wkc, status.expected, "{text}");
            let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
            for at in [0, 3] {
                assert_eq!(held(&mut ended, at), (vec![0x1600], 96), "{text}");
                assert_eq!(said(&ended, at), (vec![0x1600], 96), "{text}");
            }
        }
    }
}

/// Dictionaries of 100 SubDevices are known from the bytes: no mail requests them.
// covers: states
#[test]
fn known_dictionaries_are_not_read_again_by_the_next_owner() {
    let mut former = idle(ring(descriptions(&["servo"; 12]), NetworkOptions::default()));
    let before: Vec<u64> = (0..12)
        .map(|at| former.subdevice(Position(at)).mailbox_status().expect("it has one").counters.written)
        .collect();
    assert_eq!(before, [4; 12], "both assignments and mappings were read, each at once");
    let mut next = hand_over(former, Handover::Orderly);
    next.attend(LIMIT);
    for at in 0..12 {
        assert_eq!(next.subdevice(Position(at)).mailbox_status().expect("it has one").counters.written, 0);
        assert_eq!(said(&next, at.into()), (vec![0x1600], 96));
    }
}
