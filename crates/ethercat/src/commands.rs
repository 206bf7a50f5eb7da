//! All commands, and how an abbreviation finds one.

use crate::command;
use crate::shape::Command;

/// All commands by name.
pub const ALL: [&Command; 33] = [
    &command::alias::COMMAND,
    &command::clocks::COMMAND,
    &command::config::COMMAND,
    &command::crc::COMMAND,
    &command::cstruct::COMMAND,
    &command::data::COMMAND,
    &command::debug::COMMAND,
    &command::domains::COMMAND,
    &command::download::COMMAND,
    &command::eoe::COMMAND,
    &command::events::COMMAND,
    &command::foe_read::COMMAND,
    &command::foe_write::COMMAND,
    &command::graph::COMMAND,
    &command::ip::COMMAND,
    &command::master::COMMAND,
    &command::pdos::COMMAND,
    &command::record::COMMAND,
    &command::reg_read::COMMAND,
    &command::reg_write::COMMAND,
    &command::rescan::COMMAND,
    &command::ring::COMMAND,
    &command::sdos::COMMAND,
    &command::sii_read::COMMAND,
    &command::sii_write::COMMAND,
    &command::slaves::COMMAND,
    &command::soe_read::COMMAND,
    &command::soe_write::COMMAND,
    &command::states::COMMAND,
    &command::upload::COMMAND,
    &command::version::COMMAND,
    &command::watch::COMMAND,
    &command::xml::COMMAND,
];

/// Commands that the original tool does not have. An abbreviation means one of them only where it means none of the
/// others: scripts go on working.
pub const OWN: [&str; 5] = ["clocks", "events", "record", "ring", "watch"];

/// What an abbreviation stands for.
#[derive(Debug)]
#[non_exhaustive]
pub enum Found {
    /// A command.
    One(&'static Command),
    /// Any of these.
    Several(Vec<&'static Command>),
    /// No command.
    None,
}

/// The commands that begin with a text; if there are none, those that have its letters in this order.
pub fn find(text: &str) -> Found {
    if let Some(exact) = ALL.into_iter().find(|command| command.name == text) {
        return Found::One(exact);
    }
    let begins = |name: &str, text: &str| name.starts_with(text);
    let fitting = |own: bool, fits: fn(&str, &str) -> bool| {
        let fits = |it: &&Command| OWN.contains(&it.name) == own && fits(it.name, text);
        ALL.into_iter().filter(fits).collect::<Vec<_>>()
    };
    let ways = [(false, begins as fn(&str, &str) -> bool), (false, has_letters), (true, begins)];
    let found = ways.into_iter().map(|(own, fits)| fitting(own, fits)).find(|found| !found.is_empty());
    let found = found.unwrap_or_default();
    match found[..] {
        [] => Found::None,
        [one] => Found::One(one),
        _ => Found::Several(found),
    }
}

/// Whether a name has these letters in this order; a letter may stand for the same place as the one before.
fn has_letters(name: &str, letters: &str) -> bool {
    let mut rest = name;
    for letter in letters.chars() {
        match rest.find(letter) {
            Some(place) => rest = &rest[place..],
            None => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<&'static str> {
        match find(text) {
            Found::One(command) => vec![command.name],
            Found::Several(commands) => commands.into_iter().map(|it| it.name).collect(),
            Found::None => Vec::new(),
        }
    }

    // covers: daemon
    #[test]
    fn a_beginning_or_letters_in_order_find_commands() {
        assert_eq!(names("sl"), ["slaves"]);
        assert_eq!(names("e"), ["eoe"]);
        assert_eq!(names("s").len(), 7);
        assert_eq!(names("foo"), ["foe_read", "foe_write"]);
        assert_eq!(names("regw"), ["reg_write"]);
        assert_eq!(names("siir"), ["sii_read", "sii_write"]);
        assert_eq!(names("dw"), ["download"]);
        assert!(names("xyz").is_empty());
        assert_eq!(
            [names("ev"), names("cl"), names("ring"), names("wat")].concat(),
            ["events", "clocks", "ring", "watch"]
        );
        assert_eq!(names("r"), ["reg_read", "reg_write", "rescan"]);
        assert_eq!(names("re"), ["reg_read", "reg_write", "rescan"]);
        assert_eq!([names("rec"), names("reco")].concat(), ["rescan", "record"]);
        assert_eq!(names("c"), ["config", "crc", "cstruct"]);
        assert!(OWN.iter().all(|own| ALL.iter().any(|command| command.name == *own)));
    }
}
