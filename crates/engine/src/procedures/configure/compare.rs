//! Reasons for a refused SAFEOP: compares the configured process data with the SubDevice's dictionary.

use alloc::format;

use ringcat_wire::al::AlStatusCode;

use super::{BringUp, ConfigureError};
use crate::mail::Limits;
use crate::mail::coe::pdo;
use crate::procedures::al_state::StateError;
use crate::segment::MemberFinding;

/// AL status codes that may be due to wrong sizes (protocol 5.5).
const OF_SIZES: [AlStatusCode; 5] = [
    AlStatusCode::INVALID_SYNC_MANAGER_CONFIGURATION,
    AlStatusCode::INVALID_OUTPUT_CONFIGURATION,
    AlStatusCode::INVALID_INPUT_CONFIGURATION,
    AlStatusCode::INVALID_INPUT_MAPPING,
    AlStatusCode::INVALID_OUTPUT_MAPPING,
];

impl BringUp<'_> {
    /// Reports differences between dictionary and configuration, if they may be the cause.
    pub(super) async fn explain(&self, error: &ConfigureError) {
        let ConfigureError::State(StateError::Refused { code, .. }) = error else { return };
        if !OF_SIZES.contains(code) || !self.mailbox.is_open() {
            return;
        }
        let limits = Limits::new(self.config.timeouts.mailbox_request, self.config.timeouts.sdo);
        for area in &self.setup.plan.process_data {
            // A SubDevice without these objects has nothing to compare.
            let Ok(pdos) = pdo::read_assignment(&self.mailbox, area.sync_manager, limits).await else { return };
            let entries = pdos.iter().flat_map(|pdo| pdo.entries.iter().flatten());
            let bits: u32 = entries.map(|entry| u32::from(entry.bit_length)).sum();
            if bits.div_ceil(8) != u32::from(area.length) {
                let what = format!(
                    "SM {}: {} bytes are configured, the PDOs in the dictionary have {}",
                    area.sync_manager,
                    area.length,
                    bits.div_ceil(8)
                );
                self.segment.observe_member((self.index, self.attempt), MemberFinding::SettingFinding(what));
            }
        }
    }
}
