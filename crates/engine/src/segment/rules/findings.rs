//! What is reported of the findings of a scan, and of its comparison with a declaration.

use alloc::borrow::ToOwned;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use crate::config::ConfigError;
use crate::event::Event;
use crate::segment::effect::Effects;
use crate::segment::findings::{CablingFindings, DeclarationFinding, ScanFinding, SettingFinding};
use crate::segment::model::Segment;
use crate::topology::Finding;

impl Segment {
    /// What the scan under way has found, and that it has found this number of SubDevices. Nothing is reported of a
    /// scan that was given up.
    pub(in crate::segment) fn report_scan(&self, findings: Vec<ScanFinding>, subdevices: usize, effects: &mut Effects) {
        if !self.is_scanning() {
            return;
        }
        for finding in findings {
            match finding {
                ScanFinding::Sii { position, warning } => {
                    effects.report(Event::SiiWarning { position, what: warning.to_string() });
                }
                ScanFinding::DuplicateAlias(duplicate) => {
                    let (first, second) = (duplicate.first, duplicate.second);
                    effects.report(Event::DuplicateAlias { alias: duplicate.alias, first, second });
                }
                ScanFinding::Cabling(cabling) => report_cabling(&cabling, effects),
                ScanFinding::JunctionLearned(closing) => effects.report(Event::JunctionLearned { closing }),
                ScanFinding::JunctionsNotLearned(rings) => effects.report(Event::JunctionsNotLearned { rings }),
            }
        }
        effects.report(Event::ScanFinished { subdevices });
    }
}

/// Reports a finding of the comparison of a declaration with the scan.
pub(super) fn report_comparison(finding: DeclarationFinding, effects: &mut Effects) {
    effects.report(match finding {
        DeclarationFinding::Unexpected { position, identity } => Event::Unexpected { position, identity },
        DeclarationFinding::Absent { subdevice, is_optional: optional, error } => match error {
            ConfigError::Mismatch { position, field, expected, got } => {
                Event::Mismatch { subdevice, position, field, expected, got }
            }
            ConfigError::Missing { .. } | ConfigError::Ambiguous { .. } | ConfigError::DeclaredTwice { .. } => {
                Event::Missing { subdevice, optional }
            }
        },
        DeclarationFinding::Cabling(cabling) => return report_cabling(&cabling, effects),
        DeclarationFinding::SettingFinding(subdevice, warning) => {
            Event::DeclarationWarning { subdevice, what: text(&warning) }
        }
    });
}

/// Swapped interfaces explain crossed lines, and a located crossing explains that others are processed by the redundant
/// copy (protocol LC-04).
fn report_cabling(cabling: &CablingFindings, effects: &mut Effects) {
    if cabling.are_swapped {
        effects.report(Event::InterfacesSwapped);
    }
    let mut is_explained = cabling.are_swapped;
    for (position, finding) in &cabling.findings {
        let position = *position;
        match *finding {
            Finding::UnconnectedPort0 { .. } => effects.report(Event::UnconnectedPort0 { position }),
            Finding::CrossedLine { .. } if cabling.are_swapped => {}
            Finding::CrossedLine { entry_port, .. } => {
                is_explained = true;
                effects.report(Event::LineCrossed { position: Some(position), entry_port: Some(entry_port) });
            }
            Finding::ForcedOpen { .. }
            | Finding::ClosedWithLink { .. }
            | Finding::LinkWithoutCommunication { .. }
            | Finding::Inconsistent { .. } => {
                effects.report(Event::CablingWarning { position, what: finding.to_string() });
            }
        }
    }
    if cabling.is_redundant_processed && !is_explained {
        effects.report(Event::LineCrossed { position: None, entry_port: None });
    }
}

fn text(warning: &SettingFinding) -> String {
    match warning {
        SettingFinding::Plan(warning) => warning.to_string(),
        SettingFinding::AbsentEnd(connection) => {
            alloc::format!("not there: its {connection} is not watched until a rescan finds it")
        }
        SettingFinding::Watchdog { period, watchdog } => {
            let (period, watchdog) = (period.as_millis(), watchdog.as_millis());
            alloc::format!("its outputs come every {period} ms, its watchdog expires after {watchdog} ms")
        }
        SettingFinding::NoPlace => {
            "not there, and its PDOs are not declared: when it comes, it has no place in the process \
                            image"
                .to_owned()
        }
        SettingFinding::Reference { instead: Some(instead) } => alloc::format!(
            "declared as the reference clock, but it has no distributed clock: the clock at position {instead} is the \
             reference"
        ),
        SettingFinding::Reference { instead: None } => {
            "declared as the reference clock, but neither it nor another SubDevice has a distributed clock".to_owned()
        }
    }
}
