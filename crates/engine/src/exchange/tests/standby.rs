//! Two exchanges in one ring of three SubDevices with one byte out and one byte in each: one is ACTIVE, the other
//! forwards, follows and takes over (protocol 9.6 to 9.8).

mod cuts;
mod duo;
mod handing_over;
mod roles;
mod versions;

use std::vec;
use std::vec::Vec;

use ringcat_wire::master_frame::{Area, NotReady, Stage, fragments_mut, is_master_frame};

use self::duo::{DOMAIN, Duo, End};
use crate::declared::SubDeviceId;
use crate::domain::{DomainState, Freshness};
use crate::event::CyclicStandbyEvent;
use crate::layout::MasterSizes;
use crate::link::Link;
use crate::role::Partner;

// covers: FR-03, FR-05, FR-06, FR-07, FR-08, FR-16, standby
#[test]
fn the_inactive_has_outputs_of_the_cycle_and_inputs_of_the_cycle_before() {
    let mut duo = Duo::new(MasterSizes::default());
    for number in 0..5_u8 {
        duo.first.exchange.image_mut(DOMAIN)[..3].copy_from_slice(&[number, 10 + number, 20 + number]);
        duo.base = 0x40 + number;
        duo.cycle();
    }
    assert_eq!(duo.first.exchange.image(DOMAIN), [4, 14, 24, 0x44, 0x45, 0x46]);
    assert_eq!(duo.second.exchange.image(DOMAIN), [4, 14, 24, 0x43, 0x44, 0x45], "inputs are those that were merged");
    let status = duo.second.exchange.status(DOMAIN).unwrap();
    assert_eq!((status.state, status.wkc, status.expected), (DomainState::Complete, 6, 6));
    let fresh = [0, 1, 2].map(|it| duo.second.exchange.freshness(DOMAIN, SubDeviceId(it)));
    assert_eq!(fresh, [Freshness::Fresh; 3]);
    let kinds: Vec<bool> = duo.sent.iter().map(|(_, frame)| is_master_frame(frame)).collect();
    assert_eq!(kinds, [false, false, true, true], "process data first, then master frames, each on both links");
}

// covers: FR-04, FR-12, FR-15, REQ027, standby
#[test]
fn process_data_of_both_maindevices_arrives_at_the_other_one() {
    let sizes = MasterSizes { to_inactive: 4, to_active: 3, ..MasterSizes::default() };
    let mut duo = Duo::new(sizes);
    assert!(duo.first.exchange.from_partner().is_empty() && duo.second.exchange.from_partner().is_empty());
    duo.first.exchange.to_partner_mut().copy_from_slice(b"ping");
    duo.second.exchange.to_partner_mut().copy_from_slice(b"abc");
    duo.cycle();
    assert_eq!(duo.second.exchange.from_partner(), b"ping");
    assert_eq!(duo.first.exchange.from_partner(), b"abc");
    let mut none = Duo::new(MasterSizes::default());
    none.cycle();
    assert!(none.first.exchange.to_partner_mut().is_empty() && none.first.exchange.from_partner().is_empty());
}

// covers: FR-10, FR-11, standby
#[test]
fn working_counters_of_master_frames_are_those_of_one_pass_in_both_copies() {
    let mut duo = Duo::new(MasterSizes { to_active: 3, ..MasterSizes::default() });
    duo.cycle();
    let mut counted = 0;
    for (_, frame) in &duo.back {
        for fragment in fragments_mut(&mut frame.clone()) {
            assert_eq!(fragment.wkc(), fragment.head.area.weight(), "{:?}", fragment.head.area);
            counted += 1;
        }
    }
    assert!(counted >= 2 * 7, "{counted}");
    (0..3).for_each(|_| duo.cycle());
    assert!(duo.first.exchange.partner().is_ready(), "{:?}", duo.first.exchange.partner());
}

// covers: 9.8, standby
#[test]
fn both_copies_of_a_cycle_carry_the_same_answer_and_data() {
    let mut duo = Duo::new(MasterSizes { to_active: 3, ..MasterSizes::default() });
    for number in 0..4 {
        duo.between_copies = Some(|second| second.exchange.to_partner_mut()[0] += 1);
        duo.second.exchange.to_partner_mut()[1] = number;
        duo.cycle();
        let of = |link: Link| {
            let (_, frame) = duo.back.iter().rev().find(|(on, frame)| *on == link && is_master_frame(frame)).unwrap();
            let mut frame = frame.clone();
            let of_inactive = fragments_mut(&mut frame).filter(|it| it.head.area.is_to_active());
            of_inactive.map(|it| it.data.to_vec()).collect::<Vec<_>>()
        };
        assert_eq!(of(Link::Main), of(Link::Redundant));
    }
}

// covers: 9.8, FR-06, standby
#[test]
fn a_cycle_that_did_not_arrive_as_a_whole_changes_nothing_at_the_inactive() {
    let sizes = MasterSizes { to_inactive: 2000, ..MasterSizes::default() };
    let mut duo = Duo::new(sizes);
    duo.cycle();
    let whole = duo.second.exchange.from_partner().to_vec();
    duo.first.exchange.to_partner_mut().fill(7);
    // Both copies of the second master frame are lost.
    let mut number = 0;
    duo.drop_frame(move |frame| {
        number += i32::from(is_master_frame(frame));
        is_master_frame(frame) && (number + 1) / 2 == 2
    });
    duo.cycle();
    assert_eq!(duo.second.exchange.from_partner(), whole);
    duo.is_losing = false;
    duo.cycle();
    assert!(duo.second.exchange.from_partner().iter().all(|byte| *byte == 7));
}

// covers: 9.8, standby
#[test]
fn one_copy_of_each_frame_is_enough_whatever_copy_it_is() {
    let sizes = MasterSizes { to_inactive: 2000, to_active: 2000, ..MasterSizes::default() };
    let mut duo = Duo::new(sizes);
    for round in 0..40_u32 {
        duo.first.exchange.to_partner_mut().fill(round as u8);
        duo.second.exchange.to_partner_mut().fill(100 + round as u8);
        let mut number = 0;
        // Of each frame one copy is lost, on its way to the INACTIVE.
        duo.drop_frame(move |_| {
            number += 1;
            let (frame, copy) = ((number - 1) / 2, (number - 1) % 2);
            copy == (round >> (frame % 5)) % 2
        });
        duo.cycle();
        assert!(duo.second.exchange.from_partner().iter().all(|byte| *byte == round as u8), "round {round}");
        assert!(duo.first.exchange.from_partner().iter().all(|byte| *byte == 100 + round as u8), "round {round}");
    }
}

// covers: FR-13, standby
#[test]
fn without_the_area_of_inputs_the_inactive_has_outputs_alone() {
    let mut duo = Duo::new(MasterSizes { inputs: false, ..MasterSizes::default() });
    duo.first.exchange.image_mut(DOMAIN)[..3].copy_from_slice(&[1, 2, 3]);
    (0..3).for_each(|_| duo.cycle());
    assert_eq!(duo.second.exchange.image(DOMAIN), [1, 2, 3, 0, 0, 0]);
    assert_eq!(duo.second.exchange.freshness(DOMAIN, SubDeviceId(0)), Freshness::Never);
}

// covers: MR-13, MR-14, MR-19, REQ043, REQ045, standby
#[test]
fn states_and_diagnosis_of_the_active_are_those_of_the_inactive() {
    let mut duo = Duo::new(MasterSizes::default());
    (0..3).for_each(|_| duo.cycle());
    duo.answering = vec![0, 1];
    duo.first.board.live.post_presence(2, crate::board::live::Presence::Offline);
    duo.drain();
    (0..3).for_each(|_| duo.cycle());
    assert_eq!(duo.first.exchange.status(DOMAIN).unwrap().state, DomainState::Incomplete);
    let status = duo.second.exchange.status(DOMAIN).unwrap();
    assert_eq!((status.state, status.wkc, status.expected), (DomainState::Incomplete, 4, 6));
    assert!(duo.second.events().iter().all(|event| matches!(event, crate::event::CyclicEvent::Standby(_))));
    let lives = [0, 1, 2].map(|it| duo.second.board.live.life(it).unwrap());
    assert_eq!(lives.map(|life| life.al_status & 0x0F), [8, 8, 0]);
    assert_eq!(duo.second.exchange.ring(), crate::ring::RingState::Unknown, "it sends nothing itself");
    assert_eq!(duo.second.board.ring().state, crate::ring::RingState::Closed);
    let (_, seen) = duo.second.board.supervision().unwrap();
    assert_eq!(seen.main.0, 2, "{seen:?}");
    let (_, diagnosis) = duo.second.words.diagnosis.copy().unwrap();
    assert_eq!(diagnosis.len(), 57);
}

// covers: FR-11, MR-07, standby
#[test]
fn the_active_distinguishes_a_bare_forwarder_and_detects_both_ends() {
    let mut duo = Duo::new(MasterSizes::default());
    duo.is_bare = true;
    (0..5).for_each(|_| duo.cycle());
    assert_eq!(duo.first.exchange.partner(), Partner::Forwards);
    duo.is_bare = false;
    (0..3).for_each(|_| duo.cycle());
    let alive = duo.first.exchange.partner();
    assert!(matches!(alive, Partner::Alive { stage: Stage::Ready, is_consistent: true, .. }), "{alive:?}");
    duo.end = End::Closed;
    (0..5).for_each(|_| duo.cycle());
    assert_eq!(duo.first.exchange.partner(), Partner::Absent);
    let partners: Vec<Partner> = duo
        .first
        .standby_events()
        .into_iter()
        .filter_map(|event| match event {
            CyclicStandbyEvent::Partner(partner) => Some(partner),
            _ => None,
        })
        .collect();
    let kinds: Vec<u8> = partners
        .iter()
        .map(|partner| match partner {
            Partner::Absent => 0,
            Partner::Forwards => 1,
            Partner::Alive { not_ready, .. } => 2 + u8::from(!not_ready.is_ready()),
        })
        .collect();
    assert_eq!(kinds, [1, 3, 2, 0], "{partners:?}");
}

// covers: REQ010, MR-15, standby
#[test]
fn different_configurations_are_reported_on_both_sides_and_prevent_a_takeover() {
    let mut duo = Duo::with_items(MasterSizes::default(), (7, &[1, 2, 3]), (8, &[1, 2, 9]));
    (0..10).for_each(|_| duo.cycle());
    for end in [&mut duo.first, &mut duo.second] {
        let differing: Vec<_> =
            end.standby_events().into_iter().filter(|event| matches!(event, CyclicStandbyEvent::Item(_))).collect();
        assert_eq!(differing, [CyclicStandbyEvent::Item(2)]);
    }
    let partner = duo.first.exchange.partner();
    assert!(matches!(partner, Partner::Alive { not_ready, .. } if not_ready.has(NotReady::IDENTITY)), "{partner:?}");
}

// covers: 9.8, standby
#[test]
fn knowledge_arrives_piece_by_piece_and_a_newer_one_replaces_it() {
    let mut duo = Duo::new(MasterSizes { knowledge: 100, ..MasterSizes::default() });
    let bytes = |first: usize, count: usize| (first..first + count).map(|it| it as u8).collect::<Vec<u8>>();
    assert!(duo.first.words.knowledge.write(&bytes(3, 1000)));
    (0..11).for_each(|_| duo.cycle());
    assert_eq!(duo.second.words.partner_knowledge.copy().map(|(_, bytes)| bytes), Some(bytes(3, 1000)));
    // A lost cycle costs a round of pieces.
    assert!(duo.first.words.knowledge.write(&bytes(5, 777)));
    duo.cycle();
    assert_eq!(duo.second.words.partner_knowledge.copy(), None, "it is on its way");
    duo.drop_frame(is_master_frame);
    duo.cycle();
    duo.is_losing = false;
    (0..20).for_each(|_| duo.cycle());
    assert_eq!(duo.second.words.partner_knowledge.copy().map(|(_, bytes)| bytes), Some(bytes(5, 777)));
    assert_eq!(duo.first.fragment_lengths().iter().find(|(area, _)| *area == Area::Knowledge).unwrap().1, 104);
}
