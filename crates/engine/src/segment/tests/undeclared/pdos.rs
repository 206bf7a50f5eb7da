//! PDOs in the dictionaries: when they are read, and what replaces what was known.

use ringcat_wire::sii::{CoeDetails, MailboxLayout, MailboxProtocols, SiiSyncManager, SyncManagerKind};

use super::*;
use crate::config::{PdoAssignment, PdoMapping};
use crate::direction::Direction;
use crate::info::PdoSource;

/// Three SubDevices that are kept; that at position 1 has a dictionary, with this source of its PDOs.
fn with_dictionary(pdo_source: PdoSource) -> Idle {
    let mut scan = found(&THREE);
    let unused =
        SiiSyncManager { start: 0, length: 0, control: 0, status: 0, enable: 1, kind: SyncManagerKind::Unused };
    let inputs = SiiSyncManager { length: 4, kind: SyncManagerKind::Inputs, ..unused };
    let info = &mut scan.subdevices[1];
    info.mailbox = Some(MailboxLayout::default());
    info.protocols = MailboxProtocols(MailboxProtocols::COE);
    info.sync_managers = vec![unused, unused, inputs];
    info.pdo_source = pdo_source;
    let mut segment = Segment::new(Choices { idle_operation: true, pdos: ReadPdos::Always, ..choices() });
    segment.observe(Observation::ScanBegun, Instant(0));
    segment.observe(Observation::ScanEnded(Ok(scan)), Instant(0));
    Idle { segment, now: Instant(0) }
}

/// The others are in PREOP already; the effects are those of the last one.
fn keep(idle: &mut Idle) -> Vec<Effect> {
    idle.seen(UndeclaredObservation::TakenOver);
    let begun = attempts(&idle.seen(UndeclaredObservation::AttemptsDue));
    let [first, second, third] = begun[..] else { panic!("{begun:?}") };
    idle.end(first, None);
    idle.end(third, None);
    idle.end(second, None)
}

fn readings(effects: &[Effect]) -> Vec<(SubDeviceKey, u32)> {
    let begun = |effect: &Effect| match effect {
        Effect::Start(Task::ReadPdos { key, attempt }) => Some((*key, *attempt)),
        _ => None,
    };
    effects.iter().filter_map(begun).collect()
}

fn held(pdo: u16) -> [PdoAssignment; 1] {
    [PdoAssignment::new(2, Direction::Inputs, vec![PdoMapping::of(pdo, [])])]
}

impl Idle {
    fn pdos(&mut self, key: SubDeviceKey, finding: PdoFinding<'_>) -> Vec<Effect> {
        self.seen(UndeclaredObservation::Pdos { key, finding })
    }

    /// Source and PDOs, in the list and in the last scan.
    fn known(&self) -> [(PdoSource, Vec<u16>); 2] {
        let of = |info: &SubDeviceInfo| (info.pdo_source, info.assigned_pdos(2).map(|pdo| pdo.index).collect());
        let listed = self.segment.subdevices().at(StationAddress(0x1002)).and_then(|it| it.knowledge.info()).unwrap();
        [of(listed), of(&self.segment.found().unwrap().subdevices[1])]
    }
}

#[test]
fn a_dictionary_is_read_once_in_preop_unless_it_is_known() {
    for (source, is_read) in [(PdoSource::Sii, true), (PdoSource::Outdated, true), (PdoSource::Dictionary, false)] {
        let mut idle = with_dictionary(source);
        let begun = readings(&keep(&mut idle));
        assert_eq!(begun, if is_read { vec![(idle.key(1), 1)] } else { vec![] }, "{source:?}");
        assert_eq!(readings(&idle.seen(UndeclaredObservation::AttemptsDue)), [], "{source:?}: once");
    }
    // What was written since power-on is known as long as it has not been in INIT.
    let written = with_dictionary(PdoSource::Written);
    let info = written.segment.found().unwrap().subdevices[1].clone();
    assert!(!written.segment.wants_pdos(&info, false) && written.segment.wants_pdos(&info, true));
}

#[test]
fn what_a_dictionary_holds_replaces_what_was_known_everywhere() {
    for (source, after) in [(PdoSource::Sii, PdoSource::Dictionary), (PdoSource::Outdated, PdoSource::Written)] {
        let mut idle = with_dictionary(source);
        keep(&mut idle);
        let key = idle.key(1);
        assert_eq!(idle.pdos(key, PdoFinding::Held(&held(0x1A00))), []);
        assert_eq!(idle.known(), [(after, vec![0x1A00]), (after, vec![0x1A00])]);
        // It is written by mail: read again, and nothing is of power-on any more.
        assert_eq!(readings(&idle.pdos(key, PdoFinding::Outdated)), [(key, 1)]);
        assert_eq!(idle.known()[1], (PdoSource::Outdated, vec![0x1A00]));
        assert_eq!(idle.pdos(key, PdoFinding::Held(&held(0x1A01))), []);
        assert_eq!(idle.known(), [(PdoSource::Written, vec![0x1A01]), (PdoSource::Written, vec![0x1A01])]);
    }
}

#[test]
fn a_dictionary_that_cannot_be_read_is_tried_again_with_the_next_attempt() {
    let mut idle = with_dictionary(PdoSource::Outdated);
    keep(&mut idle);
    let key = idle.key(1);
    assert_eq!(idle.pdos(key, PdoFinding::Unreadable), []);
    assert_eq!(readings(&idle.seen(UndeclaredObservation::AttemptsDue)), []);
    let next = attempts(&idle.request(1, PREOP))[0];
    assert_eq!(readings(&idle.end(next, None)), [(key, 2)]);
    // After it has got another address, findings are refused.
    idle.segment.observe(Observation::Readdressing(&[key.station]), idle.now);
    assert_eq!(idle.pdos(key, PdoFinding::Held(&held(0x1A00))), []);
    assert_eq!(idle.segment.found().unwrap().subdevices[1].pdo_source, PdoSource::Outdated);
}

/// It may come back with its station address, and with the data of the last scan.
#[test]
fn pdos_written_by_mail_before_a_subdevice_left_are_noted_in_the_last_scan() {
    let source = |idle: &Idle| idle.segment.found().unwrap().subdevices[1].pdo_source;
    for leaves_during_scan in [false, true] {
        let mut idle = with_dictionary(PdoSource::Dictionary);
        keep(&mut idle);
        let key = idle.key(1);
        let begun = idle.segment.found().unwrap().clone();
        idle.segment.observe(Observation::Readdressing(&[key.station]), idle.now);
        assert_eq!(idle.pdos(key, PdoFinding::Outdated), []);
        assert_eq!(source(&idle), PdoSource::Outdated);
        if leaves_during_scan {
            // A scan that began before has what was known then.
            let versions = idle.segment.versions();
            idle.observe(Observation::FoundAgain { versions, found: begun });
            assert_eq!((source(&idle), idle.known()[0].0), (PdoSource::Outdated, PdoSource::Outdated));
        }
    }
}

/// A program that waits for the PDOs does not wait for a SubDevice whose state has no mail.
#[test]
fn pdos_are_awaited_of_those_on_their_way_to_a_state_with_mail_only() {
    for (state, is_awaited) in [(PREOP, true), (AlState::Op, true), (AlState::Boot, false), (AlState::Init, false)] {
        let mut idle = with_dictionary(PdoSource::Sii);
        assert!(idle.segment.are_pdos_awaited(), "{state:?}: nothing is requested yet");
        keep(&mut idle);
        assert!(idle.segment.are_pdos_awaited(), "{state:?}: they are being read");
        let begun = attempts(&idle.request(1, state))[0];
        assert_eq!(idle.segment.are_pdos_awaited(), is_awaited, "{state:?}, on its way");
        idle.end(begun, None);
        assert_eq!(idle.segment.are_pdos_awaited(), is_awaited, "{state:?}, reached");
        let key = idle.key(1);
        idle.pdos(key, PdoFinding::Held(&held(0x1A00)));
        assert!(!idle.segment.are_pdos_awaited(), "{state:?}, known");
    }
}

/// The object dictionary, without PDOs of its own: for requests that come later.
#[test]
fn an_object_dictionary_is_read_once_for_each_time_that_the_state_is_reached() {
    let mut idle = with_dictionary(PdoSource::Dictionary);
    idle.segment.observe(Observation::ScanBegun, idle.now);
    let mut scan = found(&THREE);
    let info = &mut scan.subdevices[1];
    info.mailbox = Some(MailboxLayout::default());
    info.protocols = MailboxProtocols(MailboxProtocols::COE);
    info.coe = CoeDetails(CoeDetails::SDO | CoeDetails::SDO_INFORMATION);
    idle.segment.observe(Observation::ScanEnded(Ok(scan)), idle.now);
    assert_eq!(idle.segment.dictionary_to_read(), None, "no state is reached");
    keep(&mut idle);
    let key = idle.key(1);
    assert_eq!(idle.segment.dictionary_to_read(), Some((key, 1)));
    let read = |idle: &mut Idle, attempt| idle.seen(UndeclaredObservation::DictionaryRead { key, attempt });
    assert_eq!(read(&mut idle, 1), []);
    assert_eq!(idle.segment.dictionary_to_read(), None);
    let next = attempts(&idle.request(1, PREOP))[0];
    assert_eq!(idle.segment.dictionary_to_read(), None, "on its way");
    idle.end(next, None);
    assert_eq!(idle.segment.dictionary_to_read(), Some((key, 2)));
    read(&mut idle, 1);
    assert_eq!(idle.segment.dictionary_to_read(), Some((key, 2)), "that of the attempt before");
    let boot = attempts(&idle.request(1, AlState::Boot))[0];
    idle.end(boot, None);
    assert_eq!(idle.segment.dictionary_to_read(), None, "BOOT has no mail");
}

#[test]
fn a_dictionary_that_is_written_during_a_scan_is_outdated_in_what_it_finds() {
    let mut idle = Idle::kept(&THREE);
    let source = |idle: &Idle, at: usize| {
        let found = idle.segment.found().unwrap().subdevices[at].pdo_source;
        let listed = idle.segment.subdevices().unassigned().nth(at).unwrap();
        assert_eq!(found, listed.knowledge.info().unwrap().pdo_source);
        found
    };
    for at in 0..2 {
        idle.seen(UndeclaredObservation::Pdos { key: idle.key(at), finding: PdoFinding::Held(&[]) });
    }
    let begun = (idle.segment.versions(), (**idle.segment.found().unwrap()).clone());
    idle.seen(UndeclaredObservation::Pdos { key: idle.key(0), finding: PdoFinding::Outdated });
    idle.observe(Observation::FoundAgain { versions: begun.0, found: Rc::new(begun.1) });
    assert_eq!((source(&idle, 0), source(&idle, 1)), (PdoSource::Outdated, PdoSource::Dictionary));
    // Another SubDevice at its address: nothing of it is outdated.
    let mut others = found(&[(0x1001, 9), (0x1002, 2), (0x1003, 3)]);
    others.subdevices[0].pdo_source = PdoSource::Dictionary;
    let versions = idle.segment.versions();
    idle.observe(Observation::FoundAgain { versions, found: Rc::new(Found::from(others)) });
    assert_eq!(source(&idle, 0), PdoSource::Dictionary);
}
