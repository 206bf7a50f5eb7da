//! SubDevices and declared SubDevices by alias and position.

use ringcat_control::tool::{DeclaredLine, SubDeviceLine};

use crate::numbers::List;
use crate::order;

/// A SubDevice, and the alias from which it is counted.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Slave {
    /// What is known of it.
    pub line: SubDeviceLine,
    /// The last alias at or before it; 0 before the first.
    pub alias: u16,
    /// Its place behind the SubDevice with this alias, or in the ring.
    pub relative: u16,
}

impl Slave {
    /// Its name, or vendor and product where its SII has none.
    pub fn name(&self) -> String {
        let [vendor, product, ..] = self.line.identity;
        if self.line.name.is_empty() { format!("0x{vendor:08x}:0x{product:08x}") } else { self.line.name.clone() }
    }

    /// Its AL state; `???` where it does not answer.
    pub fn state(&self) -> String {
        state(self.line.status.unwrap_or(0))
    }

    /// Whether it reports an error or does not answer.
    pub fn has_error(&self) -> bool {
        self.line.status.is_none_or(|status| status & ERROR != 0)
    }

    /// `E` where it reports an error or does not answer.
    pub fn flag(&self) -> char {
        if self.has_error() { 'E' } else { '+' }
    }
}

const ERROR: u16 = 0x10;

/// The name of the state in an AL status; `None` for a number that is no state.
pub fn state_name(status: u16) -> Option<&'static str> {
    match status & 0x0F {
        1 => Some("INIT"),
        2 => Some("PREOP"),
        3 => Some("BOOT"),
        4 => Some("SAFEOP"),
        8 => Some("OP"),
        _ => None,
    }
}

/// The text of an AL status.
pub fn state(status: u16) -> String {
    let name = state_name(status).unwrap_or("???");
    let error = if status & ERROR == 0 { "" } else { "+ERROR" };
    format!("{name}{error}")
}

/// SubDevices with the aliases from which they are counted.
pub fn counted(lines: Vec<SubDeviceLine>) -> Vec<Slave> {
    let (mut alias, mut relative) = (0, 0);
    let count = |line: SubDeviceLine| {
        if line.alias != 0 {
            (alias, relative) = (line.alias, 0);
        }
        let slave = Slave { line, alias, relative };
        relative = relative.saturating_add(1);
        slave
    };
    lines.into_iter().map(count).collect()
}

/// The selected SubDevices: all, those at positions, those behind aliases, or those at places behind aliases.
pub fn slaves(all: Vec<Slave>, aliases: Option<&List>, positions: Option<&List>) -> Vec<Slave> {
    let is_selected = |slave: &Slave| match (aliases, positions) {
        (None, None) => true,
        (None, Some(positions)) => positions.has(slave.line.position.into()),
        (Some(aliases), None) => slave.alias != 0 && aliases.has(slave.alias.into()),
        (Some(aliases), Some(positions)) => {
            // Alias 0 counts from the beginning of the ring.
            (aliases.has(slave.alias.into()) && positions.has(slave.relative.into()))
                || (aliases.single() == Some(0) && positions.has(slave.line.position.into()))
        }
    };
    all.into_iter().filter(is_selected).collect()
}

/// The selected declared SubDevices, sorted: with positions alone those without an alias.
pub fn declared(all: Vec<DeclaredLine>, aliases: Option<&List>, positions: Option<&List>) -> Vec<DeclaredLine> {
    let is_selected = |line: &DeclaredLine| match (aliases, positions) {
        (None, None) => true,
        (None, Some(positions)) => line.alias == 0 && positions.has(line.position.into()),
        (Some(aliases), None) => aliases.has(line.alias.into()),
        (Some(aliases), Some(positions)) => aliases.has(line.alias.into()) && positions.has(line.position.into()),
    };
    let selected = all.into_iter().filter(is_selected).collect();
    order::by_key(selected, |line| u32::from(line.alias) << 16 | u32::from(line.position))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment() -> Vec<Slave> {
        let aliases = [0, 1000, 0, 0, 2000, 0];
        counted((0..).zip(aliases).map(|(position, alias)| line(position, alias)).collect())
    }

    fn line(position: u16, alias: u16) -> SubDeviceLine {
        SubDeviceLine { position, alias, ..SubDeviceLine::default() }
    }

    fn selected(aliases: Option<&str>, positions: Option<&str>) -> Vec<u16> {
        let list = |text: Option<&str>| text.map(|text| List::parse(text).expect("it is a list"));
        let found = slaves(segment(), list(aliases).as_ref(), list(positions).as_ref());
        found.into_iter().map(|slave| slave.line.position).collect()
    }

    // covers: daemon
    #[test]
    fn subdevices_are_selected_by_position_by_alias_and_behind_an_alias() {
        assert_eq!(selected(None, None), [0, 1, 2, 3, 4, 5]);
        assert_eq!(selected(None, Some("-1,4")), [0, 1, 4]);
        assert_eq!(selected(Some("1000"), None), [1, 2, 3]);
        assert_eq!(selected(Some("1000,2000"), Some("1")), [2, 5]);
        assert_eq!(selected(Some("0"), Some("4")), [4]);
        assert_eq!(selected(Some("3"), None), [0; 0]);
        assert_eq!(selected(None, Some("6-")), [0; 0]);
    }

    // covers: daemon
    #[test]
    fn declared_subdevices_are_sorted_and_positions_alone_mean_no_alias() {
        let line = |(alias, position)| DeclaredLine { alias, position, ..DeclaredLine::default() };
        let all: Vec<DeclaredLine> = [(1000, 1), (0, 7), (1000, 0), (0, 2)].into_iter().map(line).collect();
        let chosen = |aliases: Option<&str>, positions: Option<&str>| {
            let list = |text: Option<&str>| text.map(|text| List::parse(text).expect("it is a list"));
            let found = declared(all.clone(), list(aliases).as_ref(), list(positions).as_ref());
            found.into_iter().map(|line| (line.alias, line.position)).collect::<Vec<_>>()
        };
        assert_eq!(chosen(None, None), [(0, 2), (0, 7), (1000, 0), (1000, 1)]);
        assert_eq!(chosen(None, Some("0-2")), [(0, 2)]);
        assert_eq!(chosen(Some("1000"), None), [(1000, 0), (1000, 1)]);
        assert_eq!(chosen(Some("1000"), Some("1")), [(1000, 1)]);
    }

    // covers: daemon
    #[test]
    fn states_have_names_and_errors_are_marked() {
        let texts = [1, 2, 3, 4, 8, 0x11, 0x14, 0, 7].map(state);
        assert_eq!(texts, ["INIT", "PREOP", "BOOT", "SAFEOP", "OP", "INIT+ERROR", "SAFEOP+ERROR", "???", "???"]);
    }
}
