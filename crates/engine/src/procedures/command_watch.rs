//! Reports datagrams whose working counters differ from the expected ones, while that is wanted (Master Redundancy,
//! EC_NOTIFY_CYCCMD_WKC_ERROR).
//!
//! The exchange counts those of process data on the board; here the counts become events with names, at most one per
//! datagram a second. Acyclic ones are condensed by the supervisor; here those that have waited are reported.

use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use super::shared_segment::SharedSegment;
use crate::board::Board;
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::event::Notice;
use crate::layout::PlannedDatagram;
use crate::segment::Segment;
use crate::supervisor::Bus;
use crate::time::Instant;

/// Interval of the check.
const PERIOD: Duration = Duration::from_millis(100);
/// Shortest interval of reports about the same datagram.
const INTERVAL: Duration = Duration::from_secs(1);
/// Most reports per check; those of further datagrams follow in the next one.
const MOST: usize = 16;

/// Runs until it is switched off, or the MainDevice stops.
pub(crate) async fn watch_commands(bus: Bus, segment: SharedSegment) {
    let mut counted = Counted::default();
    while bus.are_commands_reported() {
        if let Some(board) = bus.board().filter(|_| segment.view().is_active()) {
            counted.follow(&board, &segment);
            counted.report(&bus, &board, &segment);
        }
        bus.report_waiting_commands();
        bus.sleep(PERIOD).await;
    }
}

/// What was reported of an application.
#[derive(Default)]
struct Counted {
    board: Option<Arc<Board>>,
    /// By domain and datagram: errors reported, and when.
    reported: BTreeMap<(usize, usize), (u32, Option<Instant>)>,
    /// Errors by SubDevice.
    subdevices: Vec<u32>,
    /// The datagram with which the next check begins.
    next: usize,
}

impl Counted {
    /// Begins anew with each application.
    fn follow(&mut self, board: &Arc<Board>, segment: &SharedSegment) {
        if self.board.as_ref().is_some_and(|known| Arc::ptr_eq(known, board)) {
            return;
        }
        let view = segment.view();
        let errors = |place: (usize, usize)| (place, (board.commands.read(place.0, place.1).cycles, None));
        *self = Counted {
            board: Some(board.clone()),
            reported: places(&view).map(|(place, _)| errors(place)).collect(),
            subdevices: (0..view.subdevices().member_count()).map(|index| board.wkc_errors(index)).collect(),
            next: 0,
        };
    }

    fn report(&mut self, bus: &Bus, board: &Board, segment: &SharedSegment) {
        let view = segment.view();
        let all: Vec<((usize, usize), &PlannedDatagram)> = places(&view).collect();
        let begin = self.next.checked_rem(all.len()).unwrap_or_default();
        let (mut notices, mut named) = (Vec::new(), Vec::new());
        for (at, (place, datagram)) in (0..all.len()).map(|step| (begin + step) % all.len()).map(|at| (at, all[at])) {
            let now = board.commands.read(place.0, place.1);
            let (reported, last) = self.reported.entry(place).or_default();
            let is_due = last.is_none_or(|last| bus.now().since(last) >= INTERVAL);
            if now.cycles == *reported || !is_due {
                continue;
            }
            if notices.len() == MOST {
                self.next = at;
                break;
            }
            let cycles = now.cycles.wrapping_sub(*reported);
            (*reported, *last) = (now.cycles, Some(bus.now()));
            let has_errors = |index: &usize| self.subdevices.get(*index) != Some(&board.wkc_errors(*index));
            let subdevices: Vec<usize> =
                datagram.contributions.iter().map(|(index, _)| *index).filter(has_errors).collect();
            named.extend_from_slice(&subdevices);
            notices.push(Notice::CyclicCommand {
                domain: DomainId(place.0),
                command: datagram.command,
                logical: datagram.logical,
                length: datagram.outputs + datagram.inputs,
                expected: now.expected,
                got: now.got,
                cycles,
                subdevices: subdevices.into_iter().map(SubDeviceId).collect(),
            });
        }
        for index in named {
            if let Some(errors) = self.subdevices.get_mut(index) {
                *errors = board.wkc_errors(index);
            }
        }
        drop(view);
        notices.into_iter().for_each(|notice| bus.notice(notice));
    }
}

/// The process data datagrams by domain and number.
fn places(segment: &Segment) -> impl Iterator<Item = ((usize, usize), &PlannedDatagram)> {
    segment.layout().domains.iter().enumerate().flat_map(|(domain, planned)| {
        let datagrams = planned.frames.iter().flat_map(|frame| &frame.datagrams).enumerate();
        datagrams.map(move |(number, datagram)| ((domain, number), datagram))
    })
}
