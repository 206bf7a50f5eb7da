//! What both halves exchange about the other MainDevice of the ring.
//!
//! The acyclic half of the ACTIVE posts its knowledge of the segment, which the cyclic half sends piece by piece; the
//! cyclic half of the INACTIVE posts what it has heard.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use ringcat_wire::master_frame::{Diagnosis, DomainRecord};

use super::sheet::Sheet;

/// Room for the knowledge of a segment: some 300 SubDevices with their SIIs. More is not sent.
pub const KNOWLEDGE_ROOM: usize = 256 * 1024;
/// Room for a diagnosis with this number of domains.
const DOMAINS: usize = 64;

/// The words.
#[derive(Debug)]
pub struct StandbyWords {
    /// Knowledge of this MainDevice, for the other one. Writer: the acyclic half.
    pub knowledge: Sheet,
    /// Knowledge of the other MainDevice. Writer: the cyclic half.
    pub heard: Sheet,
    /// Diagnosis of the other MainDevice. Writer: the cyclic half.
    pub diagnosis: Sheet,
    /// Session of the other MainDevice, plus one; 0 before its first header.
    session: AtomicU32,
    /// Digest of its configuration.
    identity: AtomicU64,
    /// The last takeover went on with process data of the other MainDevice.
    is_hot: AtomicBool,
}

impl Default for StandbyWords {
    fn default() -> StandbyWords {
        StandbyWords {
            knowledge: Sheet::new(KNOWLEDGE_ROOM),
            heard: Sheet::new(KNOWLEDGE_ROOM),
            diagnosis: Sheet::new(Diagnosis::LEN + DOMAINS * DomainRecord::LEN),
            session: AtomicU32::new(0),
            identity: AtomicU64::new(0),
            is_hot: AtomicBool::new(false),
        }
    }
}

impl StandbyWords {
    /// Posts a header of the other MainDevice.
    pub fn post_header(&self, session: u16, identity: u64) {
        self.identity.store(identity, Ordering::Relaxed);
        self.session.store(u32::from(session) + 1, Ordering::Release);
    }

    /// Posts whether a takeover goes on with process data of the other MainDevice.
    pub fn post_hot(&self, is_hot: bool) {
        self.is_hot.store(is_hot, Ordering::Release);
    }

    /// Whether the last takeover went on with process data of the other MainDevice: SubDevices keep their
    /// configuration.
    pub fn is_hot(&self) -> bool {
        self.is_hot.load(Ordering::Acquire)
    }

    /// Session and digest of the configuration of the other MainDevice; `None` before its first header.
    pub fn header(&self) -> Option<(u16, u64)> {
        let session = self.session.load(Ordering::Acquire).checked_sub(1)?;
        Some((session as u16, self.identity.load(Ordering::Relaxed)))
    }
}
