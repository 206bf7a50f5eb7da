//! How the EEPROMs of all SubDevices are used: what their aliases are, and when they belong to the PDI.

/// Where the aliases of SubDevices are read.
///
/// The controller loads its register from word 4 of the SII when it gets power, not when it loads its configuration
/// again (protocol 4.7). Both differ after an alias was written, and where a PDI writes the register, as some devices
/// with switches do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum AliasSource {
    /// Word 4 of the SII: what was written last. Without a readable SII there is no alias.
    Sii,
    /// Register STATION_ALIAS (0x0012).
    #[default]
    Register,
}

/// When the EEPROM of a SubDevice with a mailbox is assigned to its PDI.
///
/// In any case it is while a boot loader runs, and with
/// [`SubDeviceConfig::sii_to_pdi`](crate::config::SubDeviceConfig) from the transition to PREOP on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiAssignment {
    /// While it goes from INIT to PREOP (protocol 5.2): its application may read the EEPROM then.
    #[default]
    TowardsPreOp,
    /// Never: it belongs to EtherCAT.
    Never,
}

impl SiiAssignment {
    /// Whether the PDI has it on the way to PREOP.
    pub(crate) const fn lends_towards_preop(self) -> bool {
        matches!(self, SiiAssignment::TowardsPreOp)
    }
}
