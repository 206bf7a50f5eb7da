//! The variables of RingCAT: what the options of the daemon are, and simulated segments.

use std::fmt::Display;
use std::str::FromStr;

use ringcat_control::BusSettings;

use super::{MOST_MASTERS, Reading, master};
use crate::rights::{group, mode};
use crate::source::SafeState;

/// Highest level of messages.
const MOST_DEBUG: u32 = 2;

impl Reading {
    /// Evaluates a variable by its name behind `RINGCAT_`. Returns its meaning. An empty value counts as not set.
    pub(super) fn own(&mut self, line: usize, name: &str, value: &str) -> Result<String, String> {
        if let Some(rest) = name.strip_prefix("MASTER") {
            return self.of_master(line, rest, value);
        }
        let own = &mut self.conf.own;
        let is_set = !value.is_empty();
        match name {
            _ if BusSettings::variables().any(|it| it == name) && !is_set => Ok("empty: the default".to_owned()),
            _ if BusSettings::variables().any(|it| it == name) => own.bus.set(name, value),
            "SOCKET" | "MODE" | "GROUP" | "STOP_LIMIT" | "EOE" | "DEBUG_IF" | "DEBUG_LEVEL" | "BACKUP" if !is_set => {
                Ok("empty: the default".to_owned())
            }
            "SOCKET" if !value.starts_with('/') => Err(format!("expected a path from /, got {value:?}")),
            "SOCKET" => {
                own.socket = Some(value.into());
                Ok(format!("listens at {value}"))
            }
            "MODE" => {
                own.mode = Some(mode(value)?);
                Ok(format!("mode of the socket: {value}"))
            }
            "GROUP" => {
                own.group = Some(group(value)?);
                Ok(format!("group of the socket: {value}"))
            }
            "STOP_LIMIT" => {
                let limit = number(value, 1, 3_600_000)?;
                own.stop_limit = Some(limit);
                Ok(format!("an application that is stopped for {limit} ms loses its master"))
            }
            "EOE" => {
                let has = choice(value, &[("yes", true), ("no", false)])?;
                own.eoe = Some(has);
                Ok(format!("{} network interfaces for EoE", if has { "makes" } else { "makes no" }))
            }
            "DEBUG_IF" => {
                own.has_debug_interfaces = choice(value, &[("yes", true), ("no", false)])?;
                Ok(format!("{} debug interfaces", if own.has_debug_interfaces { "makes" } else { "makes no" }))
            }
            "DEBUG_LEVEL" => {
                let level = number(value, 0, MOST_DEBUG)?;
                own.debug_level = Some(level);
                Ok(format!("level of messages at the beginning: {level}"))
            }
            "BACKUP" => {
                own.needs_backup = choice(value, &[("optional", false), ("required", true)])?;
                let waits = "a master waits until its backup interface is there";
                let goes_on = "a master goes on without its backup interface";
                Ok(if own.needs_backup { waits } else { goes_on }.to_owned())
            }
            _ => Err(format!(
                "expected RINGCAT_SOCKET, _MODE, _GROUP, _STOP_LIMIT, _EOE, _DEBUG_IF, _DEBUG_LEVEL, _BACKUP, _{}, \
                 _MASTERx_SIM or _MASTERx_SAFE_STATE",
                BusSettings::variables().collect::<Vec<_>>().join(", _")
            )),
        }
    }

    fn of_master(&mut self, line: usize, rest: &str, value: &str) -> Result<String, String> {
        let expected = || {
            let last = MOST_MASTERS - 1;
            format!("expected RINGCAT_MASTERx_SIM or RINGCAT_MASTERx_SAFE_STATE with x from 0 to {last}")
        };
        match master(rest).ok_or_else(expected)? {
            (_, "SIM" | "SAFE_STATE") if value.is_empty() => Ok("empty: the default".to_owned()),
            (number, "SIM") if value.starts_with('/') => {
                self.links.entry(number).or_default().simulated = Some((line, value.to_owned()));
                Ok(format!("master {number} on a simulated segment: {value}"))
            }
            (_, "SIM") => Err(format!("expected a path from /, got {value:?}")),
            (number, "SAFE_STATE") => {
                let safe: SafeState = format!("{number}={value}")
                    .parse()
                    .map_err(|_| format!("expected INIT, PREOP or SAFEOP, got {value:?}"))?;
                self.conf.own.safe_states.push(safe);
                self.named.push((number, line));
                Ok(format!("SubDevices of master {number} are in {} after the end of an application", safe.state))
            }
            _ => Err(expected()),
        }
    }
}

fn number<T: FromStr + PartialOrd + Display>(text: &str, least: T, most: T) -> Result<T, String> {
    let is_plain = text.bytes().all(|it| it.is_ascii_digit());
    let number = text.parse().ok().filter(|it| is_plain && *it >= least && *it <= most);
    number.ok_or_else(|| format!("expected a number from {least} to {most}, got {text:?}"))
}

fn choice<T: Copy>(text: &str, choices: &[(&str, T)]) -> Result<T, String> {
    let found = choices.iter().find(|(name, _)| *name == text).map(|(_, value)| *value);
    found.ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        format!("expected {}, got {text:?}", names.join(" or "))
    })
}
