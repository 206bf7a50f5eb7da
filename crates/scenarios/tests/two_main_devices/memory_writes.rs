//! While a file or an EEPROM is written, or a SubDevice is in BOOT, no requested switchover cuts that off (protocol
//! 9.6, seed 000 3.7); after a failure the event names what was under way.

use std::time::Duration;

use ringcat::standby::{MasterSizes, MemoryWrite, RoleRequest, StandbyEvent, WriteKind};
use ringcat::{FoeOptions, Position, SubDeviceId};
use ringcat_engine::mail::foe;
use ringcat_engine::mail::stream::Bytes;
use ringcat_engine::main_device::Pending;
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_sim::fault::Fault;
use ringcat_wire::al::AlState;
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of, standby};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// It takes files, and has a boot loader.
const DRIVE: SubDeviceId = SubDeviceId(2);
const WHILE_WRITING: Duration = Duration::from_millis(20);

fn in_op() -> Two {
    let mut two = Two::in_op(ring_of(&KINDS, Host::First), declare, standby());
    two.run(Duration::from_millis(300));
    two.mark();
    two
}

/// The ACTIVE begins to write a file that takes some seconds.
fn write_file(two: &mut Two, length: usize) -> Pending<bool> {
    let active = two.active().expect("one is ACTIVE");
    let engine = &mut two.controllers[active].engine;
    let mailbox = engine.mailbox(DRIVE).expect("it is declared");
    let written = engine.start(async move {
        let data = vec![0x5A; length];
        foe::write(&mailbox, "recipe", FoeOptions::default(), &mut Bytes::new(&data), |_| {}).await.is_ok()
    });
    two.run(WHILE_WRITING);
    written
}

fn refused(two: &Two, controller: usize) -> Vec<MemoryWrite> {
    let refused = |event: StandbyEvent| match event {
        StandbyEvent::RoleRefused(write) => Some(write),
        _ => None,
    };
    two.standby_events(controller).into_iter().filter_map(refused).collect()
}

/// The write that the event of a takeover names as cut off.
fn cut(two: &Two, controller: usize) -> Option<MemoryWrite> {
    let took_over = |event: &StandbyEvent| match event {
        StandbyEvent::TookOver { cut, .. } => Some(*cut),
        _ => None,
    };
    two.standby_events(controller).iter().find_map(took_over).expect("it has taken over")
}

// covers: standby, 9.6, REQ042
#[test]
fn no_requested_role_cuts_off_a_file_that_is_written() {
    let mut two = in_op();
    let mut written = write_file(&mut two, 200_000);
    let file = MemoryWrite::new(WriteKind::File, false, DRIVE.0);
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(4 * CYCLE);
    two.controllers[0].request(RoleRequest::Inactive);
    two.run(4 * CYCLE);
    assert_eq!(refused(&two, 0), [file, file], "{}", two.log());
    two.controllers[1].request(RoleRequest::Active);
    two.run(4 * CYCLE);
    assert_eq!(refused(&two, 1), [file], "{}", two.log());
    assert_eq!(two.active(), Some(0));
    assert!(written.is_running(), "the test is too short: it has ended");
    let result = (0..60_000).find_map(|_| {
        two.run(CYCLE);
        written.take()
    });
    assert_eq!(result, Some(true), "within a minute");
    two.run(2 * CYCLE);
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(10 * CYCLE);
    assert_eq!((two.active(), cut(&two, 1)), (Some(1), None), "nothing is written any more\n{}", two.log());
    assert!(two.left_op.is_empty() && two.went_back.is_empty(), "{}", two.log());
}

// covers: standby, 9.6, MR-15
#[test]
fn a_hold_does_not_begin_where_a_write_keeps_the_role() {
    let mut two = in_op();
    let written = write_file(&mut two, 200_000);
    let control = two.controllers[0].control().clone();
    control.request_hold(false);
    two.run(4 * CYCLE);
    assert_eq!(refused(&two, 0), [MemoryWrite::new(WriteKind::File, false, DRIVE.0)], "{}", two.log());
    assert!(!control.is_held() && two.active() == Some(0) && written.is_running());
    control.request_hold(true);
    two.run(4 * CYCLE);
    assert!(control.is_held() && two.active().is_none(), "it is forced\n{}", two.log());
    // Without an application the same, at once.
    let mut two = Two::new(ring_of(&KINDS, Host::First), declare, standby());
    let control = two.controllers[1].control().clone();
    control.request_hold(false);
    two.run(2 * CYCLE);
    assert!(control.is_held());
}

// covers: standby, 9.6
#[test]
fn a_forced_role_changes_and_a_takeover_names_what_was_cut_off() {
    let file = MemoryWrite::new(WriteKind::File, false, DRIVE.0);
    for is_killed in [false, true] {
        let mut two = in_op();
        let written = write_file(&mut two, 200_000);
        assert!(written.is_running());
        if is_killed {
            two.kill(0);
            two.run(3 * CYCLE);
            two.controllers[1].request(RoleRequest::Active);
        } else {
            two.controllers[0].control().force(RoleRequest::HandOver);
        }
        two.run(10 * CYCLE);
        assert_eq!((two.active(), cut(&two, 1)), (Some(1), Some(file)), "{}", two.log());
        assert!(refused(&two, 0).is_empty() && refused(&two, 1).is_empty());
    }
}

// covers: standby, 9.6, MR-17
#[test]
fn an_inactive_without_an_application_leaves_the_role_to_one_that_writes() {
    // Without knowledge of the segment the second one never follows.
    let mut sizes = MasterSizes::default();
    sizes.knowledge = 0;
    let mut two = Two::new(ring_of(&KINDS, Host::First), declare, standby().with_sizes(sizes));
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(5), "all are in OP", Two::all_in_op);
    two.run(Duration::from_millis(300));
    two.mark();
    let written = write_file(&mut two, 200_000);
    assert!(!two.controllers[1].has_application());
    two.controllers[1].request(RoleRequest::Active);
    two.run(10 * CYCLE);
    let file = MemoryWrite::new(WriteKind::File, false, DRIVE.0);
    assert_eq!((two.active(), refused(&two, 1)), (Some(0), vec![file]), "{}", two.log());
    assert!(written.is_running() && two.left_op.is_empty());
    // After the failure of the MainDevice that writes, nothing is refused.
    two.kill(0);
    two.run(4 * CYCLE);
    two.controllers[1].request(RoleRequest::Active);
    two.run(2 * CYCLE);
    assert_eq!((two.active(), refused(&two, 1).len()), (Some(1), 1), "{}", two.log());
}

// covers: standby, 9.6
#[test]
fn an_eeprom_that_is_written_and_a_subdevice_in_boot_keep_the_role() {
    let mut two = in_op();
    let alias = two.controllers[0].engine.start_alias_write(DRIVE, 77, true);
    two.run(Duration::from_millis(2));
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(2 * CYCLE);
    assert_eq!(refused(&two, 0), [MemoryWrite::new(WriteKind::Eeprom, false, DRIVE.0)], "{}", two.log());
    drop(alias);
    two.run(Duration::from_secs(2));
    two.mark();
    two.controllers[0].engine.start_state_request(DRIVE, AlState::Boot);
    two.run(Duration::from_millis(300));
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(4 * CYCLE);
    assert_eq!(refused(&two, 0), [MemoryWrite::new(WriteKind::Boot, false, DRIVE.0)], "{}", two.log());
    two.controllers[0].engine.start_state_request(DRIVE, AlState::Op);
    two.until(Duration::from_secs(5), "it is in OP", Two::all_in_op);
    two.run(20 * CYCLE);
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(10 * CYCLE);
    assert_eq!(two.active(), Some(1), "{}", two.log());
}

// covers: standby, MR-10
#[test]
fn in_a_collision_both_determine_which_of_them_writes() {
    let mut two = in_op();
    let written = write_file(&mut two, 200_000);
    two.controllers[1].control().force(RoleRequest::Active);
    two.run(4 * CYCLE);
    assert!(two.active().is_none() && written.is_running(), "both are ACTIVE\n{}", two.log());
    let file = Some(MemoryWrite::new(WriteKind::File, false, DRIVE.0));
    let of = |two: &mut Two, controller: usize| {
        let exchange = two.controllers[controller].exchange();
        (exchange.memory_write(), exchange.memory_write_of_collided())
    };
    assert_eq!([of(&mut two, 0), of(&mut two, 1)], [(file, None), (None, file)]);
    // The one that does not write yields, as the policy does.
    two.controllers[1].request(RoleRequest::Inactive);
    two.run(50 * CYCLE);
    assert!(two.active() == Some(0) && written.is_running(), "{}", two.log());
}

// covers: standby, 9.6
#[test]
fn without_an_application_a_file_and_a_subdevice_in_boot_keep_the_role_too() {
    let mut two = Two::new(ring_of(&KINDS, Host::First), declare, standby());
    two.controllers[0].activates = false;
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(5), "it has scanned", |two| two.controllers[0].has_scanned);
    let drive = Position(DRIVE.0 as u16);
    two.controllers[0].engine.start_state_request(drive, AlState::Boot);
    two.run(Duration::from_millis(300));
    two.mark();
    two.controllers[0].request(RoleRequest::Inactive);
    two.run(2 * CYCLE);
    assert_eq!(refused(&two, 0), [MemoryWrite::new(WriteKind::Boot, true, DRIVE.0)], "{}", two.log());
    assert_eq!(two.active(), Some(0));
    two.controllers[0].engine.start_state_request(drive, AlState::Init);
    two.run(Duration::from_millis(300));
    two.controllers[0].request(RoleRequest::Inactive);
    two.run(2 * CYCLE);
    assert_eq!(two.active(), None, "{}", two.log());
}

// covers: standby, 9.6
#[test]
fn a_subdevice_in_boot_that_is_gone_does_not_keep_the_role() {
    let mut two = in_op();
    two.controllers[0].engine.start_state_request(DRIVE, AlState::Boot);
    two.run(Duration::from_millis(300));
    two.fault(Fault::PowerOff(DeviceIndex(DRIVE.0)));
    two.run(Duration::from_millis(300));
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(10 * CYCLE);
    assert_eq!((two.active(), refused(&two, 0)), (Some(1), vec![]), "{}", two.log());
}
