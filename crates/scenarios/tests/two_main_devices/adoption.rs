//! A running bus is adopted: what is written, how soon mailboxes and topology are usable, and what does not fit.

use std::time::Duration;

use ringcat::standby::StandbyEvent;
use ringcat::standby::{NotReady, Partner, RoleRequest};
use ringcat::{Event, Limits, MainDeviceRole, SdoAddress, SubDeviceId};
use ringcat_engine::mail::coe;
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_sim::fault::Fault;
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of_two, standby};

/// Registers that a takeover must not write: station address, DL control, AL control, EEPROM, FMMUs, SyncManagers,
/// offsets and delays of clocks, SYNC signals.
const KEPT: [std::ops::Range<u16>; 6] =
    [0x0010..0x0012, 0x0100..0x0104, 0x0120..0x0122, 0x0600..0x0800, 0x0800..0x0880, 0x0920..0x09A0];
/// The byte of a mailbox's SyncManager with the repeat request: mail that may have been lost with the other MainDevice
/// is requested again.
const REPEAT_REQUEST: u16 = 0x080E;

/// The first MainDevice fails, and the second one takes over three cycles later.
fn taken_over(count: usize) -> Two {
    let mut two = Two::in_op(ring_of_two(count, Host::First), declare, standby());
    two.run(Duration::from_millis(500));
    two.mark();
    two.kill(0);
    two.run(3 * CYCLE);
    two.controllers[1].request(RoleRequest::Active);
    two
}

/// Runs until an SDO of each of these SubDevices was read by the second MainDevice; the time since its role changed.
fn first_sdos(two: &mut Two, subdevices: &[usize]) -> Duration {
    two.until(Duration::from_secs(1), "it is ACTIVE", |two| two.active() == Some(1));
    let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    let engine = &mut two.controllers[1].engine;
    let mut start = |subdevice: usize| {
        let mailbox = engine.mailbox(SubDeviceId(subdevice)).expect("it is declared");
        engine.start(async move { coe::read(&mailbox, SdoAddress::new(0x1018, 1), limits, 64).await })
    };
    let mut pending: Vec<_> = subdevices.iter().map(|it| start(*it)).collect();
    let mut last = two.now();
    while !pending.is_empty() {
        two.run(Duration::from_micros(100));
        pending.retain_mut(|pending| match pending.take() {
            Some(result) => {
                result.expect("the SDO is read");
                false
            }
            None => true,
        });
        last = two.now();
        let changed_at = two.controllers[1].changed_at.expect("it has changed");
        assert!(last.since(changed_at) < Duration::from_secs(1), "{}", two.log());
    }
    last.since(two.controllers[1].changed_at.expect("it has changed"))
}

// covers: MR-16, MR-18, 6.3, standby
#[test]
fn a_takeover_writes_no_register_that_a_configuration_writes() {
    let mut two = taken_over(8);
    two.run(Duration::from_secs(3));
    assert!(two.left_op.is_empty() && two.all_in_op(), "{}", two.log());
    let written: Vec<_> = two.controllers[1].written.iter().collect();
    let is_kept =
        |(_, register): &&&(u8, u16)| *register != REPEAT_REQUEST && KEPT.iter().any(|range| range.contains(register));
    let wrong: Vec<_> = written.iter().filter(is_kept).collect();
    assert!(wrong.is_empty(), "command and register: {wrong:02x?}");
    assert!(!written.is_empty(), "mailboxes are written");
}

// covers: MR-16, MR-17, 9.9, standby
#[test]
fn after_a_takeover_of_33_subdevices_the_first_sdo_is_answered_within_20_ms() {
    let mut two = taken_over(33);
    // Servos have mailboxes.
    let first = first_sdos(&mut two, &[3]);
    let all = first_sdos(&mut two, &[3, 11, 19, 27]);
    println!("first SDO {first:?} after the takeover, all {all:?}");
    assert!(first <= Duration::from_millis(20), "{first:?}");
    assert!(two.left_op.is_empty(), "{}", two.log());
    // The topology was known at once, and the first round of reads has confirmed it.
    assert!(two.controllers[1].engine.all_settled(), "{}", two.log());
    assert_eq!(two.controllers[1].engine.subdevices().len(), 33);
}

// covers: MR-16, MR-18, 9.9, standby
#[test]
fn after_a_warm_takeover_of_33_subdevices_the_first_sdo_is_answered_within_200_ms() {
    let through_init = standby().with_goes_through_init(true);
    let mut two = Two::in_op(ring_of_two(33, Host::First), declare, through_init);
    two.run(Duration::from_millis(500));
    two.kill(0);
    two.run(3 * CYCLE);
    two.controllers[1].request(RoleRequest::Active);
    two.until(Duration::from_secs(1), "it is ACTIVE", |two| two.active() == Some(1));
    let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    let is_read = |two: &mut Two| {
        let engine = &mut two.controllers[1].engine;
        let mailbox = engine.mailbox(SubDeviceId(3)).expect("it is declared");
        let read = async move { coe::read(&mailbox, SdoAddress::new(0x1018, 1), limits, 64).await };
        let mut pending = engine.start(read);
        loop {
            two.run(Duration::from_micros(200));
            if let Some(result) = pending.take() {
                return result.is_ok();
            }
        }
    };
    two.until(Duration::from_secs(1), "it is in INIT", |two| {
        two.network.device(DeviceIndex(3)).al_status() == AlStatus::new(AlState::Init)
    });
    while !is_read(&mut two) {}
    let first = two.now().since(two.controllers[1].changed_at.expect("it has changed"));
    println!("first SDO {first:?} after a takeover through INIT");
    assert!(first <= Duration::from_millis(200), "{first:?}");
    assert_eq!(two.controllers[1].engine.subdevices().len(), 33, "the topology is known");
}

// covers: MR-17, REQ042, standby
#[test]
fn transfers_of_an_active_that_yields_are_cancelled_and_repeated_at_the_other() {
    let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby());
    let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    for delay in [0, 200, 700, 1500, 3000] {
        let giver = two.active().expect("one is ACTIVE");
        let engine = &mut two.controllers[giver].engine;
        let mailbox = engine.mailbox(SubDeviceId(3)).expect("it is declared");
        let mut cut = engine.start(async move { coe::read(&mailbox, SdoAddress::new(0x1018, 1), limits, 64).await });
        two.run(Duration::from_micros(delay));
        two.controllers[giver].request(RoleRequest::HandOver);
        two.until(Duration::from_millis(100), "handed over", |two| two.active() == Some(1 - giver));
        two.run(CYCLE);
        let is_over = cut.take().is_some() || !cut.is_running();
        assert!(is_over, "a transfer under way ends with the role");
        let engine = &mut two.controllers[1 - giver].engine;
        let mailbox = engine.mailbox(SubDeviceId(3)).expect("it is declared");
        let mut again = engine.start(async move { coe::read(&mailbox, SdoAddress::new(0x1018, 1), limits, 64).await });
        let mut result = None;
        for _ in 0..100 {
            two.run(CYCLE);
            result = result.or_else(|| again.take());
        }
        result.expect("it has ended").expect("it is read");
        assert!(two.left_op.is_empty(), "{}", two.log());
    }
}

// covers: MR-18, standby
#[test]
fn a_warm_takeover_configures_all_subdevices_from_init_on_and_says_so() {
    let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby().with_goes_through_init(true));
    two.run(Duration::from_millis(200));
    two.mark();
    two.kill(0);
    two.controllers[1].request(RoleRequest::Active);
    two.run(CYCLE);
    two.until(Duration::from_secs(5), "all in OP", |two| two.all_in_op() && two.controllers[1].engine.all_settled());
    assert_eq!(two.left_op.len(), 8, "{}", two.log());
    let warm = |event: &StandbyEvent| matches!(event, StandbyEvent::TookOver { is_hot: false, .. });
    assert!(two.standby_events(1).iter().any(warm), "{}", two.log());
    let init = two.controllers[1].written.iter().any(|(_, register)| *register == 0x0120);
    assert!(init, "AL control was written");
}

// covers: MR-23, MR-16, standby
#[test]
fn a_subdevice_gone_before_a_takeover_is_missing_one_that_goes_with_it_is_lost() {
    for before in [true, false] {
        let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby());
        two.run(Duration::from_millis(200));
        // The SubDevice next to the MainDevice that fails: all others stay in reach.
        if before {
            two.fault(Fault::PowerOff(DeviceIndex(0)));
            two.run(Duration::from_millis(200));
        }
        two.mark();
        two.kill(0);
        if !before {
            two.fault(Fault::PowerOff(DeviceIndex(0)));
        }
        two.run(3 * CYCLE);
        two.controllers[1].request(RoleRequest::Active);
        two.run(Duration::from_millis(300));
        let count = |event: &Event| two.controllers[1].events.iter().filter(|it| it.event == *event).count();
        let missing = Event::Missing { subdevice: SubDeviceId(0), optional: false };
        let reported = [count(&missing), count(&Event::Lost { subdevice: SubDeviceId(0) })];
        assert_eq!(reported, if before { [1, 0] } else { [0, 1] }, "{}", two.log());
        let unsettled = two.controllers[1].engine.unsettled();
        assert!(unsettled.iter().any(|(subdevice, _)| subdevice.0 == 0), "{unsettled:?}\n{}", two.log());
        two.fault(Fault::PowerOn(DeviceIndex(0)));
        two.until(Duration::from_secs(5), "it comes back", |two| {
            two.network.device(DeviceIndex(0)).al_status() == AlStatus::new(AlState::Op)
                && two.controllers[1].engine.all_settled()
        });
    }
}

// covers: MR-18, MR-26, REQ032, standby
#[test]
fn an_active_that_is_started_again_is_followed_at_once_by_the_one_that_stayed() {
    let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby());
    // The cycle counter of the ACTIVE is far above its first value.
    two.run(Duration::from_secs(5));
    two.kill(0);
    two.run(10 * CYCLE);
    two.revive(0);
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(4), "the ACTIVE is in OP again", |two| {
        two.all_in_op() && two.controllers[0].engine.all_settled()
    });
    two.run(20 * CYCLE);
    let [first, second] = &two.controllers;
    assert_eq!(second.engine.states(), first.engine.states(), "{}", two.log());
    // Its session has other logical addresses: the application of the other one cannot go on with them.
    let partner = first.partner();
    assert!(matches!(partner, Partner::Alive { not_ready, .. } if not_ready.has(NotReady::LAYOUT)), "{partner:?}");
    two.mark();
    two.kill(0);
    two.controllers[1].request(RoleRequest::Active);
    two.run(5 * CYCLE);
    let is_warm = |event: &StandbyEvent| matches!(event, StandbyEvent::TookOver { is_hot: false, .. });
    assert!(two.standby_events(1).iter().any(is_warm), "{:?}", two.standby_events(1));
    two.until(Duration::from_secs(5), "all are in OP", |two| {
        two.all_in_op() && two.controllers[1].engine.all_settled()
    });
}

// covers: MR-26, REQ025, REQ026, standby
#[test]
fn a_maindevice_that_returns_is_inactive_and_follows_again() {
    let mut two = taken_over(8);
    two.run(Duration::from_millis(300));
    two.revive(0);
    two.until(Duration::from_secs(3), "it is ready", |two| two.controllers[1].partner().is_ready());
    assert_eq!(two.controllers[0].engine.role(), MainDeviceRole::Inactive);
    assert!(two.left_op.is_empty() && two.went_back.is_empty(), "{}", two.log());
    two.mark();
    two.kill(1);
    two.run(3 * CYCLE);
    two.controllers[0].request(RoleRequest::Active);
    two.run(Duration::from_millis(200));
    assert!(two.all_in_op() && two.left_op.is_empty() && two.went_back.is_empty(), "{}", two.log());
}
