//! Options as the help describes them, for completion and manual pages.

use crate::help::{COMMON, STANDALONE, json_of};
use crate::shape::Command;

/// An option in the help.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct OptionHelp {
    /// Its name, without minus signs.
    pub name: &'static str,
    /// Its letter; empty if it has none.
    pub letter: &'static str,
    /// The name of its value; empty if it takes none.
    pub value: &'static str,
    /// What it is for: one paragraph.
    pub text: String,
}

/// The options that all commands have.
pub fn common() -> Vec<OptionHelp> {
    let mut all = options(COMMON);
    all.extend(options(STANDALONE));
    all
}

/// A command's own options.
pub fn of(command: &Command) -> Vec<OptionHelp> {
    let mut all = options(command.options);
    all.extend(options(json_of(command)));
    all
}

/// A line with an option begins with two blanks and two minus signs; the lines behind it go on with its text.
fn options(text: &'static str) -> Vec<OptionHelp> {
    let mut all: Vec<OptionHelp> = Vec::new();
    for line in text.lines() {
        let line = line.trim();
        let Some(option) = line.strip_prefix("--") else {
            if let Some(last) = all.last_mut() {
                last.text += " ";
                last.text += line;
            }
            continue;
        };
        let (name, rest) = word(option);
        let (letter, rest) = if rest.starts_with('-') { word(rest) } else { ("", rest) };
        let (value, rest) = match rest.strip_prefix('<') {
            Some(value) => value.split_once('>').unwrap_or((value, "")),
            None => ("", rest),
        };
        all.push(OptionHelp { name, letter: letter.trim_start_matches('-'), value, text: rest.trim().to_owned() });
    }
    all
}

fn word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(' ').unwrap_or((text, ""));
    (word, rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::{OPTIONS, OWN};
    use crate::commands::ALL;

    // covers: daemon
    #[test]
    fn options_in_the_help_are_those_of_the_parser() {
        let all = || ALL.into_iter().flat_map(of).chain(common());
        for option in all() {
            let wanted = (option.name, option.letter, !option.value.is_empty());
            let is_known = |(letter, name, has_value): &(char, &str, bool)| {
                wanted == (*name, letter.to_string().as_str(), *has_value) && option.text.len() > 5
            };
            let is_own = option.letter.is_empty() && OWN.contains(&(option.name, !option.value.is_empty()));
            assert!(OPTIONS.iter().any(is_known) || is_own, "{option:?}");
        }
        for name in OPTIONS.map(|(_, name, _)| name).into_iter().chain(OWN.map(|(name, _)| name)) {
            assert!(all().any(|option| option.name == name), "--{name} is not in the help");
        }
    }

    // covers: daemon
    #[test]
    fn the_text_of_an_option_is_one_paragraph() {
        let master = &common()[0];
        assert_eq!((master.name, master.letter, master.value), ("master", "m", "master"));
        assert!(master.text.starts_with("Masters: comma-separated numbers and ranges, such as '1,3',"), "{master:?}");
    }
}
