//! Supervision after activation: passes the words of the cyclic half to the model of the segment, and runs the rounds
//! of reads that the model requests.
//!
//! The exchange posts one word per cycle: how many SubDevices answered on each link, the OR of their AL status, the OR
//! of their event requests. While it does not change, the bus is only used for one round per second.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::register::{DlStatus, map};

use super::frame_limit;
use super::inspect::{read_all_unassigned, read_members};
use super::junction::note_controls;
use super::shared_segment::SharedSegment;
use super::unassigned;
use crate::segment::member::Phase;
use crate::segment::{Observation, Reading, RoundResult, StateRead, SubDeviceKey, UndeclaredObservation};
use crate::supervisor::Bus;

/// Pause before SubDevices that did not answer are read again.
const PAUSE: Duration = Duration::from_micros(500);
/// Pause before SubDevices whose positions could not be determined are read again.
const REPEAT_PAUSE: Duration = Duration::from_millis(2);
/// Pause between two searches for unknown SubDevices.
const SEARCH_PAUSE: Duration = Duration::from_millis(10);

/// Passes posted words to the model, whenever they change or the model requests it. Runs until the MainDevice stops.
pub(super) async fn supervise(bus: Bus, segment: SharedSegment) {
    segment.until_branches_are_open().await;
    loop {
        let (posted, words, seen) = (bus.posted(), segment.words(), segment.view().observed());
        segment.observe(Observation::Words(words));
        let wake = segment.view().next_evaluation();
        let number = words.number().unwrap_or(0);
        let posted = posted.with_next_result(wake.with_result.then_some(number));
        let is_changed = || segment.view().observed() != seen;
        segment.until_posted(posted, wake.at, is_changed).await;
    }
}

/// One round of reads, and the procedures on the bus that follow from it.
pub(super) async fn run_round(bus: Bus, segment: SharedSegment, routine: bool) {
    read_all(&bus, &segment, routine).await;
    let round = segment.view().round();
    if round.is_blind {
        frame_limit::explain(&bus, &segment).await;
    }
    if round.counts {
        follow_up(&bus, &segment).await;
    }
    segment.observe(Observation::RoundEnded(segment.words().number()));
}

async fn read_all(bus: &Bus, segment: &SharedSegment, routine: bool) {
    let versions = segment.view().versions();
    let before: Vec<Phase> = segment.view().members().map(|member| member.phase).collect();
    let settled = segment.view().settled();
    let unassigned = read_all_unassigned(bus, segment).await;
    observe_states(segment, &settled, &unassigned);
    let others = unassigned.iter().filter(|(_, reading)| reading.is_answer()).count();
    let is_calm = || routine && segment.view().is_calm(&segment.words());
    let counted = || segment.words().counted();
    let so_far = |readings: &[Reading]| {
        segment.observe(Observation::PartOfRound { versions, readings, others, counted: counted() });
    };
    let readings = read_members(bus, segment, is_calm, so_far).await;
    let round_result =
        RoundResult { versions, readings: &readings, before: &before, unassigned: &unassigned, counted: counted() };
    segment.observe(Observation::Round(round_result));
}

/// States of SubDevices without a declaration that had reached them before the round.
fn observe_states(segment: &SharedSegment, settled: &[(SubDeviceKey, u32)], read: &[(SubDeviceKey, Reading)]) {
    let reading = |key: SubDeviceKey| read.iter().find(|(other, _)| *other == key).map(|(_, reading)| *reading);
    let read = settled.iter().filter_map(|(key, attempt)| {
        Some(StateRead { key: *key, attempt: Some(*attempt), shown: reading(*key)?.into() })
    });
    let read: Vec<StateRead> = read.collect();
    if !read.is_empty() {
        segment.observe_undeclared(UndeclaredObservation::StatesRead(&read));
    }
}

async fn follow_up(bus: &Bus, segment: &SharedSegment) {
    let round = segment.view().round();
    if round.is_certain && segment.view().has_local_rings() {
        note_controls(bus, segment).await;
    }
    // The other SubDevices must be known before any place can be determined.
    let mut is_complete = round.is_complete;
    if round.finds_others {
        is_complete = unassigned::search(bus, segment).await;
        // Clears the ECAT events of SubDevices that are not read.
        if bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
            segment.observe(Observation::RoundWantedIn(PAUSE));
        }
        segment.observe(Observation::RoundWantedIn(SEARCH_PAUSE));
    }
    if round.is_certain && is_complete && !unassigned::admit_all(bus, segment).await {
        segment.observe(Observation::RoundWantedIn(REPEAT_PAUSE));
    }
}
