//! The command "detect modules" (0xF002): a rescan of the whole segment while process data continues.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::sdo::AbortCode;

use super::seen::Seen;
use crate::procedures::unassigned::rescan::rescan;

/// Time within which the segment must become stable.
const LIMIT: Duration = Duration::from_secs(5);

/// State of the command: the codes of 0xF002:2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Status {
    /// No command was given, or it has ended, with a response.
    #[default]
    Done = 1,
    /// It failed.
    Failed = 3,
    /// It is under way.
    Running = 255,
}

/// The command and its result.
#[derive(Debug, Default)]
pub(super) struct Detection {
    status: Cell<Status>,
    found: RefCell<Option<Vec<StationAddress>>>,
}

impl Detection {
    pub(super) fn status(&self) -> Status {
        self.status.get()
    }

    /// Station addresses found by the command, by position; before its first result, those of the scan.
    pub(super) fn found(&self, seen: &Seen) -> Vec<StationAddress> {
        self.found.borrow().clone().unwrap_or_else(|| seen.scanned.clone())
    }

    /// Starts the command; refused while it is under way, and before activation.
    pub(super) fn start(this: &Rc<Detection>, seen: &Seen) -> Result<(), AbortCode> {
        let segment = seen.segment.clone().ok_or(AbortCode::CANNOT_BE_STORED_DEVICE_STATE)?;
        if this.status.replace(Status::Running) == Status::Running {
            return Err(AbortCode::CANNOT_BE_STORED_DEVICE_STATE);
        }
        let (bus, detection) = (seen.bus.clone(), this.clone());
        seen.bus.spawn(async move {
            match rescan(&bus, &segment, LIMIT).await {
                Ok(rescan) => {
                    let stations = rescan.subdevices.iter().map(|found| found.station).collect();
                    *detection.found.borrow_mut() = Some(stations);
                    detection.status.set(Status::Done);
                }
                Err(_) => detection.status.set(Status::Failed),
            }
        });
        Ok(())
    }
}
