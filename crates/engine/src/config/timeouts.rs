//! Time limits of a SubDevice (protocol 5.4).

use core::time::Duration;

use ringcat_wire::al::AlState;

/// Time limits (protocol 5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
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
    /// Sets [`Timeouts::preop`].
    #[must_use]
    pub const fn with_preop(mut self, preop: Duration) -> Timeouts {
        self.preop = preop;
        self
    }

    /// Sets [`Timeouts::safeop_op`].
    #[must_use]
    pub const fn with_safeop_op(mut self, safeop_op: Duration) -> Timeouts {
        self.safeop_op = safeop_op;
        self
    }

    /// Sets [`Timeouts::back_to_init`].
    #[must_use]
    pub const fn with_back_to_init(mut self, back_to_init: Duration) -> Timeouts {
        self.back_to_init = back_to_init;
        self
    }

    /// Sets [`Timeouts::back_to_safeop`].
    #[must_use]
    pub const fn with_back_to_safeop(mut self, back_to_safeop: Duration) -> Timeouts {
        self.back_to_safeop = back_to_safeop;
        self
    }

    /// Sets [`Timeouts::mailbox_request`].
    #[must_use]
    pub const fn with_mailbox_request(mut self, mailbox_request: Duration) -> Timeouts {
        self.mailbox_request = mailbox_request;
        self
    }

    /// Sets [`Timeouts::sdo`].
    #[must_use]
    pub const fn with_sdo(mut self, sdo: Duration) -> Timeouts {
        self.sdo = sdo;
        self
    }

    /// Sets [`Timeouts::soe`].
    #[must_use]
    pub const fn with_soe(mut self, soe: Duration) -> Timeouts {
        self.soe = soe;
        self
    }

    /// Sets [`Timeouts::eoe`].
    #[must_use]
    pub const fn with_eoe(mut self, eoe: Duration) -> Timeouts {
        self.eoe = eoe;
        self
    }

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct StateTimeout {
    /// State before.
    pub from: AlState,
    /// State after.
    pub to: AlState,
    /// Limit.
    pub limit: Duration,
}

impl StateTimeout {
    /// The limit of the change from one state to another.
    pub const fn new(from: AlState, to: AlState, limit: Duration) -> StateTimeout {
        StateTimeout { from, to, limit }
    }
}
