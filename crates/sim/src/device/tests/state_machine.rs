//! Protocol 5.2, 5.3, 5.5 from the view of a MainDevice.

use core::time::Duration;

use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::{SyncManager, SyncManagerDirection, SyncManagerMode, map};
use ringcat_wire::sii::{MailboxLayout, MailboxProtocols, SyncManagerKind};

use super::bench::Bench;
use crate::catalogue;
use crate::description::TransitionTimes;

const UP: [AlState; 3] = [AlState::PreOp, AlState::SafeOp, AlState::Op];

fn ok(state: AlState) -> (AlStatus, AlStatusCode) {
    (AlStatus::new(state), AlStatusCode::NO_ERROR)
}

fn error(state: AlState, code: u16) -> (AlStatus, AlStatusCode) {
    (AlStatus::with_error(state), AlStatusCode(code))
}

fn up_to(name: &str, state: AlState) -> Bench {
    Bench::up_to(catalogue::by_name(name).unwrap(), state)
}

/// All invalid settings of a process data SyncManager, with the resulting code.
fn wrong_settings(right: SyncManager, outputs: bool) -> Vec<(&'static str, SyncManager, u16)> {
    let code = if outputs { 0x001D } else { 0x001E };
    let change = |change: fn(&mut SyncManager)| {
        let mut manager = right;
        change(&mut manager);
        manager
    };
    let mailbox = change(|manager| manager.control.mode = SyncManagerMode::Mailbox);
    let mut reversed = right;
    reversed.control.direction = match right.control.direction {
        SyncManagerDirection::Read => SyncManagerDirection::Write,
        SyncManagerDirection::Write | SyncManagerDirection::Reserved(_) => SyncManagerDirection::Read,
    };
    vec![
        ("off", change(|manager| manager.activate.enable = false), code),
        ("too long", change(|manager| manager.length += 1), code),
        ("too short", change(|manager| manager.length -= 1), code),
        ("elsewhere", change(|manager| manager.start += 0x10), code),
        ("mailbox mode", mailbox, 0x001C),
        ("wrong direction", reversed, 0x001C),
    ]
}

// covers: sim-devices
#[test]
fn each_device_of_the_catalogue_reaches_op_and_returns() {
    for name in catalogue::names() {
        let mut bench = up_to(name, AlState::Op);
        for state in [AlState::SafeOp, AlState::PreOp, AlState::Init] {
            bench.write_outputs();
            assert_eq!(bench.request(state), ok(state), "{name}");
        }
        bench.climb(AlState::Op);
        assert_eq!(bench.request(AlState::Init), ok(AlState::Init), "{name}");
    }
}

// covers: sim-states
#[test]
fn wrong_process_data_sync_managers_are_refused_with_their_codes() {
    for name in catalogue::names().filter(|name| !catalogue::by_name(name).unwrap().emulation) {
        for (kind, outputs) in [(SyncManagerKind::Outputs, true), (SyncManagerKind::Inputs, false)] {
            let mut bench = up_to(name, AlState::PreOp);
            for number in bench.numbers(kind) {
                for (what, wrong, code) in wrong_settings(bench.right(number), outputs) {
                    bench.set_process_data();
                    bench.set_sync_manager(number, &wrong);
                    let got = bench.request(AlState::SafeOp);
                    assert_eq!(got, error(AlState::PreOp, code), "{name} SyncManager {number} {what}");
                    assert_eq!(bench.acknowledge(AlState::PreOp), ok(AlState::PreOp));
                }
                bench.set_process_data();
                assert_eq!(bench.request(AlState::SafeOp), ok(AlState::SafeOp), "{name}");
                bench.request(AlState::PreOp);
            }
        }
    }
}

// covers: sim-states
#[test]
fn wrong_mailbox_sync_managers_are_0x0016() {
    for name in ["analog-input-4", "analog-output-4", "servo"] {
        let mut bench = Bench::named(name);
        for number in [0, 1] {
            let mut buffered = bench.right(number);
            buffered.control.mode = SyncManagerMode::Buffered;
            let mut wrong = wrong_settings(bench.right(number), true);
            wrong.retain(|(what, _, _)| *what != "mailbox mode");
            wrong.push(("buffered", buffered, 0x0016));
            for (what, wrong, _) in wrong {
                bench.set_mailbox();
                bench.set_sync_manager(number, &wrong);
                assert_eq!(bench.request(AlState::PreOp), error(AlState::Init, 0x0016), "{name} {number} {what}");
                assert_eq!(bench.acknowledge(AlState::Init), ok(AlState::Init));
            }
            bench.set_mailbox();
        }
        assert_eq!(bench.request(AlState::PreOp), ok(AlState::PreOp));
    }
}

#[test]
fn overlapping_buffers_are_0x0017() {
    let mut description = catalogue::by_name("block").unwrap();
    // Three buffers of 400 bytes end at 0x14B0.
    description.sync_managers[1].start = 0x14A0;
    let mut bench = Bench::up_to(description, AlState::PreOp);
    bench.set_process_data();
    assert_eq!(bench.request(AlState::SafeOp), error(AlState::PreOp, 0x0017));
    bench.device.description.sync_managers[1].start = 0x14B0;
    bench.acknowledge(AlState::PreOp);
    bench.set_process_data();
    assert_eq!(bench.request(AlState::SafeOp), ok(AlState::SafeOp));
}

#[test]
fn buffers_beyond_the_ram_are_0x0017() {
    // The controller was created with the usual RAM.
    let mut bench = Bench::up_to(catalogue::by_name("block").unwrap(), AlState::PreOp);
    bench.device.description.sync_managers[1].start = 0x2C00;
    bench.set_process_data();
    assert_eq!(bench.request(AlState::SafeOp), error(AlState::PreOp, 0x0017));
}

#[test]
fn a_drive_without_watchdog_is_0x001f() {
    let mut bench = up_to("servo", AlState::PreOp);
    bench.set_process_data();
    bench.write(map::WATCHDOG_TIME_PROCESS_DATA, &[0, 0]);
    assert_eq!(bench.request(AlState::SafeOp), error(AlState::PreOp, 0x001F));
    bench.acknowledge(AlState::PreOp);
    bench.write(map::WATCHDOG_TIME_PROCESS_DATA, &1000u16.to_le_bytes());
    let mut unwatched = bench.right(2);
    unwatched.control.watchdog = false;
    bench.set_sync_manager(2, &unwatched);
    assert_eq!(bench.request(AlState::SafeOp), error(AlState::PreOp, 0x001F));
}

#[test]
fn clock_settings_are_checked() {
    let mut bench = up_to("servo", AlState::PreOp);
    bench.set_process_data();
    let cycle = |ns: u32| Some(ns.to_le_bytes());
    for (activation, cycle, code) in
        [(0x05, None, 0x0030), (0x03, None, 0x0035), (0x03, cycle(100_000), 0x0035), (0x03, cycle(1_000_000), 0)]
    {
        bench.write(map::DC_ACTIVATION, &[activation]);
        if let Some(cycle) = cycle {
            bench.write(map::DC_SYNC0_CYCLE, &cycle);
        }
        let expected = if code == 0 { ok(AlState::SafeOp) } else { error(AlState::PreOp, code) };
        assert_eq!(bench.request(AlState::SafeOp), expected);
        bench.acknowledge(AlState::PreOp);
    }
}

#[test]
fn refused_requests_have_a_code_and_need_an_acknowledge() {
    let mut bench = Bench::named("digital-output-8");
    assert_eq!(bench.request(AlState::Op), error(AlState::Init, 0x0011));
    assert_eq!(bench.request(AlState::PreOp), error(AlState::Init, 0x0011), "not acknowledged");
    assert_eq!(bench.acknowledge(AlState::PreOp), ok(AlState::PreOp), "acknowledge and request in one write");
    let unknown = AlControl { state: 7, ..AlControl::new(AlState::Init) };
    assert_eq!(bench.control(unknown), error(AlState::PreOp, 0x0012));
    assert_eq!(bench.request(AlState::Init), ok(AlState::Init), "a request for INIT acknowledges");
    assert_eq!(bench.request(AlState::Boot), error(AlState::Init, 0x0013));
}

#[test]
fn boot_needs_its_own_mailbox_settings() {
    let mut description = catalogue::by_name("servo").unwrap();
    let mailbox = description.mailbox.as_mut().unwrap();
    mailbox.protocols = MailboxProtocols(MailboxProtocols::COE | MailboxProtocols::FOE);
    mailbox.bootstrap =
        MailboxLayout { receive_offset: 0x1000, receive_size: 244, send_offset: 0x10F4, send_size: 244 };
    let mut bench = Bench::new(description);
    bench.set_mailbox();
    assert_eq!(bench.request(AlState::Boot), error(AlState::Init, 0x0015));
    bench.acknowledge(AlState::Init);
    for (number, start) in [(0, 0x1000), (1, 0x10F4)] {
        let manager = SyncManager { start, length: 244, ..bench.right(number) };
        bench.set_sync_manager(number, &manager);
    }
    assert_eq!(bench.request(AlState::Boot), ok(AlState::Boot));
    assert_eq!(bench.request(AlState::PreOp), error(AlState::Boot, 0x0011));
    bench.acknowledge(AlState::Boot);
    assert_eq!(bench.request(AlState::Init), ok(AlState::Init));
}

// covers: sim-states
#[test]
fn a_transition_has_a_duration() {
    let mut description = catalogue::by_name("digital-input-8").unwrap();
    description.transitions = TransitionTimes::all(Duration::from_millis(5));
    let mut bench = Bench::new(description);
    bench.write(map::AL_CONTROL, &AlControl::new(AlState::PreOp).encode());
    bench.pass(Duration::from_micros(4_800));
    assert_eq!(bench.status(), ok(AlState::Init));
    bench.pass(Duration::from_micros(200));
    assert_eq!(bench.status(), ok(AlState::PreOp));
}

#[test]
fn a_request_during_a_transition_is_served_after_it() {
    let mut description = catalogue::by_name("digital-input-8").unwrap();
    description.transitions = TransitionTimes::all(Duration::from_millis(2));
    let mut bench = Bench::new(description);
    bench.write(map::AL_CONTROL, &AlControl::new(AlState::PreOp).encode());
    bench.write(map::AL_CONTROL, &AlControl::new(AlState::Init).encode());
    bench.pass(Duration::from_millis(2));
    assert_eq!(bench.status(), ok(AlState::PreOp));
    bench.pass(Duration::from_millis(2));
    assert_eq!(bench.status(), ok(AlState::Init));
}

#[test]
fn a_refused_transition_has_the_chosen_code_and_works_afterwards() {
    let mut bench = up_to("digital-input-8", AlState::PreOp);
    bench.set_process_data();
    bench.device.refuse_transition(AlState::SafeOp, AlStatusCode(0x8001), 2);
    for _ in 0..2 {
        assert_eq!(bench.request(AlState::SafeOp), error(AlState::PreOp, 0x8001));
        bench.acknowledge(AlState::PreOp);
    }
    assert_eq!(bench.request(AlState::SafeOp), ok(AlState::SafeOp));
}

#[test]
fn a_hanging_application_changes_no_state_until_it_continues() {
    let mut bench = Bench::named("digital-input-8");
    bench.device.hang(true, bench.now);
    assert_eq!(bench.request(AlState::PreOp), ok(AlState::Init));
    bench.device.hang(false, bench.now);
    bench.pass(Duration::ZERO);
    bench.pass(Duration::from_millis(2));
    assert_eq!(bench.status(), ok(AlState::PreOp));
}

#[test]
fn without_outputs_op_is_refused_with_0x0019_after_a_time_limit() {
    let mut bench = up_to("digital-output-8", AlState::SafeOp);
    assert_eq!(bench.request(AlState::Op), ok(AlState::SafeOp));
    bench.pass(Duration::from_millis(1_100));
    assert_eq!(bench.status(), error(AlState::SafeOp, 0x0019));
}

#[test]
fn op_begins_with_the_first_outputs() {
    let mut bench = up_to("digital-output-8", AlState::SafeOp);
    assert_eq!(bench.request(AlState::Op), ok(AlState::SafeOp));
    bench.output(&[0x5A]);
    assert_eq!(bench.status(), ok(AlState::Op));
    assert_eq!(bench.device.outputs(), [0x5A]);
}

#[test]
fn another_request_ends_the_wait_for_outputs() {
    let mut bench = up_to("digital-output-8", AlState::SafeOp);
    assert_eq!(bench.request(AlState::Op), ok(AlState::SafeOp));
    assert_eq!(bench.request(AlState::PreOp), ok(AlState::PreOp));
}

#[test]
fn a_missing_output_frame_trips_the_watchdog_to_safeop_with_0x001b() {
    let mut bench = up_to("digital-output-8", AlState::Op);
    bench.output(&[0xFF]);
    bench.pass(Duration::from_millis(99));
    assert_eq!(bench.status(), ok(AlState::Op));
    bench.pass(Duration::from_millis(2));
    assert_eq!(bench.status(), error(AlState::SafeOp, 0x001B));
    assert_eq!(bench.device.outputs(), [0]);
    bench.acknowledge(AlState::SafeOp);
    bench.output(&[0x0F]);
    assert_eq!(bench.request(AlState::Op), ok(AlState::Op));
    assert_eq!(bench.device.outputs(), [0x0F]);
}

#[test]
fn a_switched_off_watchdog_keeps_op() {
    let mut bench = up_to("digital-output-8", AlState::SafeOp);
    bench.write(map::WATCHDOG_TIME_PROCESS_DATA, &[0, 0]);
    bench.write_outputs();
    assert_eq!(bench.request(AlState::Op), ok(AlState::Op));
    bench.pass(Duration::from_secs(1));
    assert_eq!(bench.status(), ok(AlState::Op));
}

#[test]
fn disabling_a_sync_manager_at_run_time_causes_preop_or_init() {
    for (number, expected) in [
        (2, error(AlState::PreOp, 0x001D)),
        (3, error(AlState::PreOp, 0x001E)),
        (0, error(AlState::Init, 0x0016)),
        (1, error(AlState::Init, 0x0016)),
    ] {
        for state in [AlState::SafeOp, AlState::Op] {
            let mut bench = up_to("servo", state);
            bench.write(map::sync_manager(number).offset(SyncManager::ACTIVATE), &[0]);
            assert_eq!(bench.status(), expected, "SyncManager {number} in {state}");
        }
    }
}

#[test]
fn an_emulated_device_copies_al_control() {
    for name in ["coupler", "junction", "emulated-input-8"] {
        let mut bench = Bench::named(name);
        for state in UP {
            bench.write(map::AL_CONTROL, &AlControl::new(state).encode());
            assert_eq!(bench.status(), ok(state), "{name}");
        }
    }
}

// covers: sim-states
#[test]
fn the_identification_is_in_the_status_code() {
    let mut description = catalogue::by_name("servo").unwrap();
    description.identification = Some(0x0042);
    let mut bench = Bench::up_to(description, AlState::PreOp);
    let (status, code) = bench.control(AlControl { identification: true, ..AlControl::new(AlState::PreOp) });
    assert_eq!((status.bits(), code), (0x0022, AlStatusCode(0x0042)));
    assert_eq!(bench.request(AlState::PreOp), ok(AlState::PreOp));
}

#[test]
fn a_reset_through_ethercat_restarts_the_application() {
    let mut bench = up_to("digital-output-8", AlState::Op);
    bench.output(&[0xFF]);
    for byte in *b"RES" {
        bench.write(map::ESC_RESET_ECAT, &[byte]);
    }
    bench.pass(Duration::from_millis(20));
    assert!(bench.device.outputs().is_empty());
    bench.climb(AlState::Op);
}

#[test]
fn power_off_and_on_begins_in_init() {
    let mut bench = up_to("servo", AlState::Op);
    bench.device.power_off(bench.now);
    assert_eq!((bench.device.next_deadline(), bench.device.needs_run()), (None, false));
    bench.power_cycle();
    assert_eq!(bench.status(), ok(AlState::Init));
    bench.climb(AlState::Op);
}
