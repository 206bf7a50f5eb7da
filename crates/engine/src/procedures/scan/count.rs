//! Counts SubDevices until the count is stable: after power-on they appear one after the other.

use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::register::map;

use super::error::ScanError;
use super::options::ScanOptions;
use crate::event::Notice;
use crate::ring_status::LinkCounts;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Pause between two counts.
const PAUSE: Duration = Duration::from_millis(1);

/// Pause between two counts while EEPROMs are read.
const WATCH_PAUSE: Duration = Duration::from_millis(15);
/// Consecutive counts without an answer after which no SubDevice is connected.
const SILENT: u32 = 3;

/// SubDevices on both links, and the time since which the count is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Count {
    pub main: Wkc,
    pub redundant: Wkc,
    pub since: Instant,
}

impl Count {
    pub(super) fn is_same(&self, other: &Count) -> bool {
        (self.main, self.redundant) == (other.main, other.redundant)
    }

    pub(super) fn total(&self) -> u32 {
        u32::from(self.main.0) + u32::from(self.redundant.0)
    }

    pub(super) const fn by_link(&self) -> LinkCounts {
        LinkCounts { main: self.main.0, redundant: self.redundant.0 }
    }
}

/// One count; `None` if no frame returned.
async fn count(bus: &Bus) -> Result<Option<Count>, BusError> {
    match bus.brd(map::TYPE, 1).await {
        Ok(reply) => Ok(Some(Count { main: reply.main, redundant: reply.redundant, since: bus.now() })),
        Err(BusError::Lost { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Counts until SubDevices answer.
pub(super) async fn first(bus: &Bus, options: &ScanOptions, begin: Instant) -> Result<Count, ScanError> {
    let mut answered = false;
    loop {
        let counted = count(bus).await?;
        answered |= counted.is_some();
        if let Some(counted) = counted.filter(|counted| counted.total() > 0) {
            return Ok(counted);
        }
        if bus.now().since(begin) >= options.patience {
            return Err(if answered { ScanError::NoSubDevices } else { ScanError::NoAnswer });
        }
        bus.sleep(PAUSE).await;
    }
}

/// Counts until the number has been the same for the settling time. The error is another count, or none.
pub(super) async fn settle(bus: &Bus, expected: &Count, settle: Duration) -> Result<(), Option<Count>> {
    while bus.now().since(expected.since) < settle {
        bus.sleep(PAUSE.min(settle)).await;
        let counted = count(bus).await.unwrap_or_default();
        if !counted.is_some_and(|counted| counted.is_same(expected)) {
            return Err(counted);
        }
    }
    let LinkCounts { main, redundant } = expected.by_link();
    bus.notice(Notice::Counted { main, redundant });
    Ok(())
}

/// Counts at intervals until the number differs. A lost frame is no evidence of that; `SILENT` in a row count as no
/// SubDevice.
pub(super) async fn until_changed(bus: &Bus, expected: &Count) -> LinkCounts {
    let mut lost = 0;
    loop {
        bus.sleep(WATCH_PAUSE).await;
        let counted = count(bus).await.unwrap_or_default();
        lost = if counted.is_none() { lost + 1 } else { 0 };
        let changed = counted.filter(|counted| !counted.is_same(expected)).map(|counted| counted.by_link());
        if let Some(now) = changed.or_else(|| (lost >= SILENT).then(LinkCounts::default)) {
            return now;
        }
    }
}
