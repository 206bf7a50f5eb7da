//! Takes what an INACTIVE MainDevice without an application receives from the ACTIVE (protocol 9.10).
//!
//! It belongs to the thread that has the links of the master frames, which need not be that of the acyclic half: both
//! share words.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::master_frame::{Diagnosis, DomainRecord, Header, Lengths, NotReady};

use crate::board::sheet::Sheet;
use crate::board::standby::StandbyWords;
use crate::exchange::following::{Following, Unusable};
use crate::knowledge::Knowledge;
use crate::link::Link;
use crate::role::RoleControl;
use crate::time::Instant;

/// What an INACTIVE MainDevice has received from the ACTIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartnerStatus {
    /// When a frame of another MainDevice came last.
    pub at: Option<Instant>,
    /// Period of its cycles; `None` before a master frame.
    pub period: Option<Duration>,
    /// All that is needed to follow it has arrived.
    pub is_known: bool,
}

/// What the ACTIVE has reported of the segment and of its frames.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartnerDiagnosis {
    /// When a frame of another MainDevice came last.
    pub at: Option<Instant>,
    /// State of the ring, carriers, SubDevices that answer, and the counters of its frames and cycles.
    pub counters: Diagnosis,
    /// Its domains, in the order of the declaration.
    pub domains: Vec<DomainRecord>,
}

/// Takes what an INACTIVE MainDevice without an application receives from the ACTIVE, in any thread.
#[derive(Debug)]
pub struct Listener {
    listening: Following,
    words: Arc<StandbyWords>,
    control: RoleControl,
}

impl Listener {
    pub(in crate::main_device) fn new(words: Arc<StandbyWords>, control: RoleControl) -> Listener {
        let mut listening = Following::new(Lengths::default(), words.clone());
        listening.answer.not_ready = NotReady::NO_APPLICATION;
        Listener { listening, words, control }
    }

    /// Takes and fills a received frame of another MainDevice before it is forwarded. Any bytes are allowed. Neither
    /// allocates nor waits.
    pub fn fill(&mut self, arrived_on: Link, frame: &mut [u8], now: Instant) {
        self.words.post_partner_frame(now);
        self.listening.fill(arrived_on, frame, now, &[]);
        let unreadable = match self.listening.unusable {
            Some(Unusable::Version { least, got }) => {
                self.words.post_other_version(least, got);
                true
            }
            _ => false,
        };
        let is_known = self.words.partner_knowledge.version().is_some();
        self.listening.answer.not_ready = NotReady(self.control.not_ready())
            .with(NotReady::NO_APPLICATION, true)
            .with(NotReady::KNOWLEDGE, !is_known)
            .with(NotReady::VERSION, unreadable);
        self.control.post_readiness(self.listening.answer.not_ready);
    }

    /// The role, and requests for another one: for any thread.
    pub fn role_control(&self) -> RoleControl {
        self.control.clone()
    }

    /// What has arrived so far.
    pub fn partner_status(&self) -> PartnerStatus {
        let newest = self.listening.newest().and_then(|(cycle, _)| self.listening.header_of(cycle));
        let period = |(Header { period_ns, .. }, _)| Duration::from_nanos(u64::from(period_ns));
        PartnerStatus {
            at: self.words.partner_frame_at(),
            period: newest.map(period).filter(|period| !period.is_zero()),
            is_known: self.words.header().is_some() && known(&self.words.partner_knowledge).is_some(),
        }
    }
}

/// Knowledge of an ACTIVE; `None` before all of it has been written.
pub(in crate::main_device) fn known(sheet: &Sheet) -> Option<Knowledge> {
    let (_, bytes) = sheet.copy()?;
    Knowledge::from_bytes(&bytes).ok()
}
