//! The command "detect modules" (0xF002): a look at the whole segment while everything goes on.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::sdo::AbortCode;

use super::seen::Seen;
use crate::procedures::unassigned::rescan::rescan;

/// The segment has to hold still within.
const LIMIT: Duration = Duration::from_secs(5);

/// How far the command is: the codes of 0xF002:2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Status {
    /// Nothing was asked for, or it is done, and there is a response.
    #[default]
    Done = 1,
    /// It failed.
    Failed = 3,
    /// It goes on.
    Running = 255,
}

/// The command and what it has found.
#[derive(Debug, Default)]
pub(super) struct Detection {
    status: Cell<Status>,
    found: RefCell<Option<Vec<StationAddress>>>,
}

impl Detection {
    pub(super) fn status(&self) -> Status {
        self.status.get()
    }

    /// Station addresses that the command has found, by position; before it has found any, those of the scan.
    pub(super) fn found(&self, seen: &Seen) -> Vec<StationAddress> {
        self.found.borrow().clone().unwrap_or_else(|| seen.scanned.clone())
    }

    /// Begins; refused while it goes on, and before activation.
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
