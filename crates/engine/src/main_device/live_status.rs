//! State of the segment and of each declared SubDevice, for real-time threads.

use alloc::sync::Arc;

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use super::MainDevice;
use crate::board::Board;
use crate::board::live::{Life, Presence};
use crate::declared::SubDeviceId;
use crate::link::Link;
use crate::ring_status::LinkStatus;

/// State of the segment and of each declared SubDevice, for any thread.
///
/// A reading loads at most four atomic words: it neither allocates nor locks nor waits, and disturbs no writer. Values
/// are at most one round of supervision old. A round reads the AL states; it begins as soon as the cyclic frames show a
/// change, and once a second. Counts and working counters are those of the last evaluated cycle. Without supervision
/// ([`super::Options`]) only configuration reads AL states.
///
/// After the application has ended, no SubDevice is online. Without an application there are no declared SubDevices;
/// with idle operation the state of the segment as a whole is that of the last broadcast, otherwise nothing responds. A
/// status belongs to one application, or to the time until the next one.
#[derive(Clone, Debug)]
pub struct LiveStatus {
    board: Arc<Board>,
}

/// State of a declared SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubDeviceStatus {
    /// It answers, and is the declared one.
    pub online: bool,
    /// It is in OP with the declared configuration, without an error.
    pub operational: bool,
    /// Its AL state; `None` while it is offline or its state is not read yet.
    pub al_state: Option<AlState>,
    /// It shows an error: it refused a request, or left its state.
    pub has_error: bool,
    /// The AL status code of this error.
    pub code: AlStatusCode,
    /// Its share in the working counters.
    pub wkc: WkcShare,
}

/// Increments of the working counters by one SubDevice, in the last evaluated cycle of each of its domains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WkcShare {
    /// Sum of its increments; `None` where a working counter does not show which of its SubDevices have incremented it.
    pub counted: Option<u16>,
    /// The sum if the SubDevice processes all its process data: 3 for an LRW in both directions, otherwise 1 for each
    /// datagram.
    pub expected: u16,
}

impl WkcShare {
    /// Whether the SubDevice processed all its process data.
    pub fn is_complete(&self) -> bool {
        self.counted == Some(self.expected)
    }
}

/// All SubDevices of the segment together, also those without a declaration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SegmentStatus {
    /// Number of SubDevices that processed the last supervision frame, on both links together.
    pub responding: u16,
    /// Their AL states, ORed: bits 0 to 3 as in register AL_STATUS.
    pub al_states: u8,
    /// At least one link is up.
    pub is_up: bool,
}

impl LiveStatus {
    /// The live status of an application with this board.
    pub(super) fn of(board: &Arc<Board>) -> LiveStatus {
        LiveStatus { board: board.clone() }
    }

    /// Number of declared SubDevices.
    pub fn subdevice_count(&self) -> usize {
        self.board.live.count()
    }

    /// State of a declared SubDevice; `None` if it is not declared.
    pub fn subdevice(&self, subdevice: SubDeviceId) -> Option<SubDeviceStatus> {
        let (mut life, share) = (self.board.live.life(subdevice.0)?, self.board.live.share(subdevice.0)?);
        if self.board.is_silent() {
            life = Life::default();
        }
        let al = AlStatus::from_bits(life.al_status.into());
        let al_state = al.al_state();
        Some(SubDeviceStatus {
            online: life.presence != Presence::Offline,
            operational: life.presence == Presence::Settled && al_state == Some(AlState::Op) && !al.error,
            al_state,
            has_error: al.error,
            code: AlStatusCode(life.code),
            wkc: WkcShare { counted: (share.unknown == 0).then_some(share.counted), expected: share.expected },
        })
    }

    /// All SubDevices together.
    pub fn segment(&self) -> SegmentStatus {
        let seen = self.board.responding();
        let [main, redundant] = seen.al_status;
        let is_up = Link::ALL.iter().any(|link| self.link(*link).is_up());
        SegmentStatus { responding: seen.total().0, al_states: (main | redundant) & 0x0F, is_up }
    }

    /// A link, and the SubDevices that process the frames sent on it.
    pub fn link(&self, link: Link) -> LinkStatus {
        let seen = self.board.responding();
        let answering = [seen.main.0, seen.redundant.0][link.index()];
        let al_states = seen.al_status[link.index()] & 0x0F;
        LinkStatus { carrier: self.board.live.carrier(link), answering, al_states }
    }

    /// Frames of process data: copies sent on a link that did not come back in time, and their bytes.
    pub fn lost(&self, link: Link) -> LostCopies {
        let [copies, bytes] = self.board.live.lost(link);
        LostCopies { copies, bytes }
    }
}

/// Copies of cyclic frames that did not come back in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LostCopies {
    /// Their number since activation.
    pub copies: u64,
    /// Their bytes, without FCS.
    pub bytes: u64,
}

impl MainDevice {
    /// State of the segment and of each declared SubDevice, for any thread.
    pub fn live_status(&self) -> LiveStatus {
        LiveStatus { board: self.segment.board.clone() }
    }
}
