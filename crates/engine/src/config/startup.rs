//! Start-up commands: objects, IDNs and addresses that are written whenever a SubDevice passes a transition (facts 5.1,
//! 6.3, 6.5, 6.6).

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;

use super::ip::IpSettings;

/// A transition at which start-up commands are sent. Towards OP they come before the upper state is requested, on the way
/// back before the lower one is; those of IP come as soon as PREOP is reached, because INIT has no mailbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Transition {
    /// INIT to PREOP.
    Ip,
    /// PREOP to SAFEOP, before PDO assignment and mapping are written.
    Ps,
    /// SAFEOP to OP.
    So,
    /// OP to SAFEOP.
    Os,
    /// SAFEOP to PREOP. OP is left through SAFEOP.
    Sp,
}

impl Transition {
    /// State before and behind it.
    pub const fn states(self) -> (AlState, AlState) {
        match self {
            Transition::Ip => (AlState::Init, AlState::PreOp),
            Transition::Ps => (AlState::PreOp, AlState::SafeOp),
            Transition::So => (AlState::SafeOp, AlState::Op),
            Transition::Os => (AlState::Op, AlState::SafeOp),
            Transition::Sp => (AlState::SafeOp, AlState::PreOp),
        }
    }
}

impl fmt::Display for Transition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (from, to) = self.states();
        write!(f, "{from} to {to}")
    }
}

/// An SDO download.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SdoDownload {
    /// Index of the object.
    pub index: u16,
    /// Subindex; with complete access 0 or 1, where to start.
    pub sub_index: u8,
    /// All entries at once.
    pub complete_access: bool,
    /// What to write, little-endian.
    pub data: Vec<u8>,
}

/// A write of the value of an IDN.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdnWrite {
    /// Drive of the SubDevice, 0..=7.
    pub drive: u8,
    /// The IDN.
    pub idn: Idn,
    /// What to write, little-endian; lists with their two lengths in front.
    pub data: Vec<u8>,
}

/// What a start-up command does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartupAction {
    /// CoE.
    Sdo(SdoDownload),
    /// SoE.
    Idn(IdnWrite),
    /// EoE: the addresses behind it.
    Ip(IpSettings),
}

/// A start-up command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartupCommand {
    /// When.
    pub transition: Transition,
    /// What.
    pub action: StartupAction,
}
