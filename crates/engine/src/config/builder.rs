//! Builder methods with which an application declares a SubDevice.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;

use super::{
    ConfigAddress, DeclaredSyncManager, IdnWrite, IpSettings, Passage, PdoAssignment, PdoEntry, PdoMapping,
    RefusedPdos, Repetition, SdoDownload, StartupAction, StartupCommand, StateTimeout, SubDeviceConfig,
    SyncManagerOverride, SyncSignals, Timeouts, Transition, Watchdog,
};
use crate::info::{Direction, PdoEntryInfo, PdoInfo, SubDeviceInfo};

impl SubDeviceConfig {
    /// A SubDevice of any identity at this place.
    pub fn at(address: ConfigAddress) -> SubDeviceConfig {
        SubDeviceConfig { address, ..SubDeviceConfig::default() }
    }

    /// A SubDevice of any identity at a position.
    pub fn at_position(position: u16) -> SubDeviceConfig {
        SubDeviceConfig::at(ConfigAddress::Position(position))
    }

    /// A SubDevice of any identity, `offset` places behind the one with an alias; with alias 0 exactly at the position
    /// `offset`.
    pub fn at_alias(alias: u16, offset: u16) -> SubDeviceConfig {
        SubDeviceConfig::at(ConfigAddress::Alias { alias, offset })
    }

    /// A SubDevice of any identity with an explicit device identification, at any place.
    pub fn at_identification(value: u16) -> SubDeviceConfig {
        SubDeviceConfig::at(ConfigAddress::Identification { value, offset: 0 })
    }

    /// A SubDevice of any identity with this value in a word of its memory, at any place.
    pub fn at_data_word(register: RegisterAddress, value: u16) -> SubDeviceConfig {
        SubDeviceConfig::at(ConfigAddress::DataWord { register, value, offset: 0 })
    }

    /// The SubDevice that a scan found: at its position, with its vendor and product; everything else from its SII.
    pub fn from_info(info: &SubDeviceInfo) -> SubDeviceConfig {
        SubDeviceConfig::at_position(info.position.0)
            .expect_product(info.identity.vendor_id, info.identity.product_code)
    }

    /// Expects a vendor and a product.
    #[must_use]
    pub fn expect_product(mut self, vendor_id: u32, product_code: u32) -> SubDeviceConfig {
        self.expected.vendor_id = Some(vendor_id);
        self.expected.product_code = Some(product_code);
        self
    }

    /// Expects a revision.
    #[must_use]
    pub fn expect_revision(mut self, revision: u32) -> SubDeviceConfig {
        self.expected.revision = Some(revision);
        self
    }

    /// Expects a revision or a later one.
    #[must_use]
    pub fn expect_revision_from(mut self, revision: u32) -> SubDeviceConfig {
        self.expected.minimum_revision = Some(revision);
        self
    }

    /// Expects these bits of the revision, as descriptions compare its high or its low word.
    #[must_use]
    pub const fn expect_revision_bits(mut self, revision: u32, mask: u32) -> SubDeviceConfig {
        self.expected.revision = Some(revision);
        self.expected.revision_mask = mask;
        self
    }

    /// Expects an explicit device identification.
    #[must_use]
    pub fn expect_identification(mut self, value: u16) -> SubDeviceConfig {
        self.expected.identification = Some(value);
        self
    }

    /// Expects a serial number.
    #[must_use]
    pub fn expect_serial(mut self, serial: u32) -> SubDeviceConfig {
        self.expected.serial = Some(serial);
        self
    }

    /// What it may receive a second time within a cycle, when a frame was lost and is sent again.
    #[must_use]
    pub fn repeat(mut self, repetition: Repetition) -> SubDeviceConfig {
        self.repetition = repetition;
        self
    }

    /// The segment works without it.
    #[must_use]
    pub fn optional(mut self) -> SubDeviceConfig {
        self.optional = true;
        self
    }

    /// Overrides the settings of a SyncManager; a later call for the same one replaces the earlier.
    #[must_use]
    pub fn sync_manager(mut self, index: u8, direction: Direction, watchdog: Watchdog) -> SubDeviceConfig {
        self.sync_managers.retain(|sync_manager| sync_manager.index != index);
        self.sync_managers.push(SyncManagerOverride { index, direction, watchdog });
        self
    }

    /// Declares the PDOs of a SyncManager; a later call for the same one replaces the earlier.
    #[must_use]
    pub fn assign(mut self, sync_manager: u8, direction: Direction, pdos: Vec<PdoMapping>) -> SubDeviceConfig {
        let assignments = self.pdos.get_or_insert_with(Vec::new);
        assignments.retain(|assignment| assignment.sync_manager != sync_manager);
        assignments.push(PdoAssignment { sync_manager, direction, pdos });
        self
    }

    /// What follows if it refuses the assignment or mapping of its PDOs.
    #[must_use]
    pub fn refused_pdos(mut self, refused_pdos: RefusedPdos) -> SubDeviceConfig {
        self.refused_pdos = refused_pdos;
        self
    }

    /// Declares the PDOs of a SubDevice of this type, so that they have a place in the image while it is absent.
    #[must_use]
    pub fn pdos_of(mut self, info: &SubDeviceInfo) -> SubDeviceConfig {
        for sync_manager in 0..info.controller.sync_manager_count {
            let mut pdos = info.assigned_pdos(sync_manager).peekable();
            let Some(direction) = pdos.peek().map(|pdo| pdo.direction) else { continue };
            let entry = |entry: &PdoEntryInfo| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length);
            let mapping = |pdo: &PdoInfo| PdoMapping::of(pdo.index, pdo.entries.iter().map(entry).collect::<Vec<_>>());
            let pdos = pdos.map(mapping).collect();
            self = self.assign(sync_manager, direction, pdos);
        }
        self
    }

    /// Takes all SyncManagers from a configuration file: [`SubDeviceConfig::declared`].
    #[must_use]
    pub fn declared(mut self, sync_managers: Vec<DeclaredSyncManager>) -> SubDeviceConfig {
        self.declared = Some(sync_managers);
        self
    }

    /// Sets the watchdog: divider and, in units of it, the process data time.
    #[must_use]
    pub fn watchdog(mut self, divider: Option<u16>, intervals: Option<u16>) -> SubDeviceConfig {
        self.watchdog_divider = divider;
        self.watchdog_intervals = intervals;
        self
    }

    /// Sets the PDI watchdog time, in units of the divider.
    #[must_use]
    pub fn pdi_watchdog(mut self, intervals: u16) -> SubDeviceConfig {
        self.pdi_watchdog_intervals = Some(intervals);
        self
    }

    /// Appends an SDO download in PREOP, before SAFEOP is requested.
    #[must_use]
    pub fn sdo(self, index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        self.sdo_at(Transition::Ps, index, sub_index, data)
    }

    /// Appends an SDO download with complete access in PREOP, before SAFEOP is requested, from subindex 0 or 1.
    #[must_use]
    pub fn sdo_complete(self, index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        let sdo = SdoDownload { index, sub_index, complete_access: true, data: data.into() };
        self.startup(Transition::Ps, StartupAction::Sdo(sdo))
    }

    /// Appends an SDO download at a transition.
    #[must_use]
    pub fn sdo_at(
        self,
        transition: Transition,
        index: u16,
        sub_index: u8,
        data: impl Into<Vec<u8>>,
    ) -> SubDeviceConfig {
        let sdo = SdoDownload { index, sub_index, complete_access: false, data: data.into() };
        self.startup(transition, StartupAction::Sdo(sdo))
    }

    /// Appends the write of an IDN's value at a transition: in PREOP for [`Transition::Ps`], in SAFEOP for
    /// [`Transition::So`].
    #[must_use]
    pub fn idn_at(self, transition: Transition, drive: u8, idn: Idn, data: impl Into<Vec<u8>>) -> SubDeviceConfig {
        self.startup(transition, StartupAction::Idn(IdnWrite { drive, idn, data: data.into() }))
    }

    /// Appends a set IP parameter request (EoE), before SAFEOP is requested.
    #[must_use]
    pub fn ip(self, settings: IpSettings) -> SubDeviceConfig {
        self.startup(Transition::Ps, StartupAction::Ip(settings))
    }

    /// Appends a start-up command.
    #[must_use]
    pub fn startup(mut self, transition: Transition, action: StartupAction) -> SubDeviceConfig {
        self.startup.push(StartupCommand::new(transition, action));
        self
    }

    /// Assigns the EEPROM to the PDI before PREOP is requested.
    #[must_use]
    pub fn sii_to_pdi(mut self) -> SubDeviceConfig {
        self.sii_to_pdi = true;
        self
    }

    /// Waits in PREOP before SAFEOP is requested.
    #[must_use]
    pub fn wait_before_safeop(mut self, pause: Duration) -> SubDeviceConfig {
        self.wait_before_safeop = pause;
        self
    }

    /// Sets the time limit of one state change; a later call for the same change replaces the earlier.
    #[must_use]
    pub fn state_timeout(mut self, from: AlState, to: AlState, limit: Duration) -> SubDeviceConfig {
        self.state_timeouts.retain(|own| (own.from, own.to) != (from, to));
        self.state_timeouts.push(StateTimeout { from, to, limit });
        self
    }

    /// Time limit of a state change.
    pub fn limit(&self, from: AlState, to: AlState) -> Duration {
        let own = self.state_timeouts.iter().find(|own| (own.from, own.to) == (from, to));
        own.map_or_else(|| self.timeouts.transition(from, to), |own| own.limit)
    }

    /// Declares SYNC signals.
    #[must_use]
    pub fn sync(mut self, signals: SyncSignals) -> SubDeviceConfig {
        self.sync = Some(signals);
        self
    }

    /// Sets the time that frames take through it.
    #[must_use]
    pub fn passage(mut self, passage: Passage) -> SubDeviceConfig {
        self.passage = Some(passage);
        self
    }

    /// Sets the time limits.
    #[must_use]
    pub fn timeouts(mut self, timeouts: Timeouts) -> SubDeviceConfig {
        self.timeouts = timeouts;
        self
    }

    /// Sets the target state.
    #[must_use]
    pub fn target(mut self, target: AlState) -> SubDeviceConfig {
        self.target = target;
        self
    }
}
