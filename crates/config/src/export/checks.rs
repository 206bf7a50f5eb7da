//! Settings without which another network would result.

use std::time::Duration;

use ringcat_engine::config::{ConfigAddress, StartupAction, SubDeviceConfig};
use ringcat_wire::al::AlState;

use super::error::ExportError;
use crate::configuration::Configuration;
use crate::follow::{HIGH_WORD, LOW_WORD};

pub(super) fn check(configuration: &Configuration) -> Result<(), ExportError> {
    let declaration = &configuration.declaration;
    if declaration.subdevices.is_empty() {
        return Err(ExportError::whole("network", "it has no SubDevice"));
    }
    for (index, config) in declaration.subdevices.iter().enumerate() {
        if let Some((what, key, reason)) = problem(config) {
            return Err(ExportError::of(configuration, index, what, reason).at(key));
        }
    }
    for (number, domain) in declaration.domains.iter().enumerate() {
        if !domain.period.as_nanos().is_multiple_of(1_000) || u32::try_from(domain.period.as_micros()).is_err() {
            let reason = format!("{:?}: a cycle time of an ENI is a number of microseconds", domain.period);
            return Err(ExportError::whole("domain", reason).at(format!("domain[{number}].period")));
        }
    }
    let mut sdos = declaration.subdevices.iter().flat_map(|config| &config.startup).filter_map(|it| match &it.action {
        StartupAction::Sdo(_) => Some(false),
        StartupAction::Upload(upload) => Some(upload.expected.as_ref().is_some_and(|data| !data.is_empty())),
        _ => None,
    });
    let mut all = sdos.by_ref().peekable();
    if all.peek().is_some() && all.all(|is_upload| is_upload) {
        let reason = "all CoE commands are uploads with an expected value: a reader would take them as downloads, as \
                      some tools write them; one download or one upload without a value decides it";
        return Err(ExportError::whole("start-up commands", reason));
    }
    Ok(())
}

/// The setting, its key and the reason.
fn problem(config: &SubDeviceConfig) -> Option<(&'static str, String, String)> {
    if config.target != AlState::Op {
        return Some(("target", "target".to_owned(), format!("{}: an ENI describes a network in OP", config.target)));
    }
    if config.group.is_none() && !matches!(config.address, ConfigAddress::Position(_)) {
        let reason = "an alias or an identification finds only SubDevices of hot connect groups in an ENI: give it a \
                      position, or a group of its own";
        let key = if matches!(config.address, ConfigAddress::Alias { .. }) { "alias" } else { "identification" };
        return Some(("place", key.to_owned(), reason.to_owned()));
    }
    let expected = &config.expected;
    if expected.revision.is_some() && ![u32::MAX, LOW_WORD, HIGH_WORD].contains(&expected.revision_mask) {
        let reason = "the commands of an ENI compare the whole revision, its low word or its high word";
        return Some(("comparison of the revision", "check_revision".to_owned(), reason.to_owned()));
    }
    if expected.identification.is_some() {
        let reason = "an ENI compares it only at the head of a hot connect group";
        return Some(("identification", "check_identification".to_owned(), reason.to_owned()));
    }
    let limits = config.startup.iter().filter_map(|command| command.limit);
    let odd = limits.chain(config.state_timeouts.iter().map(|it| it.limit)).find_map(odd_limit);
    odd.map(|reason| ("time limit", String::new(), reason))
}

/// Why an ENI cannot express this limit; `None` if it can.
pub(crate) fn odd_limit(limit: Duration) -> Option<String> {
    (!is_in_ms(limit)).then(|| format!("{limit:?}: a time limit of an ENI is a number of milliseconds"))
}

/// Whether an ENI can express this limit.
pub(super) fn is_in_ms(limit: Duration) -> bool {
    let ms = limit.as_millis();
    limit.as_nanos().is_multiple_of(1_000_000) && (1..=u128::from(u32::MAX)).contains(&ms)
}
