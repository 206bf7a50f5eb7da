//! Digests of a configuration: whether two MainDevices have the same (protocol MR-15, REQ010).
//!
//! A digest is that of a canonical form: fields with their numbers, without those that have their default value. So a
//! field that a later version adds changes no digest as long as it is not used.

use core::hash::{Hash, Hasher};

use super::SubDeviceConfig;

/// FNV-1a over bytes in an order that does not depend on the machine.
#[derive(Clone, Copy, Debug)]
pub struct Digest(u64);

impl Default for Digest {
    fn default() -> Digest {
        Digest(0xCBF2_9CE4_8422_2325)
    }
}

impl Hasher for Digest {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01B3);
        }
    }

    fn write_u16(&mut self, value: u16) {
        self.write(&value.to_le_bytes());
    }

    fn write_u32(&mut self, value: u32) {
        self.write(&value.to_le_bytes());
    }

    fn write_u64(&mut self, value: u64) {
        self.write(&value.to_le_bytes());
    }

    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }

    fn write_i64(&mut self, value: i64) {
        self.write_u64(value as u64);
    }

    fn write_isize(&mut self, value: isize) {
        self.write_u64(value as u64);
    }
}

impl Digest {
    /// Adds a field that has a number of its own, unless it has its default value.
    pub fn field<T: Hash + PartialEq>(&mut self, number: u16, value: &T, default: &T) {
        if value != default {
            self.write_u16(number);
            value.hash(self);
        }
    }

    /// In 32 bits.
    pub fn short(&self) -> u32 {
        (self.0 ^ self.0 >> 32) as u32
    }
}

/// A part of the declaration of a SubDevice that has a digest of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigPart {
    /// Place and identity.
    Identity,
    /// Process data: SyncManagers and PDOs.
    ProcessData,
    /// Start-up commands.
    Startup,
    /// Everything else: state, watchdogs, SYNC signals, time limits.
    Operation,
}

impl ConfigPart {
    /// All of them.
    pub const ALL: [ConfigPart; 4] =
        [ConfigPart::Identity, ConfigPart::ProcessData, ConfigPart::Startup, ConfigPart::Operation];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            ConfigPart::Identity => "place or identity",
            ConfigPart::ProcessData => "process data",
            ConfigPart::Startup => "start-up commands",
            ConfigPart::Operation => "target state, watchdogs, SYNC signals or time limits",
        }
    }
}

impl SubDeviceConfig {
    /// Digest of a part.
    pub fn digest(&self, part: ConfigPart) -> u32 {
        let default = SubDeviceConfig::default();
        let SubDeviceConfig {
            address,
            expected,
            optional,
            group,
            sync_managers,
            pdos,
            refused_pdos,
            declared,
            declared_bootstrap,
            watchdog_divider,
            watchdog_intervals,
            pdi_watchdog_intervals,
            startup,
            sii_to_pdi,
            wait_before_safeop,
            sync,
            repetition,
            passage,
            timeouts,
            state_timeouts,
            target,
        } = self;
        let mut digest = Digest::default();
        match part {
            ConfigPart::Identity => {
                digest.field(1, address, &default.address);
                digest.field(2, expected, &default.expected);
                digest.field(3, optional, &default.optional);
                digest.field(4, &group.map(|group| group.0), &None);
            }
            ConfigPart::ProcessData => {
                digest.field(5, sync_managers, &default.sync_managers);
                digest.field(6, pdos, &default.pdos);
                digest.field(21, refused_pdos, &default.refused_pdos);
                digest.field(7, declared, &default.declared);
                digest.field(8, declared_bootstrap, &default.declared_bootstrap);
            }
            ConfigPart::Startup => digest.field(12, startup, &default.startup),
            ConfigPart::Operation => {
                digest.field(9, watchdog_divider, &default.watchdog_divider);
                digest.field(10, watchdog_intervals, &default.watchdog_intervals);
                digest.field(11, pdi_watchdog_intervals, &default.pdi_watchdog_intervals);
                digest.field(13, sii_to_pdi, &default.sii_to_pdi);
                digest.field(14, wait_before_safeop, &default.wait_before_safeop);
                digest.field(15, sync, &default.sync);
                digest.field(16, repetition, &default.repetition);
                digest.field(17, passage, &default.passage);
                digest.field(18, timeouts, &default.timeouts);
                digest.field(19, state_timeouts, &default.state_timeouts);
                digest.field(20, target, &default.target);
            }
        }
        digest.short()
    }
}

#[cfg(test)]
mod tests {
    use core::time::Duration;

    use super::*;
    use crate::config::{SdoDownload, StartupAction, StartupCommand, Transition};

    // covers: REQ010, MR-15, standby
    #[test]
    fn a_changed_field_changes_the_digest_of_its_part_alone() {
        let base = SubDeviceConfig::default();
        let digests = |config: &SubDeviceConfig| ConfigPart::ALL.map(|part| config.digest(part));
        let changes = |config: SubDeviceConfig| {
            let (before, after) = (digests(&base), digests(&config));
            [0, 1, 2, 3].map(|at| before[at] != after[at])
        };
        let download = StartupAction::Sdo(SdoDownload::new(0x8000, 1, [1]));
        let startup = alloc::vec![StartupCommand::new(Transition::Ps, download)];
        let waits = Duration::from_millis(1);
        assert_eq!(changes(SubDeviceConfig { optional: true, ..base.clone() }), [true, false, false, false]);
        assert_eq!(changes(SubDeviceConfig { pdos: Some(Default::default()), ..base.clone() })[..2], [false, true]);
        assert_eq!(changes(SubDeviceConfig { startup, ..base.clone() }), [false, false, true, false]);
        assert_eq!(changes(SubDeviceConfig { wait_before_safeop: waits, ..base.clone() })[3..], [true]);
        assert_eq!(changes(base.clone()), [false; 4]);
    }

    // covers: REQ010, standby
    #[test]
    fn the_digest_of_a_default_is_that_of_nothing_and_does_not_depend_on_the_build() {
        assert_eq!(SubDeviceConfig::default().digest(ConfigPart::Startup), Digest::default().short());
        let mut digest = Digest::default();
        digest.field(7, &0x0102_u16, &0);
        // FNV-1a of 07 00 02 01.
        let bytes = [7, 0, 2, 1].iter().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(*byte as u8)).wrapping_mul(0x100_0000_01B3)
        });
        assert_eq!(digest.finish(), bytes);
    }
}
