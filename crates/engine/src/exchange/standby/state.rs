//! What the exchange has for MainDevice redundancy, and what it is set up with.

use alloc::boxed::Box;
use alloc::sync::Arc;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::memory_write::MemoryWrite;

use super::partner::{Items, PartnerWatch};
use super::partner_data::{PartnerData, PartnerMemory};
use super::readiness::ReadinessWatch;
use crate::board::standby::StandbyWords;
use crate::exchange::following::{Following, OutputsSeen};
use crate::exchange::master_frames::MasterFrames;
use crate::layout::{InputRun, PlannedMasterFrames};
use crate::role::{MainDeviceRole, RoleControl};
use crate::time::Instant;

/// Data for MainDevice redundancy.
#[derive(Debug)]
pub struct StandbySetup {
    /// The master frames.
    pub planned: PlannedMasterFrames,
    /// Digests of the items of the configuration.
    pub items: Arc<[u32]>,
    /// Digest of all of it.
    pub identity: u64,
    /// Number of the session: it decides about logical addresses.
    pub session: u16,
    /// By SubDevice, the lowest AL state in which its process data is exchanged.
    pub exchanges_from: Arc<[u8]>,
    /// Whether the ACTIVE becomes INACTIVE when it has lost all links.
    pub yields_without_links: bool,
    /// Whether all SubDevices are configured again from INIT on after a takeover.
    pub goes_through_init: bool,
    /// The role.
    pub control: RoleControl,
    /// Words for the acyclic half.
    pub words: Arc<StandbyWords>,
    /// Memory of the application for process data between both.
    pub memory: Option<PartnerMemory>,
}

/// Whether the role may be offered to the other MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::exchange) enum Offers {
    /// The role may be offered.
    Possible,
    /// The role is no longer offered: the application ends, and then the MainDevice stops the SubDevices as ACTIVE.
    Ended,
}

/// MainDevice redundancy, if it is set up.
#[derive(Debug, Default)]
pub(in crate::exchange) struct Standby(pub(in crate::exchange) Option<Box<State>>);

/// Its state.
#[derive(Debug)]
pub(in crate::exchange) struct State {
    pub control: RoleControl,
    pub words: Arc<StandbyWords>,
    /// The role as of the beginning of the cycle.
    pub role: MainDeviceRole,
    pub frames: MasterFrames,
    pub following: Following,
    pub outputs: OutputsSeen,
    pub watch: PartnerWatch,
    /// Process data between both.
    pub data: PartnerData,
    pub readiness: ReadinessWatch,
    pub items: Items,
    pub exchanges_from: Arc<[u8]>,
    pub yields_without_links: bool,
    pub goes_through_init: bool,
    /// Whether the role may be offered.
    pub offers: Offers,
    /// The last request was forced.
    pub is_forced: bool,
    /// Cycles in which the role was offered.
    pub offered: u8,
    /// The cycle of the ACTIVE that the images show.
    pub shown: Option<u32>,
    /// Cycle, plus one, in which a frame of another MainDevice came last while this one is ACTIVE.
    pub foreign_in: u64,
    /// From this cycle on acyclic frames of another MainDevice are a collision: before, they may be the last ones of
    /// the ACTIVE that has handed its role over.
    pub acyclic_counts_from: u64,
    /// Its sender, until the application has asked for it.
    pub collided_with: Option<MacAddress>,
    /// The write into the memory of a SubDevice that it does, according to its last master frame.
    pub collided_write: Option<MemoryWrite>,
    /// A version of the other MainDevice with which this one cannot work, and that was reported.
    pub other_version: Option<u8>,
    /// The newest cycle of the ACTIVE when the last cycle of this MainDevice began.
    pub noticed: Option<u32>,
    /// When that began.
    pub begun_at: Instant,
    /// When this MainDevice ended its last time as ACTIVE.
    pub left_at: Option<Instant>,
    /// Inputs in the images.
    pub runs: Box<[InputRun]>,
    pub period_ns: u64,
}

impl Standby {
    /// Whether nothing may be sent.
    #[inline(always)]
    pub fn is_inactive(&self) -> bool {
        match &self.0 {
            Some(state) => state.role == MainDeviceRole::Inactive,
            None => false,
        }
    }

    /// Whether copies of master frames may still come back, or frames of the other MainDevice may come.
    pub fn awaits_copies(&self) -> bool {
        self.0.as_ref().is_some_and(|state| state.role == MainDeviceRole::Inactive || state.frames.is_expected())
    }
}
