//! Time limits of a SubDevice (protocol 5.4).

use core::time::Duration;

use ringcat_wire::al::AlState;

/// Time limits (protocol 5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// INIT to PREOP or BOOT.
    pub preop: Duration,
    /// PREOP to SAFEOP, SAFEOP to OP.
    pub safeop_op: Duration,
    /// Any state to INIT.
    pub back_to_init: Duration,
    /// OP to SAFEOP, OP or SAFEOP to PREOP.
    pub back_to_safeop: Duration,
    /// Until a mailbox accepts a request.
    pub mailbox_request: Duration,
    /// Until the response to an SDO request is available.
    pub sdo: Duration,
    /// Until the response to a SoE request is available.
    pub soe: Duration,
    /// Until the response to an EoE request is available.
    pub eoe: Duration,
}

impl Default for Timeouts {
    fn default() -> Timeouts {
        Timeouts {
            preop: Duration::from_secs(3),
            safeop_op: Duration::from_secs(10),
            back_to_init: Duration::from_secs(5),
            back_to_safeop: Duration::from_millis(200),
            mailbox_request: Duration::from_millis(100),
            sdo: Duration::from_secs(1),
            soe: Duration::from_secs(1),
            eoe: Duration::from_secs(3),
        }
    }
}

impl Timeouts {
    /// Limit of a state change.
    pub const fn transition(&self, from: AlState, to: AlState) -> Duration {
        match (from, to) {
            (_, AlState::Init) => self.back_to_init,
            (AlState::SafeOp | AlState::Op, AlState::PreOp) | (AlState::Op, AlState::SafeOp) => self.back_to_safeop,
            (_, AlState::PreOp | AlState::Boot) => self.preop,
            (_, AlState::SafeOp | AlState::Op) => self.safeop_op,
        }
    }
}

/// The limit of one state change, if it differs from [`Timeouts`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateTimeout {
    /// State before.
    pub from: AlState,
    /// State after.
    pub to: AlState,
    /// Limit.
    pub limit: Duration,
}
