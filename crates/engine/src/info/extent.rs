//! How much of an SII is known (protocol 4).

use ringcat_wire::sii::CategoryKind;

/// How much of its SII is known of a SubDevice, and how much a scan reads. Each extent contains those before it.
///
/// An EEPROM takes half a millisecond for 8 bytes, so the length of what is read decides how long a scan takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SiiExtent {
    /// What operation needs: identity, mailboxes, general data, SyncManagers, FMMUs, and PDOs with their entries.
    Operation,
    /// Operation modes of the distributed clock as well.
    Clocks,
    /// Names as well: of the SubDevice, of its PDOs and of their entries.
    #[default]
    Complete,
}

impl SiiExtent {
    /// Whether this extent contains a category.
    pub const fn contains(self, kind: CategoryKind) -> bool {
        match kind {
            CategoryKind::General
            | CategoryKind::Fmmu
            | CategoryKind::SyncManager
            | CategoryKind::TxPdo
            | CategoryKind::RxPdo => true,
            CategoryKind::Dc => matches!(self, SiiExtent::Clocks | SiiExtent::Complete),
            CategoryKind::Strings => matches!(self, SiiExtent::Complete),
            CategoryKind::Nop | CategoryKind::DataTypes | CategoryKind::End | CategoryKind::Other(_) => false,
        }
    }
}
