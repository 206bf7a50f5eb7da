//! What a file declares, in words: start-up commands, sides of the image, ranges of numbers, names, times.

use std::time::Duration;

use ringcat::{Direction, RegisterAccess, StartupAction, SyncManagerRole};

/// What a start-up command does.
pub(super) fn action(action: &StartupAction) -> String {
    let all = |complete: bool| if complete { ", complete access" } else { "" };
    match action {
        StartupAction::Sdo(sdo) => {
            let object = format!("{:#06x}:{:02x}{}", sdo.index, sdo.sub_index, all(sdo.complete_access));
            format!("SDO {object} = {}", hex(&sdo.data))
        }
        StartupAction::Upload(sdo) => {
            let object = format!("{:#06x}:{:02x}{}", sdo.index, sdo.sub_index, all(sdo.complete_access));
            match &sdo.expected {
                Some(expected) => format!("SDO {object} must be {}", hex(expected)),
                None => format!("SDO {object} is read"),
            }
        }
        StartupAction::Idn(idn) => format!("drive {} {} = {}", idn.drive, idn.idn, hex(&idn.data)),
        StartupAction::Ip(settings) => match settings.address {
            Some(address) => format!("IP address {address}"),
            None => "addresses for EoE".to_owned(),
        },
        StartupAction::Register(register) => match &register.access {
            RegisterAccess::Write(data) => format!("register {} = {}", register.address, hex(data)),
            RegisterAccess::Check { data, mask: None, .. } => {
                format!("register {} must be {}", register.address, hex(data))
            }
            RegisterAccess::Check { data, mask: Some(mask), .. } => {
                format!("register {} & {} must be {}", register.address, hex(mask), hex(data))
            }
        },
        _ => "a command".to_owned(),
    }
}

/// Bytes that are shown of longer data.
const SHOWN_BYTES: usize = 16;

fn hex(bytes: &[u8]) -> String {
    let shown: Vec<String> = bytes.iter().take(SHOWN_BYTES).map(|byte| format!("{byte:02x}")).collect();
    let more = if bytes.len() > SHOWN_BYTES { format!(" ... ({} bytes)", bytes.len()) } else { String::new() };
    format!("{}{more}", shown.join(" "))
}

pub(super) const fn side(direction: Direction) -> &'static str {
    match direction {
        Direction::Outputs => "outputs",
        Direction::Inputs => "inputs",
    }
}

pub(super) const fn role(role: SyncManagerRole) -> &'static str {
    match role {
        SyncManagerRole::MailboxOut => "mail out",
        SyncManagerRole::MailboxIn => "mail in",
        SyncManagerRole::Outputs => "outputs",
        SyncManagerRole::Inputs => "inputs",
    }
}

/// Ascending numbers, with rows of them as ranges: `0-3, 5`.
pub(super) fn ranges(numbers: &[usize]) -> String {
    let mut texts: Vec<String> = Vec::new();
    for row in numbers.chunk_by(|a, b| a + 1 == *b) {
        texts.push(match row {
            [first, .., last] => format!("{first}-{last}"),
            [first] => first.to_string(),
            [] => continue,
        });
    }
    texts.join(", ")
}

/// A name from a file, without control characters.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// `1 ms`, `250 us`.
pub(super) fn time(duration: Duration) -> String {
    format!("{duration:?}").replace('\u{b5}', "u")
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: eni-run
    #[test]
    fn rows_of_numbers_are_shown_as_ranges_and_names_cannot_disturb_a_terminal() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2, 5, 7-8");
        assert_eq!(one_line("a\u{1b}[31m\nb"), "a [31m b");
    }
}
