//! Layouts of literal and random domains.

use core::time::Duration;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::declared::SubDeviceId;
use crate::direction::Direction;

fn area(subdevice: usize, sync_manager: u8, direction: Direction, length: u16) -> AreaSpec {
    AreaSpec { subdevice, sync_manager, direction, length }
}

fn spec(areas: Vec<AreaSpec>) -> DomainSpec {
    DomainSpec { period: Duration::from_millis(1), under_way: 1, lrw: true, areas, image: ImageOrder::Packed }
}

/// Two links, and separate datagrams for each SubDevice.
fn each(supervision: bool) -> Rules<'static> {
    Rules {
        links: LinkSet::Ring,
        supervision,
        lrw: LrwPolicy::PerSubDevice,
        witnesses: &[],
        session: 0,
        max_datagrams: None,
    }
}

// covers: layout
#[test]
fn one_link_uses_lrw_and_two_links_use_lwr_and_lrd() {
    let areas =
        vec![area(0, 2, Direction::Outputs, 4), area(0, 3, Direction::Inputs, 6), area(1, 0, Direction::Outputs, 1)];
    let single = Layout::new(&[spec(areas.clone())], LinkSet::Single, false).unwrap();
    let frame = &single.domains[0].frames[0];
    assert_eq!(frame.datagrams.len(), 1);
    assert_eq!(frame.datagrams[0].command, Command::Lrw);
    assert_eq!((frame.datagrams[0].outputs, frame.datagrams[0].inputs), (5, 6));
    // protocol 1.4: LRW read +1, write +2.
    assert_eq!(frame.datagrams[0].contributions, vec![(0, Wkc(3)), (1, Wkc(2))]);

    let ring = Layout::new(&[spec(areas)], LinkSet::Ring, false).unwrap();
    let commands: Vec<_> = ring.domains[0].frames[0].datagrams.iter().map(|d| (d.command, d.logical.0)).collect();
    assert_eq!(commands, vec![(Command::Lwr, 0), (Command::Lrd, 5)]);
    assert_eq!(ring.domains[0].frames[0].datagrams[1].contributions, vec![(0, Wkc(1))]);
}

// covers: CR-16, 9.2.2, layout
#[test]
fn one_lrw_per_subdevice_is_allowed_on_two_links() {
    let pair = |n: usize, out, inp| [area(n, 2, Direction::Outputs, out), area(n, 3, Direction::Inputs, inp)];
    let areas: Vec<_> = (0..3).flat_map(|n| pair(n, 4, 6)).chain([area(3, 3, Direction::Inputs, 2)]).collect();
    let layout = Layout::with(&[spec(areas)], each(true)).unwrap();
    let frames = &layout.domains[0].frames;
    assert_eq!(frames.len(), 1, "datagrams share a frame");
    let datagrams: Vec<_> =
        frames[0].datagrams.iter().map(|d| (d.command, d.logical.0, d.contributions.clone())).collect();
    assert_eq!(
        datagrams,
        [
            (Command::Lrw, 0, vec![(0, Wkc(3))]),
            (Command::Lrw, 10, vec![(1, Wkc(3))]),
            (Command::Lrw, 20, vec![(2, Wkc(3))]),
            (Command::Lrd, 30, vec![(3, Wkc(1))]),
        ]
    );
    let large: Vec<_> = (0..4).flat_map(|n| pair(n, 700, 700)).collect();
    let layout = Layout::with(&[spec(large)], each(false)).unwrap();
    assert_eq!(layout.domains[0].frames.len(), 4);
    assert!(layout.domains[0].frames.iter().all(|frame| frame.used() <= MAX_DATA + OVERHEAD));
}

/// Two inputs and outputs each of SubDevices with this witness, one frame.
fn witnessed(witnesses: &[Witness], links: LinkSet) -> PlannedFrame {
    let pair = |n: usize| [area(n, 2, Direction::Outputs, 2), area(n, 3, Direction::Inputs, 2)];
    let areas: Vec<_> = (0..witnesses.len()).flat_map(pair).collect();
    let rules =
        Rules { links, supervision: false, lrw: LrwPolicy::Automatic, witnesses, session: 0, max_datagrams: None };
    let layout = Layout::with(&[spec(areas)], rules).unwrap();
    assert_eq!(layout.domains[0].frames.len(), 1);
    layout.domains[0].frames[0].clone()
}

const MAPPED: Witness = Witness::Mapped(Delivers::FromSafeOp);

#[test]
fn several_subdevices_of_a_datagram_show_their_al_status_behind_it() {
    for links in [LinkSet::Single, LinkSet::Ring] {
        let frame = witnessed(&[MAPPED, Witness::Mapped(Delivers::InOp), MAPPED], links);
        let presence = frame.presence.unwrap();
        assert_eq!(presence.logical, LogicalAddress(0xE000_0000));
        let members = [(0, Delivers::FromSafeOp), (1, Delivers::InOp), (2, Delivers::FromSafeOp)];
        assert_eq!(presence.members, members);
    }
    assert_eq!(witnessed(&[MAPPED], LinkSet::Single).presence, None, "its working counter is exact");
}

// covers: freshness
#[test]
fn inputs_of_a_subdevice_without_an_fmmu_to_spare_have_a_datagram_of_their_own() {
    let found = |links| {
        let frame = witnessed(&[MAPPED, Witness::Alone, MAPPED, Witness::Alone], links);
        let members: Vec<usize> = frame.presence.unwrap().members.iter().map(|(subdevice, _)| *subdevice).collect();
        assert_eq!(members, [0, 2]);
        let of = |d: &PlannedDatagram| (d.command, d.contributions.iter().map(|(s, _)| *s).collect::<Vec<_>>());
        frame.datagrams.iter().map(of).collect::<Vec<_>>()
    };
    let (lrw, lrd, lwr) = (Command::Lrw, Command::Lrd, Command::Lwr);
    assert_eq!(found(LinkSet::Single), [(lrw, vec![0, 2]), (lrw, vec![1]), (lrw, vec![3])]);
    let ring = [(lwr, vec![0, 2]), (lrd, vec![0, 2]), (lwr, vec![1, 3]), (lrd, vec![1]), (lrd, vec![3])];
    assert_eq!(found(LinkSet::Ring), ring);
}

#[test]
fn presence_is_shown_where_inputs_share_a_working_counter_and_in_one_domain() {
    let outputs = spec((0..2).map(|n| area(n, 2, Direction::Outputs, 2)).collect());
    let inputs = spec((0..2).map(|n| area(n, 3, Direction::Inputs, 2)).collect());
    let others = spec((0..2).map(|n| area(n, 4, Direction::Inputs, 2)).collect());
    let layout = Layout::new(&[outputs, inputs, others], LinkSet::Single, false).unwrap();
    let frames = layout.domains.iter().map(|domain| &domain.frames[0]);
    let shape: Vec<_> = frames.map(|frame| (frame.datagrams.len(), frame.presence.is_some())).collect();
    assert_eq!(shape, [(1, false), (1, true), (2, false)]);
    assert_eq!(layout.presence(1), Some(LogicalAddress(0xE000_0001)));
}

#[test]
fn sessions_have_logical_addresses_of_their_own() {
    let of = |session| {
        let areas = (0..2).map(|n| area(n, 3, Direction::Inputs, 2)).collect();
        let (links, lrw) = (LinkSet::Single, LrwPolicy::Automatic);
        let rules = Rules { links, supervision: false, lrw, witnesses: &[], session, max_datagrams: None };
        let layout = Layout::with(&[spec(areas)], rules).unwrap();
        (layout.area(1, 3).unwrap().1.logical.0, layout.presence(1).unwrap().0, layout.domains[0].image_len)
    };
    assert_eq!(of(0), (2, 0xE000_0001, 4));
    assert_eq!(of(3), (0x0030_0002, 0xE003_0001, 4));
    assert_eq!(of(SESSIONS + 3), of(3));
    assert!(of(SESSIONS - 1).0 < 1 << 30);
}

#[test]
fn two_areas_of_one_subdevice_count_once_per_direction() {
    let areas = vec![area(0, 3, Direction::Inputs, 2), area(0, 4, Direction::Inputs, 2)];
    let layout = Layout::new(&[spec(areas)], LinkSet::Single, false).unwrap();
    assert_eq!(layout.domains[0].frames[0].datagrams[0].contributions, vec![(0, Wkc(1))]);
}

// covers: layout
#[test]
fn a_domain_larger_than_a_frame_is_cut_between_areas() {
    let areas = (0..4).map(|n| area(n, 3, Direction::Inputs, 700)).collect();
    let layout = Layout::new(&[spec(areas)], LinkSet::Single, true).unwrap();
    let lengths: Vec<_> = layout.domains[0].frames.iter().map(|f| f.datagrams[0].inputs).collect();
    assert_eq!(lengths, vec![1400, 1400]);
    assert_eq!(layout.area(3, 3).unwrap().1.logical, LogicalAddress(2100));
}

#[test]
fn an_area_beyond_a_datagram_is_refused_with_its_name() {
    let error = Layout::new(&[spec(vec![area(7, 3, Direction::Inputs, 1487)])], LinkSet::Single, false).unwrap_err();
    assert_eq!(error, LayoutError::AreaTooLong { subdevice: SubDeviceId(7), sync_manager: 3, length: 1487 });
    let full = Layout::new(&[spec(vec![area(7, 3, Direction::Inputs, 1486)])], LinkSet::Single, true).unwrap();
    // No room left for the supervision datagram: it has a frame of its own.
    assert_eq!(full.domains[0].frames.len(), 2);
    assert!(full.domains[0].frames[1].supervision);
}

proptest! {
    // covers: layout
    #[test]
    fn areas_are_disjoint_and_frames_fit(
        lengths in proptest::collection::vec((0u16..1000, 0u16..1000, any::<bool>()), 1..40), ring: bool, lrw: bool,
    ) {
        let (mut areas, mut witnesses) = (Vec::new(), Vec::new());
        for (n, (out, inp, alone)) in lengths.iter().enumerate() {
            areas.push(area(n, 2, Direction::Outputs, *out));
            areas.push(area(n, 3, Direction::Inputs, *inp));
            witnesses.push(if *alone { Witness::Alone } else { MAPPED });
        }
        let links = if ring { LinkSet::Ring } else { LinkSet::Single };
        let rules = Rules {
            witnesses: &witnesses,
            links,
            supervision: true,
            lrw: LrwPolicy::Automatic,
            session: 0,
            max_datagrams: None,
        };
        let layout = Layout::with(&[DomainSpec { lrw, ..spec(areas) }], rules).unwrap();
        let domain = &layout.domains[0];
        let mut end = 0;
        for placed in &domain.areas {
            prop_assert_eq!(placed.image_offset, end);
            prop_assert_eq!(placed.logical.0, end);
            end += u32::from(placed.area.length);
        }
        prop_assert_eq!(end, domain.image_len);
        let total: u32 = lengths.iter().map(|(o, i, _)| u32::from(*o) + u32::from(*i)).sum();
        prop_assert_eq!(end, total);
        for frame in &domain.frames {
            let supervision = if frame.supervision { OVERHEAD + SUPERVISION_LEN } else { 0 };
            prop_assert!(frame.used() + supervision <= MAX_DATA + OVERHEAD);
            // No sum of working counters hides a missing input.
            for datagram in frame.datagrams.iter().filter(|d| d.inputs > 0 && d.contributions.len() > 1) {
                let shown = |subdevice| frame.presence.iter().flat_map(|it| &it.members).any(|(s, _)| *s == subdevice);
                prop_assert!(datagram.contributions.iter().all(|(subdevice, _)| shown(*subdevice)));
            }
            if ring {
                prop_assert!(frame.datagrams.iter().all(|d| d.command != Command::Lrw));
            }
        }
        prop_assert_eq!(domain.frames.iter().filter(|f| f.supervision).count(), 1);
    }
}
