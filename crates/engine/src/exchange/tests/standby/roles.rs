//! Roles of both exchanges: requests, takeover, collision (protocol 9.6).

use std::vec::Vec;

use super::duo::{DOMAIN, Device, Duo, End, PERIOD};
use crate::board::live::Presence;
use crate::event::CyclicStandbyEvent;
use crate::exchange::Received;
use crate::layout::MasterSizes;
use crate::link::Link;
use crate::role::{MainDeviceRole, RoleCause, RoleRequest};

fn sizes() -> MasterSizes {
    MasterSizes { to_inactive: 2, to_active: 2, ..MasterSizes::default() }
}

fn duo() -> Duo {
    Duo::new(sizes())
}

// covers: MR-02, MR-03, MR-04, MR-07, REQ003, REQ014, standby
#[test]
fn a_requested_role_takes_effect_at_the_next_cycle_and_is_reported_once() {
    let mut duo = duo();
    (0..3).for_each(|_| duo.cycle());
    duo.drain();
    duo.end = End::Closed;
    duo.second.control.request(RoleRequest::Inactive);
    duo.second.control.request(RoleRequest::Active);
    assert!(!duo.second.is_active(), "before the next cycle");
    assert_eq!(duo.second.exchange.begin_role(duo.now + PERIOD), Some(MainDeviceRole::Active));
    assert_eq!(duo.second.control.role(), MainDeviceRole::Active);
    let changed = CyclicStandbyEvent::RoleChanged(MainDeviceRole::Active, RoleCause::Requested);
    let events = duo.second.standby_events();
    assert!(events.contains(&changed) && events.len() == 2, "{events:?}");
    assert!(matches!(
        events[1],
        CyclicStandbyEvent::TookOver { in_state: 3, is_hot: true, silence: Some(_), cut: None }
    ));
    duo.second.control.request(RoleRequest::Active);
    assert_eq!(duo.second.exchange.begin_role(duo.now + PERIOD), None);
    assert!(duo.second.standby_events().is_empty(), "the present role is no change");
}

// covers: MR-05, MR-06, CF-04, standby
#[test]
fn the_inactive_sends_nothing_and_two_of_them_send_nothing() {
    let mut duo = duo();
    (0..3).for_each(|_| duo.cycle());
    duo.first.control.request(RoleRequest::Inactive);
    for _ in 0..5 {
        duo.now += PERIOD;
        for device in [&mut duo.first, &mut duo.second] {
            device.exchange.begin_role(duo.now);
            assert!(!device.is_active());
            device.exchange.process(DOMAIN, duo.now);
            assert!(!device.exchange.queue(DOMAIN, duo.now));
            device.exchange.send(duo.now, &mut |_, _| panic!("an INACTIVE MainDevice sends nothing"));
        }
    }
}

// covers: MR-07, MR-16, standby
#[test]
fn the_first_cycle_of_a_takeover_has_the_latest_outputs_and_merged_inputs() {
    let mut duo = duo();
    for number in 0..4_u8 {
        duo.first.exchange.image_mut(DOMAIN)[..3].fill(number);
        duo.base = 0x40 + 8 * number;
        duo.cycle();
    }
    // The ACTIVE fails.
    duo.first.control.request(RoleRequest::Inactive);
    duo.first.exchange.begin_role(duo.now);
    duo.second.control.request(RoleRequest::Active);
    duo.received.iter_mut().for_each(Vec::clear);
    duo.now += PERIOD;
    duo.second.exchange.begin_role(duo.now);
    assert_eq!(duo.second.exchange.image(DOMAIN)[..3], [3; 3], "outputs as they were");
    assert_eq!(duo.second.exchange.image(DOMAIN)[3..], [0x50, 0x51, 0x52], "inputs of the cycle before");
    duo.run_active(false);
    assert_eq!(duo.received, [[3], [3], [3]], "process data leaves in the first cycle");
    assert_eq!(duo.second.exchange.image(DOMAIN)[3..], [0x58, 0x59, 0x5A]);
    for number in 4..7 {
        duo.second.exchange.image_mut(DOMAIN)[..3].fill(number);
        duo.cycle();
    }
    assert_eq!(duo.received[0], [3, 4, 5, 6]);
    assert_eq!(duo.first.exchange.image(DOMAIN)[..3], [6; 3], "the former ACTIVE follows now");
    assert!(duo.second.exchange.partner().is_ready(), "{:?}", duo.second.exchange.partner());
}

// covers: MR-07, 9.9, standby
#[test]
fn outputs_of_a_cycle_that_was_cut_off_never_go_back_to_those_before() {
    let mut duo = duo();
    duo.first.exchange.image_mut(DOMAIN)[..3].fill(1);
    (0..3).for_each(|_| duo.cycle());
    // The ACTIVE fails after its frame with process data: no master frame of this cycle arrives.
    duo.first.exchange.image_mut(DOMAIN)[..3].fill(2);
    duo.drop_frame(ringcat_wire::master_frame::is_master_frame);
    duo.cycle();
    duo.second.exchange.begin_role(duo.now);
    assert_eq!(duo.second.exchange.image(DOMAIN)[..3], [1; 3], "the application gets whole cycles");
    duo.second.control.request(RoleRequest::Active);
    duo.second.exchange.begin_role(duo.now);
    assert_eq!(duo.second.exchange.image(DOMAIN)[..3], [2; 3], "the SubDevices have these");
}

// covers: MR-10, REQ017, standby
#[test]
fn a_frame_of_another_maindevice_is_a_collision_in_the_cycle_in_which_it_comes() {
    let mut duo = duo();
    (0..3).for_each(|_| duo.cycle());
    duo.second.control.request(RoleRequest::Active);
    duo.now += PERIOD;
    duo.second.exchange.begin_role(duo.now);
    duo.drain();
    let mut sent = Vec::new();
    duo.second.exchange.queue(DOMAIN, duo.now);
    duo.second.exchange.send(duo.now, &mut |link, bytes| sent.push((link, bytes.to_vec())));
    for (link, frame) in &sent {
        assert_eq!(duo.first.exchange.receive(link.other(), frame, duo.now), Received::Foreign);
    }
    let events = duo.first.standby_events();
    assert!(matches!(events[..], [CyclicStandbyEvent::Collision { arrived_on: Link::Redundant, .. }]), "{events:?}");
    assert!(duo.first.exchange.pop_foreign().is_some(), "the frame is given to the application");
    assert!(duo.first.is_active(), "what follows is the matter of the application");
}

// covers: MR-25, 9.16, standby
#[test]
fn an_active_without_links_becomes_inactive() {
    let mut duo = duo();
    (0..3).for_each(|_| duo.cycle());
    duo.drain();
    duo.first.board.live.post_carriers([Some(false), Some(true)]);
    duo.first.exchange.begin_role(duo.now);
    assert!(duo.first.is_active(), "one link is left");
    duo.first.board.live.post_carriers([Some(false); 2]);
    duo.first.exchange.begin_role(duo.now);
    let lost = CyclicStandbyEvent::RoleChanged(MainDeviceRole::Inactive, RoleCause::LinksLost);
    assert_eq!(duo.first.standby_events(), [lost]);
}

// covers: MR-25, standby
#[test]
fn an_active_without_links_stays_active_where_it_does_not_yield() {
    let mut duo = duo();
    duo.first.exchange.standby.0.as_mut().expect("it is one of two").yields_without_links = false;
    (0..3).for_each(|_| duo.cycle());
    duo.drain();
    duo.first.board.live.post_carriers([Some(false); 2]);
    duo.first.exchange.begin_role(duo.now);
    assert!(duo.first.is_active());
    assert_eq!(duo.first.standby_events(), []);
}

// covers: MR-16, MR-18, standby
#[test]
fn a_takeover_before_the_first_cycle_as_inactive_has_the_states_of_the_other_one() {
    let mut duo = duo();
    for _ in 0..3 {
        duo.now += PERIOD;
        duo.first.exchange.begin_role(duo.now);
        duo.run_active(true);
    }
    duo.second.control.request(RoleRequest::Active);
    duo.second.exchange.begin_role(duo.now);
    let lives = |device: &Device| [0, 1, 2].map(|subdevice| device.board.live.life(subdevice).expect("it is declared"));
    assert_eq!(lives(&duo.second), lives(&duo.first));
    assert_eq!(lives(&duo.second)[0].presence, Presence::Settled);
    assert!(!duo.second.board.is_silent(), "they are known");
}

// covers: MR-18, MR-26, standby
#[test]
fn an_active_that_starts_again_is_followed_at_once_without_data_from_before() {
    let mut duo = duo();
    (0..40).for_each(|_| duo.cycle());
    duo.first = Device::new(0x10, MainDeviceRole::Active, sizes(), (7, &[1]));
    duo.now += PERIOD * 6;
    duo.second.exchange.begin_role(duo.now);
    assert!(duo.second.board.is_silent());
    (0..4).for_each(|_| duo.cycle());
    assert!(!duo.second.board.is_silent() && duo.first.exchange.partner().is_ready());
    let whole = duo.second.exchange.standby.0.as_ref().and_then(|state| state.following.whole());
    assert!(whole.is_some_and(|whole| whole.cycle <= 4), "of the count that began anew");
    // The ACTIVE starts again, in another session: its registers are not those of the previous session.
    (0..30).for_each(|_| duo.cycle());
    duo.first = Device::new(0x10, MainDeviceRole::Active, sizes(), (7, &[1]));
    duo.first.exchange.standby.0.as_mut().expect("it is one of two").frames.header.session = 5;
    (0..3).for_each(|_| duo.cycle());
    duo.drain();
    duo.second.control.request(RoleRequest::Active);
    duo.second.exchange.begin_role(duo.now);
    let took_over = duo.second.standby_events();
    let is_warm = |event: &CyclicStandbyEvent| matches!(event, CyclicStandbyEvent::TookOver { is_hot: false, .. });
    assert!(took_over.iter().any(is_warm), "{took_over:?}");
}

// covers: MR-08, 9.10, standby
#[test]
fn an_inactive_never_takes_over_by_itself() {
    let mut duo = duo();
    (0..3).for_each(|_| duo.cycle());
    for _ in 0..10_000 {
        duo.now += PERIOD;
        assert_eq!(duo.second.exchange.begin_role(duo.now), None);
    }
    assert!(!duo.second.is_active() && duo.second.exchange.partner_data_at().is_some_and(|at| at < duo.now));
}
