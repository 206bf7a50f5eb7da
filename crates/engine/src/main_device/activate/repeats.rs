//! What each SubDevice may receive twice in a cycle, when a lost frame is sent again (decision 0045).
//!
//! Input: declarations, plans, what the scan found. Output: a rule for each SubDevice, and the reason where not all of
//! its process data may be repeated. What is unknown is not repeated.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::register::SyncManagerMode;

use super::sent_once::SentOnce;
use crate::config::{Repetition, StartupAction, SubDeviceConfig};
use crate::direction::Direction;
use crate::info::SubDeviceInfo;
use crate::layout::{OutputsAgain, RepeatRule};
use crate::main_device::declaration::areas::Areas;

/// The object with the synchronisation type of outputs (ETG.1020), and its value for free run.
const SYNC_TYPE: (u16, u8) = (0x1C32, 1);
const FREE_RUN: u8 = 0;

/// The rule of a SubDevice of which not everything is repeated.
const fn restricted(reason: SentOnce) -> RepeatRule {
    match reason {
        SentOnce::SmSynchronous | SentOnce::OutputsDeclared => {
            RepeatRule { outputs: OutputsAgain::Never, inputs: true }
        }
        SentOnce::OneBuffer | SentOnce::Unknown | SentOnce::Declared => RepeatRule::NEVER,
    }
}

/// For each SubDevice its rule, or the reason for which not everything is repeated.
pub(in crate::main_device) fn of_all(
    configs: &[SubDeviceConfig],
    plans: &[Areas],
    found: &[Option<Rc<SubDeviceInfo>>],
) -> Vec<Result<RepeatRule, SentOnce>> {
    let all = configs.iter().zip(plans).zip(found);
    all.map(|((config, areas), info)| rule(config, areas, info.as_deref())).collect()
}

/// The rules alone.
pub(in crate::main_device) fn rules(of_all: &[Result<RepeatRule, SentOnce>]) -> Vec<RepeatRule> {
    of_all.iter().map(|it| it.unwrap_or_else(restricted)).collect()
}

fn rule(config: &SubDeviceConfig, areas: &Areas, info: Option<&SubDeviceInfo>) -> Result<RepeatRule, SentOnce> {
    let (Areas::Planned(Some(plan)), Some(info)) = (areas, info) else {
        // Absent at the scan, or without a usable SII: only what was declared is known.
        return by_declaration(config).unwrap_or(Err(SentOnce::Unknown));
    };
    if plan.process_data.iter().any(|area| area.register.control.mode != SyncManagerMode::Buffered) {
        return Err(SentOnce::OneBuffer);
    }
    if let Some(rule) = by_declaration(config) {
        return rule;
    }
    let takes_events = info.mailbox.is_some() && info.protocols.coe() && !runs_free(config);
    let has_outputs = plan.process_data.iter().any(|area| area.direction == Direction::Outputs);
    if takes_events && has_outputs { Err(SentOnce::SmSynchronous) } else { Ok(RepeatRule::default()) }
}

/// The rule of a declaration that decides alone.
fn by_declaration(config: &SubDeviceConfig) -> Option<Result<RepeatRule, SentOnce>> {
    let before_sync0 = config.sync.map(|signals| OutputsAgain::BeforeSync0 {
        cycle_ns: signals.sync0_cycle_ns,
        shift_ns: signals.sync0_shift_ns,
    });
    match config.repetition {
        Repetition::Automatic => before_sync0.map(|outputs| Ok(RepeatRule { outputs, inputs: true })),
        Repetition::Everything => {
            Some(Ok(RepeatRule { outputs: before_sync0.unwrap_or(OutputsAgain::Always), inputs: true }))
        }
        Repetition::Inputs => Some(Err(SentOnce::OutputsDeclared)),
        Repetition::Nothing => Some(Err(SentOnce::Declared)),
    }
}

/// Whether a start-up command selects free run.
fn runs_free(config: &SubDeviceConfig) -> bool {
    let written = config.startup.iter().rev().find_map(|command| match &command.action {
        StartupAction::Sdo(sdo) if (sdo.index, sdo.sub_index) == SYNC_TYPE => sdo.data.first().copied(),
        _ => None,
    });
    written == Some(FREE_RUN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::SyncSignals;

    // covers: lost-frames
    #[test]
    fn a_subdevice_that_was_not_scanned_receives_only_what_its_declaration_allows_twice() {
        let areas = Areas::Planned(None);
        let of = |config: &SubDeviceConfig| rule(config, &areas, None);
        assert_eq!(of(&SubDeviceConfig::default()), Err(SentOnce::Unknown));
        let free = SubDeviceConfig { repetition: Repetition::Everything, ..SubDeviceConfig::default() };
        assert_eq!(of(&free), Ok(RepeatRule::default()));
        let clocked = SubDeviceConfig { sync: Some(SyncSignals::sync0(1_000, -5)), ..SubDeviceConfig::default() };
        let expected = OutputsAgain::BeforeSync0 { cycle_ns: 1_000, shift_ns: -5 };
        assert_eq!(of(&clocked), Ok(RepeatRule { outputs: expected, inputs: true }));
        let reads = SubDeviceConfig { repetition: Repetition::Inputs, ..clocked };
        assert_eq!(rules(&[of(&reads)]), [RepeatRule { outputs: OutputsAgain::Never, inputs: true }]);
        assert_eq!(rules(&[Err(SentOnce::OneBuffer)]), [RepeatRule::NEVER]);
    }

    // covers: lost-frames
    #[test]
    fn free_run_follows_from_a_start_up_command() {
        let config = SubDeviceConfig::default();
        assert!(!runs_free(&config));
        let free = config.clone().sdo(0x1C32, 1, [0, 0]);
        assert!(runs_free(&free));
        assert!(!runs_free(&free.sdo(0x1C32, 1, [1, 0])));
    }
}
