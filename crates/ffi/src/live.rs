//! Atomic words with which any thread reads the active application and sends it requests: no allocation, no waiting.

use std::sync::{PoisonError, RwLock};

use ringcat::daemon::{OwnershipWatch, SegmentOverview};
use ringcat::{Link, LiveStatus, RetryRequest, Services};

use crate::bus::Bus;
use crate::code::{Code, Outcome, report};
use crate::types::SegmentState;

/// The words of the bus of a handle, while it has one.
#[derive(Debug, Default)]
pub struct Live(RwLock<Option<Words>>);

/// Words of an application.
#[derive(Debug)]
pub struct Words {
    /// States.
    pub status: LiveStatus,
    /// For another attempt of failed configurations.
    retry: RetryRequest,
    /// SubDevices that the scan before the activation has found.
    found: u32,
    /// The links are a ring.
    is_ring: bool,
    ownership: Option<OwnershipWatch>,
}

impl Live {
    /// From now on the words of this bus are read.
    ///
    /// # Errors
    /// [`Code::GONE`]: the acyclic half has ended, and there are no words any more. A line reports it, unless the
    /// daemon has taken the bus back, which has a line of its own.
    pub fn follow(&self, bus: &Bus, found: usize, is_ring: bool) -> Outcome {
        let (supervisor, ownership) = (bus.supervisor(), bus.ownership());
        let asked = supervisor.live_status().and_then(|status| Ok((status, supervisor.create_retry_request()?)));
        let found = u32::try_from(found).unwrap_or(u32::MAX);
        let words = asked.map(|(status, retry)| Words { status, retry, found, is_ring, ownership });
        let failed = words.as_ref().err().map(ToString::to_string);
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = words.ok();
        match failed {
            None => Ok(()),
            Some(reason) => {
                if bus.check_held().is_ok() {
                    report(format_args!("master {}: the states of the slaves are not known: {reason}", bus.master()));
                }
                Err(Code::GONE)
            }
        }
    }

    /// Reads words of the active application; returns `lost` if the daemon has taken the bus back.
    ///
    /// # Errors
    /// [`Code::BUSY`]: another thread activates or deactivates it.
    pub fn read<R>(&self, lost: R, read: impl FnOnce(&Words) -> R) -> Outcome<R> {
        let words = self.0.try_read().map_err(|_| Code::BUSY)?;
        let words = words.as_ref().ok_or(Code::BUSY)?;
        Ok(if words.ownership.as_ref().is_some_and(OwnershipWatch::is_taken_back) { lost } else { read(words) })
    }

    /// Requests another attempt of failed configurations.
    ///
    /// # Errors
    /// As [`Live::read`]; [`Code::GONE`]: the daemon has taken the bus back.
    pub fn retry(&self) -> Outcome {
        self.read(Err(Code::GONE), |words| {
            words.retry.start();
            Ok(())
        })?
    }
}

impl Words {
    /// All SubDevices together: there is no scan beside an application.
    pub fn overview(&self) -> SegmentOverview {
        let mut seen = SegmentOverview::default();
        for link in Link::ALL {
            let one = self.status.link(link);
            (seen.counts[link.index()], seen.is_up[link.index()]) = (one.answering, one.is_up());
        }
        seen.al_states = self.status.segment().al_states;
        (seen.is_ring, seen.found, seen.is_scanned) = (self.is_ring, self.found, true);
        seen
    }

    /// State of all SubDevices, or of those on one link.
    pub fn segment(&self, link: Option<Link>) -> SegmentState {
        match link {
            None => {
                let all = self.status.segment();
                SegmentState::new(all.responding, all.al_states, all.is_up)
            }
            Some(link) => {
                let one = self.status.link(link);
                SegmentState::new(one.answering, one.al_states, one.is_up())
            }
        }
    }
}
