//! Settings that an ENI has no place for and without which the network reaches OP nevertheless.

use std::time::Duration;

use ringcat_engine::config::{ClockConfig, Repetition, StartupAction, SubDeviceConfig, Timeouts};
use ringcat_engine::layout::LrwPolicy;
use ringcat_engine::main_device::{Declaration, Required};

use super::error::LeftOut;
use crate::configuration::Configuration;

/// All settings of a configuration without a place.
pub(super) fn of(configuration: &Configuration) -> Vec<LeftOut> {
    let declaration = &configuration.declaration;
    let mut left_out = Vec::new();
    of_network(declaration, &mut left_out);
    if let Some(clocks) = &declaration.clocks {
        of_clocks(clocks, &mut left_out);
    }
    for (index, config) in declaration.subdevices.iter().enumerate() {
        of_subdevice(index, config, &mut left_out);
    }
    left_out
}

fn of_network(declaration: &Declaration, left_out: &mut Vec<LeftOut>) {
    let mut add = |what: &str, reason: &str| left_out.push(LeftOut::new(None, what, reason));
    if declaration.required != Required::default() {
        add("required", "which absent SubDevices prevent the activation is the application's choice");
    }
    if declaration.lrw == LrwPolicy::PerSubDevice {
        add("lrw", "the datagrams of the file hold several SubDevices");
    }
    if declaration.domains.iter().any(|domain| domain.under_way != 1) {
        add("domain/under_way", "an ENI has one cycle at a time");
    }
    if declaration.domains.iter().any(|domain| domain.sends_again) {
        add("domain/send_again", "lost frames of a cycle are not sent again");
    }
}

fn of_clocks(clocks: &ClockConfig, left_out: &mut Vec<LeftOut>) {
    let usual = ClockConfig::default().with_reference(clocks.reference).with_bus_shift(clocks.bus_shift);
    if *clocks != usual {
        let reason = "windows, limits and permissions of the clocks are the MainDevice's choice";
        left_out.push(LeftOut::new(None, "clocks", reason));
    }
}

fn of_subdevice(index: usize, config: &SubDeviceConfig, left_out: &mut Vec<LeftOut>) {
    let mut add = |what: &str, reason: &str| left_out.push(LeftOut::new(index, what, reason));
    if let Some(minimum) = config.expected.minimum_revision {
        let rest = if config.expected.revision.is_some() { "the other word is compared" } else { "none is compared" };
        let reason = format!("commands cannot compare with a lowest revision, {minimum:#010x}: {rest}");
        add("check_revision", &reason);
    }
    if config.optional && config.group.is_none() {
        add("optional", "outside of hot connect groups every SubDevice of an ENI has to be there");
    }
    if config.repetition != Repetition::default() {
        add("repeat", "an ENI does not send lost frames again");
    }
    if config.passage.is_some() {
        add("passage", "the delays are measured without it");
    }
    if config.wait_before_safeop != Duration::ZERO {
        add("wait_before_safeop", "an ENI has no pauses");
    }
    let (own, usual) = (&config.timeouts, Timeouts::default());
    let mail = |of: &Timeouts| (of.mailbox_request, of.sdo, of.soe, of.eoe);
    if mail(own) != mail(&usual) {
        add("timeouts", "an ENI has time limits of single mailbox commands only");
    }
    let is_limited = |command: &ringcat_engine::config::StartupCommand| {
        command.limit.is_some() && matches!(command.action, StartupAction::Register(_))
    };
    if config.startup.iter().any(is_limited) {
        add("startup/limit", "commands to registers have no time limit of their own");
    }
}
