//! What each SubDevice may receive twice in a cycle, when a lost frame is sent again (decision 0045).
//!
//! Input: declarations, plans, what the scan found. Output: a rule for each SubDevice. What is unknown is not repeated.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::register::SyncManagerMode;

use super::areas::Areas;
use crate::config::{Repetition, StartupAction, SubDeviceConfig};
use crate::direction::Direction;
use crate::info::SubDeviceInfo;
use crate::layout::{OutputsAgain, RepeatRule};

/// The object with the synchronisation type of outputs (ETG.1020), and its value for free run.
const SYNC_TYPE: (u16, u8) = (0x1C32, 1);
const FREE_RUN: u8 = 0;

/// A rule for each SubDevice.
pub(super) fn rules(
    configs: &[SubDeviceConfig],
    plans: &[Areas],
    found: &[Option<Rc<SubDeviceInfo>>],
) -> Vec<RepeatRule> {
    let all = configs.iter().zip(plans).zip(found);
    all.map(|((config, areas), info)| rule(config, areas, info.as_deref())).collect()
}

fn rule(config: &SubDeviceConfig, areas: &Areas, info: Option<&SubDeviceInfo>) -> RepeatRule {
    let (Areas::Planned(Some(plan)), Some(info)) = (areas, info) else {
        // Absent at the scan, or without a usable SII: only what was declared is known.
        return by_declaration(config).unwrap_or(RepeatRule::NEVER);
    };
    let has_one_buffer = |wanted: Direction| {
        plan.process_data
            .iter()
            .any(|area| area.direction == wanted && area.register.control.mode != SyncManagerMode::Buffered)
    };
    if has_one_buffer(Direction::Outputs) || has_one_buffer(Direction::Inputs) {
        return RepeatRule::NEVER;
    }
    if let Some(rule) = by_declaration(config) {
        return rule;
    }
    let outputs =
        if info.mailbox.is_some() && info.protocols.coe() { by_sync_type(config) } else { OutputsAgain::Always };
    RepeatRule { outputs, inputs: true }
}

/// The rule of a declaration that decides alone.
fn by_declaration(config: &SubDeviceConfig) -> Option<RepeatRule> {
    let before_sync0 = config.sync.map(|signals| OutputsAgain::BeforeSync0 {
        cycle_ns: signals.sync0_cycle_ns,
        shift_ns: signals.sync0_shift_ns,
    });
    match config.repetition {
        Repetition::Automatic => before_sync0.map(|outputs| RepeatRule { outputs, inputs: true }),
        Repetition::Everything => {
            Some(RepeatRule { outputs: before_sync0.unwrap_or(OutputsAgain::Always), inputs: true })
        }
        Repetition::Inputs => Some(RepeatRule { outputs: OutputsAgain::Never, inputs: true }),
        Repetition::Nothing => Some(RepeatRule::NEVER),
    }
}

/// By the synchronisation type that a start-up command writes.
fn by_sync_type(config: &SubDeviceConfig) -> OutputsAgain {
    let written = config.startup.iter().rev().find_map(|command| match &command.action {
        StartupAction::Sdo(sdo) if (sdo.index, sdo.sub_index) == SYNC_TYPE => sdo.data.first().copied(),
        _ => None,
    });
    if written == Some(FREE_RUN) { OutputsAgain::Always } else { OutputsAgain::Never }
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
        assert_eq!(of(&SubDeviceConfig::default()), RepeatRule::NEVER);
        let free = SubDeviceConfig { repetition: Repetition::Everything, ..SubDeviceConfig::default() };
        assert_eq!(of(&free), RepeatRule::default());
        let clocked = SubDeviceConfig { sync: Some(SyncSignals::sync0(1_000, -5)), ..SubDeviceConfig::default() };
        assert_eq!(of(&clocked).outputs, OutputsAgain::BeforeSync0 { cycle_ns: 1_000, shift_ns: -5 });
        let reads = SubDeviceConfig { repetition: Repetition::Inputs, ..clocked };
        assert_eq!(of(&reads), RepeatRule { outputs: OutputsAgain::Never, inputs: true });
    }

    // covers: lost-frames
    #[test]
    fn free_run_follows_from_a_start_up_command() {
        let config = SubDeviceConfig::default();
        assert_eq!(by_sync_type(&config), OutputsAgain::Never);
        let free = config.clone().sdo(0x1C32, 1, [0, 0]);
        assert_eq!(by_sync_type(&free), OutputsAgain::Always);
        assert_eq!(by_sync_type(&free.sdo(0x1C32, 1, [1, 0])), OutputsAgain::Never);
    }
}
