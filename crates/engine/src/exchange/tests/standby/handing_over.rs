//! The role is handed over without a lost cycle (protocol MR-07), and cycles of the INACTIVE follow those of the ACTIVE
//! (protocol FR-09).

use ringcat_wire::master_frame::NotReady;
use ringcat_wire::memory_write::{MemoryWrite, WriteKind};

use super::duo::{DOMAIN, Duo, End, PERIOD};
use crate::event::CyclicStandbyEvent;
use crate::layout::MasterSizes;
use crate::role::{MainDeviceRole, RoleCause, RoleRequest};
use crate::time::Instant;

/// Cycles with outputs that count, by the MainDevice that is ACTIVE.
fn count(duo: &mut Duo, from: u8, cycles: u8) {
    for number in from..from + cycles {
        for device in [&mut duo.first, &mut duo.second] {
            if device.is_active() {
                device.exchange.image_mut(DOMAIN)[..3].fill(number);
            }
        }
        duo.cycle();
    }
}

// covers: MR-07, REQ015, standby
#[test]
fn a_role_that_is_handed_over_costs_no_cycle_and_no_output_goes_back() {
    let mut duo = Duo::new(MasterSizes::default());
    count(&mut duo, 0, 5);
    for round in 0..6 {
        duo.drain();
        duo.received.iter_mut().for_each(std::vec::Vec::clear);
        let (giver, taker) = if round % 2 == 0 { (true, false) } else { (false, true) };
        let control = if giver { &duo.first.control } else { &duo.second.control };
        control.request(RoleRequest::HandOver);
        count(&mut duo, 10, 10);
        assert_eq!((duo.first.is_active(), duo.second.is_active()), (taker, giver), "round {round}");
        for received in &duo.received {
            assert_eq!(received.len(), 10, "each cycle has process data: {received:?}");
            assert!(received.windows(2).all(|pair| pair[0] <= pair[1]), "{received:?}");
        }
        let handed = |role| CyclicStandbyEvent::RoleChanged(role, RoleCause::HandedOver);
        let (left, taken) = match giver {
            true => (duo.first.standby_events(), duo.second.standby_events()),
            false => (duo.second.standby_events(), duo.first.standby_events()),
        };
        assert!(left.contains(&handed(MainDeviceRole::Inactive)), "{left:?}");
        assert!(taken.contains(&handed(MainDeviceRole::Active)), "{taken:?}");
    }
}

// covers: MR-07, REQ015, standby
#[test]
fn a_request_in_each_cycle_hands_the_role_over_as_soon_as_one_does() {
    let cycles_of = |is_repeated: bool| {
        let mut duo = Duo::new(MasterSizes::default());
        count(&mut duo, 0, 5);
        duo.received.iter_mut().for_each(std::vec::Vec::clear);
        duo.first.control.request(RoleRequest::HandOver);
        let mut cycles = 0;
        while duo.first.is_active() {
            count(&mut duo, 5 + cycles, 1);
            cycles += 1;
            assert!(cycles < 20, "the role is never handed over");
            if is_repeated {
                duo.first.control.request(RoleRequest::HandOver);
            }
        }
        assert!(duo.second.is_active());
        duo.received.iter().for_each(|received| assert_eq!(received.len(), usize::from(cycles), "{received:?}"));
        cycles
    };
    assert_eq!(cycles_of(true), cycles_of(false));
}

// covers: MR-07, standby
#[test]
fn a_request_to_stay_active_withdraws_an_offer() {
    let mut duo = Duo::new(MasterSizes::default());
    count(&mut duo, 0, 5);
    duo.first.control.request(RoleRequest::HandOver);
    count(&mut duo, 5, 1);
    duo.first.control.request(RoleRequest::Active);
    count(&mut duo, 6, 20);
    assert!(duo.first.is_active() && !duo.second.is_active());
    duo.received.iter().for_each(|received| assert_eq!(received.len(), 26));
}

// covers: MR-07, MR-05, standby
#[test]
fn an_application_that_ends_withdraws_its_offer_unless_its_last_cycle_has_gone() {
    // The role is offered in the first cycle, and the second one is the last.
    for cycles in 0..=3 {
        let mut duo = Duo::new(MasterSizes::default());
        count(&mut duo, 0, 5);
        duo.drain();
        duo.first.control.request(RoleRequest::HandOver);
        count(&mut duo, 5, cycles);
        duo.first.exchange.end_offers();
        count(&mut duo, 10, 10);
        assert_eq!((duo.first.is_active(), duo.second.is_active()), (cycles < 2, cycles >= 2), "{cycles} cycles");
        let refused = |event: &CyclicStandbyEvent| matches!(event, CyclicStandbyEvent::HandOverRefused(_));
        let events = duo.first.standby_events();
        assert_eq!(events.iter().any(refused), cycles == 0, "{cycles} cycles: {events:?}");
    }
}

// covers: MR-07, standby
#[test]
fn a_role_that_the_other_one_does_not_take_is_kept_and_that_is_reported() {
    let mut duo = Duo::new(MasterSizes::default());
    duo.second.control.set_not_ready(NotReady::HELD.0, true);
    count(&mut duo, 0, 5);
    duo.drain();
    duo.first.control.request(RoleRequest::HandOver);
    count(&mut duo, 5, 60);
    let events = duo.first.standby_events();
    let refused = |event: &CyclicStandbyEvent| matches!(event, CyclicStandbyEvent::HandOverRefused(_));
    assert!(events.iter().any(refused) && duo.first.is_active() && !duo.second.is_active(), "{events:?}");
    duo.second.control.set_not_ready(NotReady::HELD.0, false);
    count(&mut duo, 70, 3);
    duo.first.control.request(RoleRequest::HandOver);
    // It fails at the moment at which it would accept.
    duo.end = End::Closed;
    count(&mut duo, 80, 80);
    assert!(duo.first.is_active() && duo.first.standby_events().iter().any(refused));
}

// covers: MR-07, MR-17, standby
#[test]
fn a_write_that_begins_while_the_role_is_offered_keeps_it_unless_it_is_forced() {
    let write = MemoryWrite::new(WriteKind::File, false, 1);
    for is_forced in [false, true] {
        let mut duo = Duo::new(MasterSizes::default());
        count(&mut duo, 0, 5);
        duo.drain();
        if is_forced {
            duo.first.control.force(RoleRequest::HandOver);
        } else {
            duo.first.control.request(RoleRequest::HandOver);
        }
        count(&mut duo, 5, 1);
        duo.first.words.post_write(Some(write));
        if is_forced {
            // The same once more, without force, takes nothing back.
            duo.first.control.request(RoleRequest::HandOver);
        }
        count(&mut duo, 6, 10);
        assert_eq!((duo.first.is_active(), duo.second.is_active()), (!is_forced, is_forced));
        let refused = CyclicStandbyEvent::RoleRefused(write);
        let events = duo.first.standby_events();
        assert_eq!(events.iter().filter(|event| **event == refused).count(), usize::from(!is_forced), "{events:?}");
        duo.first.words.post_write(None);
        count(&mut duo, 20, 3);
        let control = if is_forced { &duo.second.control } else { &duo.first.control };
        control.request(RoleRequest::HandOver);
        count(&mut duo, 30, 10);
        assert_eq!(duo.first.is_active(), is_forced);
    }
}

// covers: FR-09, 9.8, standby
#[test]
fn an_inactive_begins_a_cycle_with_the_last_frame_or_half_a_period_later() {
    let mut duo = Duo::new(MasterSizes::default());
    duo.cycle();
    let begins_at = |duo: &Duo| duo.second.exchange.inactive_begins_at().expect("it is INACTIVE");
    let after = |duo: &Duo, ns: u64| Instant(duo.now.0 + ns);
    let period = PERIOD.as_nanos() as u64;
    assert_eq!(begins_at(&duo), after(&duo, period * 3 / 2), "the next cycle of the ACTIVE is awaited");
    duo.now += PERIOD;
    duo.first.exchange.begin_role(duo.now);
    duo.run_active(true);
    assert_eq!(begins_at(&duo), Instant(0), "all is here");
    duo.second.exchange.begin_role(duo.now);
    // Only one copy of each frame comes.
    let mut number = 0;
    duo.drop_frame(move |_| {
        number += 1;
        number % 2 == 0
    });
    duo.now += PERIOD;
    duo.first.exchange.begin_role(duo.now);
    duo.run_active(true);
    assert_eq!(begins_at(&duo), after(&duo, period / 2));
    duo.second.board.live.post_carriers([Some(false), Some(true)]);
    assert_eq!(begins_at(&duo), Instant(0), "nothing comes on a dead link");
}

// covers: 9.9, standby
#[test]
fn the_grid_of_the_former_active_goes_on() {
    let mut duo = Duo::new(MasterSizes::default());
    (0..3).for_each(|_| duo.cycle());
    let last = duo.now;
    let period = PERIOD.as_nanos() as u64;
    for late in [1, period / 2, period - 1, 3 * period + 7] {
        let now = Instant(last.0 + late);
        let next = duo.second.exchange.grid_of_other(now).expect("it has seen cycles");
        assert!(next > now && next.0 - now.0 <= period && (next.0 - last.0).is_multiple_of(period));
    }
}
