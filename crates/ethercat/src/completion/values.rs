//! Values of options and arguments, by the place-holders that the help has for them.

use crate::command::{graph, pdos, states};
use crate::data_types;
use crate::options_help::OptionHelp;
use crate::shape::Command;

/// What a value may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Values {
    /// One of these words.
    Words(Vec<&'static str>),
    /// A network interface of the host.
    Interfaces,
    /// A file of the host.
    Files,
    /// Anything else: nothing is offered.
    Unknown,
}

/// The values of an option.
pub fn of_option(option: &OptionHelp) -> Values {
    of_place(option.value, "")
}

/// The values of the argument with this number, from 0, in all forms of a command.
pub fn argument(command: &Command, at: usize) -> Values {
    let mut all = Vec::new();
    for form in command.forms {
        let words: Vec<&'static str> = form.split_whitespace().filter(|word| *word != REPEATED).collect();
        if words.is_empty() || (at >= words.len() && !form.ends_with(REPEATED)) {
            continue;
        }
        let word = words[at % words.len()];
        match word.strip_prefix('<').and_then(|word| word.strip_suffix('>')) {
            Some(place) => match of_place(place, command.help) {
                Values::Words(words) => all.extend(words),
                values => return values,
            },
            None if word.starts_with('[') => {}
            None => all.push(word),
        }
    }
    if all.is_empty() { Values::Unknown } else { Values::Words(all) }
}

/// The largest number of arguments that make sense: repeated ones once for each word that the help lists.
pub fn most_arguments(command: &Command) -> usize {
    let count = |form: &&str| {
        let words = form.split_whitespace().filter(|word| *word != REPEATED).count();
        if form.ends_with(REPEATED) { words * listed(command.help).len() } else { words }
    };
    command.forms.iter().map(count).max().unwrap_or(0)
}

/// What a form has behind arguments that may be repeated.
const REPEATED: &str = "...";

fn of_place(place: &str, help: &'static str) -> Values {
    match place {
        "type" => Values::Words(data_types::ALL.iter().map(|it| it.name).collect()),
        "skin" => Values::Words(pdos::SKINS.to_vec()),
        "STATE" => Values::Words(states::STATES.iter().map(|(name, _)| *name).collect()),
        "INFO" => Values::Words(graph::INFO.to_vec()),
        "KEY" => Values::Words(listed(help)),
        "interface" => Values::Interfaces,
        "file" | "FILENAME" | "DATA" => Values::Files,
        _ => Values::Unknown,
    }
}

/// The words with which the indented lines of a help begin.
fn listed(help: &'static str) -> Vec<&'static str> {
    help.lines().filter(|line| line.starts_with("  ")).filter_map(|line| line.split_whitespace().next()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{ALL, Found, find};
    use crate::help;

    fn of(name: &str, at: usize) -> Values {
        let Found::One(command) = find(name) else { panic!("{name}") };
        argument(command, at)
    }

    // covers: daemon
    #[test]
    fn arguments_have_the_words_that_the_help_names() {
        let keys = ["ip_address", "mac_address", "default_gateway", "dns_address", "hostname"];
        assert_eq!([of("ip", 0), of("ip", 4)], [Values::Words(keys.to_vec()), Values::Words(keys.to_vec())]);
        assert_eq!([of("ip", 1), of("slaves", 0), of("upload", 0)], [const { Values::Unknown }; 3]);
        assert_eq!(of("crc", 0), Values::Words(vec!["reset"]));
        assert_eq!([of("sii_write", 0), of("reg_write", 1)], [const { Values::Files }; 2]);
        for command in ALL {
            let all = (0..most_arguments(command)).map(|at| argument(command, at));
            for words in all.filter_map(|it| if let Values::Words(words) = it { Some(words) } else { None }) {
                let text = help::of(command);
                assert!(words.iter().all(|word| text.contains(word)), "{words:?}: {text}");
            }
        }
    }
}
