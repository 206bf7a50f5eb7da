//! Master frames of this version and of a later one (decision 0130): what a later version appends changes nothing, and
//! where one cannot read the other both name the versions.

use std::vec;
use std::vec::Vec;

use ringcat_wire::master_frame::{Area, NotReady, VERSION, fragments_mut};

use super::duo::{DOMAIN, Device, Duo};
use crate::event::CyclicStandbyEvent;
use crate::layout::MasterSizes;
use crate::role::{Partner, RoleRequest};

const LATER: u8 = VERSION + 1;

/// Makes a device one of a later version, whose frames the versions from `least` on read.
fn make_later(device: &mut Device, least: u8) {
    let state = device.exchange.standby.0.as_deref_mut().expect("it is one of two");
    (state.frames.header.version, state.frames.header.least) = (LATER, least);
    (state.following.answer.version, state.following.answer.least) = (LATER, least);
}

fn versions(device: &mut Device) -> Vec<(u8, u8)> {
    let version = |event| match event {
        CyclicStandbyEvent::OtherVersion { got, least } => Some((got, least)),
        _ => None,
    };
    device.standby_events().into_iter().filter_map(version).collect()
}

// covers: standby, 9.8, MR-15
#[test]
fn two_versions_that_read_each_other_follow_hand_over_and_report_nothing() {
    for later in [0, 1] {
        let mut duo = Duo::new(MasterSizes { to_inactive: 4, to_active: 4, ..MasterSizes::default() });
        make_later(if later == 0 { &mut duo.first } else { &mut duo.second }, VERSION);
        for number in 0..8_u8 {
            duo.first.exchange.image_mut(DOMAIN)[..3].fill(number);
            duo.cycle();
        }
        assert!(duo.first.exchange.partner().is_ready(), "later: {later}, {:?}", duo.first.exchange.partner());
        assert_eq!([&duo.first, &duo.second].map(|it| it.control.readiness()), [NotReady::NOTHING; 2]);
        assert_eq!(duo.second.exchange.image(DOMAIN)[..3], [7; 3]);
        duo.first.control.request(RoleRequest::HandOver);
        (0..6).for_each(|_| duo.cycle());
        assert!(duo.second.is_active() && !duo.first.is_active(), "later: {later}");
        assert_eq!([versions(&mut duo.first), versions(&mut duo.second)], [vec![], vec![]], "later: {later}");
    }
}

// covers: standby, 9.8, MR-15
#[test]
fn both_sides_name_the_versions_where_one_cannot_read_the_other() {
    for later in [0, 1] {
        let mut duo = Duo::new(MasterSizes::default());
        make_later(if later == 0 { &mut duo.first } else { &mut duo.second }, LATER);
        (0..8).for_each(|_| duo.cycle());
        let [active, inactive] = [versions(&mut duo.first), versions(&mut duo.second)];
        // Each names the version of the other one, and the oldest one that reads the later of both.
        let of_this = (VERSION, LATER);
        let of_later = (LATER, LATER);
        let expected = if later == 0 { [vec![of_this], vec![of_later]] } else { [vec![of_later], vec![of_this]] };
        assert_eq!([active, inactive], expected, "later: {later}");
        assert!(!duo.first.exchange.partner().is_ready(), "{:?}", duo.first.exchange.partner());
        for device in [&duo.first, &duo.second] {
            assert!(device.control.readiness().has(NotReady::VERSION), "{later}: {:?}", device.control.readiness());
        }
        // The role stays where it is.
        duo.first.control.request(RoleRequest::HandOver);
        (0..80).for_each(|_| duo.cycle());
        assert!(duo.first.is_active() && !duo.second.is_active(), "later: {later}");
    }
}

// covers: standby, 9.8, FR-10
#[test]
fn areas_and_fields_that_a_later_version_appends_are_left_untouched() {
    let mut duo = Duo::new(MasterSizes { to_active: 4, ..MasterSizes::default() });
    make_later(&mut duo.first, VERSION);
    (0..4).for_each(|_| duo.cycle());
    // A frame of a later version: an area that is not known here has taken the place of a known one.
    let (_, mut frame) = duo.sent.iter().find(|(_, bytes)| super::is_master_frame(bytes)).expect("sent").clone();
    let fragment_of = |frame: &[u8], area: Area| {
        let mut frame = frame.to_vec();
        fragments_mut(&mut frame).find(|it| it.head.area == area).map(|it| (it.data.to_vec(), it.wkc()))
    };
    let at = frame.windows(2).position(|pair| pair == [Area::ToActive.code(), VERSION]).expect("it is there");
    frame[at] = 0x8A;
    let before = fragment_of(&frame, Area::Other(0x8A)).expect("it is there");
    duo.second.exchange.fill(crate::link::Link::Redundant, &mut frame, duo.now);
    assert_eq!(fragment_of(&frame, Area::Other(0x8A)), Some(before), "neither filled nor counted");
    assert_eq!(fragment_of(&frame, Area::Answer).map(|(_, wkc)| wkc), Some(1), "the known ones are");
    assert!(matches!(duo.first.exchange.partner(), Partner::Alive { .. }));
}
