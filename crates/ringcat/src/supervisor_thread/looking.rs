//! What other threads see of the application and its links through a handle of the acyclic half.

use std::sync::{Arc, PoisonError};

use ringcat_engine::link::Link;

use super::SupervisorThread;
use super::worker::Published;
use crate::link_figures::LinkFigures;
use crate::observer::{Observed, Observer};
#[cfg(feature = "daemon")]
use crate::record_requests::RecordRequests;

impl Published {
    /// An application shows its process data from now on.
    pub(super) fn observes(&self, observed: &Arc<Observed>) {
        *self.observed.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(observed);
    }
}

impl SupervisorThread {
    /// Snapshots of the process data of the active application, for any thread; `None` while there is none.
    pub fn observer(&self) -> Option<Observer> {
        let observed = self.0.published.observed.lock().unwrap_or_else(PoisonError::into_inner);
        observed.upgrade().map(Observer::new)
    }

    /// Frames, bytes, losses and rates of a link: those of both halves while an application is active, otherwise those
    /// of the acyclic half.
    pub fn link_figures(&self, link: Link) -> LinkFigures {
        if let Some(observer) = self.observer() {
            return observer.link(link);
        }
        let samples = self.0.published.samples.lock().unwrap_or_else(PoisonError::into_inner);
        samples.of(link, self.counters())
    }

    /// Where a file with the last frames is requested becomes known to other threads.
    #[cfg(feature = "daemon")]
    pub(crate) fn publish_record(&self, requests: RecordRequests) {
        *self.0.published.record.lock().unwrap_or_else(PoisonError::into_inner) = Some(requests);
    }

    /// Where a file with the last frames is requested; `None` where no frames are kept.
    #[cfg(feature = "daemon")]
    pub(crate) fn record_requests(&self) -> Option<RecordRequests> {
        self.0.published.record.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What the network interfaces of EoE publish becomes known to other threads.
    #[cfg(feature = "eoe")]
    pub(crate) fn publish_ethernet(&self, shared: &Arc<dyn std::any::Any + Send + Sync>) {
        *self.0.published.ethernet.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::downgrade(shared));
    }

    /// What the network interfaces of EoE publish; `None` without any.
    #[cfg(feature = "eoe")]
    pub(crate) fn published_ethernet(&self) -> Option<Arc<dyn std::any::Any + Send + Sync>> {
        self.0.published.ethernet.lock().unwrap_or_else(PoisonError::into_inner).as_ref()?.upgrade()
    }
}
