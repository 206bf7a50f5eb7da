//! Proves that a SubDevice whose FMMUs are set delivers its inputs.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::RegisterAddress;

use super::shared_segment::SharedSegment;
use crate::info::Direction;
use crate::plan::AreaPlan;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// Pause between two reads of the inputs; it doubles up to the longest.
const PAUSE: Duration = Duration::from_millis(1);
/// Longest pause between two reads.
const LONGEST_PAUSE: Duration = Duration::from_millis(50);
/// Time after which missing inputs are reported.
const LATE: Duration = Duration::from_secs(1);

/// Reads with separate datagrams until a SubDevice has delivered all its inputs, or is lost.
pub(super) async fn prove_inputs(bus: Bus, segment: SharedSegment, index: usize, mapping: u32) {
    let known = segment.view().member(index).and_then(|member| Some((member.station, member.setup.clone()?)));
    let Some((station, setup)) = known else { return };
    let is_input = |area: &&AreaPlan| area.direction == Direction::Inputs;
    let mut missing: Vec<&AreaPlan> = setup.plan.mapped_areas().map(|(_, area)| area).filter(is_input).collect();
    let (mut pause, late) = (PAUSE, bus.now() + LATE);
    let mut is_reported = false;
    let is_mapped =
        |segment: &SharedSegment| segment.view().member(index).is_some_and(|member| member.is_mapped_as(mapping));
    while segment.board.is_unproven(index) && is_mapped(&segment) {
        let mut left = Vec::new();
        for area in missing {
            let read = bus.fprd(station, RegisterAddress(area.physical), usize::from(area.length)).await;
            if read.is_err() {
                left.push(area);
            }
        }
        if left.is_empty() {
            return segment.observe(Observation::Proven { index, mapping });
        }
        if bus.now() >= late && !core::mem::replace(&mut is_reported, true) {
            let sync_manager = left[0].sync_manager;
            let what = alloc::format!(
                "SyncManager {sync_manager} gives no inputs yet, {} ms after its FMMU",
                LATE.as_millis()
            );
            segment.observe(Observation::NotProven { index, mapping, what });
        }
        missing = left;
        bus.sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}
