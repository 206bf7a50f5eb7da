//! Supervision after activation: what the cyclic half posts is handed to the model of the segment, and rounds of looks
//! that it calls for are made.
//!
//! The exchange posts one word per cycle: how many SubDevices answered on each link, the OR of their AL status, the OR
//! of their event requests. As long as it does not change, nothing is asked of the bus but one look per second.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::register::{DlStatus, map};

use super::frame_limit;
use super::inspect::{look_at_all, look_at_unassigned};
use super::junction::note_controls;
use super::shared_segment::SharedSegment;
use super::unassigned::{self, Search};
use crate::segment::member::Phase;
use crate::segment::{Look, Looked, Observation};
use crate::supervisor::Bus;

/// Pause before what may be missed is looked at again.
const PAUSE: Duration = Duration::from_micros(500);
/// Pause before SubDevices of which it was not found out where they are are looked at again.
const SECOND_LOOK_PAUSE: Duration = Duration::from_millis(2);
/// Pause between two searches for SubDevices that answer and are not known.
const SEARCH_PAUSE: Duration = Duration::from_millis(10);

/// Hands over what is posted, whenever it changes or the model wants to look. Runs for ever.
pub(crate) async fn supervise(bus: Bus, segment: SharedSegment) {
    loop {
        let posted = bus.posted();
        segment.observe(Observation::Words(segment.words()));
        let wake = segment.view().next_look();
        segment.until_news(posted, wake).await;
    }
}

/// One round of looks, and what has to be done on the bus because of it.
pub(super) async fn look_round(bus: Bus, segment: SharedSegment, routine: bool, search: Search) {
    look(&bus, &segment, routine).await;
    let round = segment.view().round();
    if round.is_blind {
        frame_limit::explain(&bus, &segment).await;
    }
    if round.counts {
        follow_up(&bus, &segment, &search).await;
    }
    let number = segment.board.supervision().map(|(number, _)| number);
    segment.observe(Observation::RoundEnded(number));
}

async fn look(bus: &Bus, segment: &SharedSegment, routine: bool) {
    let asked = segment.view().asked();
    let before: Vec<Phase> = segment.view().members.iter().map(|member| member.phase).collect();
    let unassigned = look_at_unassigned(bus, segment).await;
    let others = unassigned.iter().filter(|(_, look)| look.is_answer()).count();
    let is_calm = || routine && segment.view().is_calm(&segment.words());
    let counted = || segment.board.supervision().map(|(_, seen)| seen.total());
    let so_far = |looks: &[Look]| {
        segment.observe(Observation::PartOfLooks { asked, looks, others, counted: counted() });
    };
    let looks = look_at_all(bus, segment, is_calm, so_far).await;
    let looked = Looked { asked, looks: &looks, before: &before, unassigned: &unassigned, counted: counted() };
    segment.observe(Observation::Looks(looked));
}

async fn follow_up(bus: &Bus, segment: &SharedSegment, search: &Search) {
    let round = segment.view().round();
    if round.is_certain && segment.view().has_local_rings() {
        note_controls(bus, segment).await;
    }
    // Which others are there must be known before the place of any is.
    let mut is_complete = round.is_complete;
    if round.finds_others {
        is_complete = search.run(bus, segment).await;
        // Clears the requests of those that are not looked at.
        if bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
            segment.observe(Observation::LookAgainIn(PAUSE));
        }
        segment.observe(Observation::LookAgainIn(SEARCH_PAUSE));
    }
    if round.is_certain && is_complete && !unassigned::admit_all(bus, segment).await {
        segment.observe(Observation::LookAgainIn(SECOND_LOOK_PAUSE));
    }
}
