//! Options and words of the command line.
//!
//! Options may stand before and after the command, short ones may be joined (`-vp1`), long ones may be abbreviated and
//! have their value behind `=`. What begins with a minus and a digit is a word, so that negative values need nothing
//! special; behind `--` everything is.

use std::ffi::OsString;

/// The parsed command line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Arguments {
    /// The command and its arguments.
    pub words: Vec<String>,
    /// `--master`: which masters.
    pub master: Option<String>,
    /// `--alias`: which aliases.
    pub alias: Option<String>,
    /// `--position`: which positions.
    pub position: Option<String>,
    /// `--domain`: which domain.
    pub domain: Option<String>,
    /// `--type`: a data type.
    pub data_type: Option<String>,
    /// `--skin`: form of the output of `pdos`.
    pub skin: Option<String>,
    /// `--output-file`: a file to write.
    pub output_file: Option<String>,
    /// `--force`.
    pub force: bool,
    /// `--quiet`.
    pub quiet: bool,
    /// `--verbose`.
    pub verbose: bool,
    /// `--emergency`.
    pub emergency: bool,
    /// `--help`.
    pub help: bool,
    /// `--main`: the network interface of a bus without a daemon.
    pub main: Option<String>,
    /// `--redundant`: that at the other end of a ring.
    pub redundant: Option<String>,
    /// `--sim`: a segment file to simulate.
    pub sim: Option<String>,
    /// `--follow`.
    pub follow: bool,
    /// `--once`.
    pub once: bool,
    /// `--json`.
    pub json: bool,
}

/// Options of the original tool: letter, name, and whether a value follows.
pub const OPTIONS: [(char, &str, bool); 12] = [
    ('m', "master", true),
    ('a', "alias", true),
    ('p', "position", true),
    ('d', "domain", true),
    ('t', "type", true),
    ('s', "skin", true),
    ('o', "output-file", true),
    ('f', "force", false),
    ('q', "quiet", false),
    ('v', "verbose", false),
    ('e', "emergency", false),
    ('h', "help", false),
];

/// Options of our own: name, and whether a value follows. An abbreviation means one of them only where it means none of
/// [`OPTIONS`]: scripts for the original tool go on working.
pub const OWN: [(&str, bool); 6] =
    [("main", true), ("redundant", true), ("sim", true), ("follow", false), ("once", false), ("json", false)];

impl Arguments {
    /// Reads the words of a command line, the name of the program left out.
    ///
    /// # Errors
    /// An option is unknown or lacks its value, or a word is no text.
    pub fn parse(words: &[OsString]) -> Result<Arguments, String> {
        let mut arguments = Arguments::default();
        let mut words = words.iter().map(|word| word.to_str().ok_or_else(|| format!("{word:?} is not in UTF-8")));
        while let Some(word) = words.next().transpose()? {
            let mut value = || words.next().transpose();
            match word.strip_prefix('-') {
                Some("-") => {
                    for word in words.by_ref() {
                        arguments.words.push(word?.to_owned());
                    }
                }
                Some(long) if long.starts_with('-') => arguments.take_long(&long[1..], &mut value)?,
                Some(short) if !short.is_empty() && !short.starts_with(|it: char| it.is_ascii_digit()) => {
                    arguments.take_short(short, &mut value)?;
                }
                Some(_) | None => arguments.words.push(word.to_owned()),
            }
        }
        Ok(arguments)
    }

    fn take_long<'a>(&mut self, text: &str, next: &mut Next<'_, 'a>) -> Result<(), String> {
        let (name, given) = text.split_once('=').map_or((text, None), |(name, value)| (name, Some(value)));
        let Some((long, has_value)) = find(name) else {
            return Err(format!("there is no option --{name}, or several begin like this"));
        };
        match (has_value, given) {
            (false, Some(_)) => return Err(format!("option --{long} takes no value")),
            (false, None) => self.set(long, ""),
            (true, Some(value)) => self.set(long, value),
            (true, None) => {
                let value = next()?.ok_or_else(|| format!("option --{long} requires a value"))?;
                self.set(long, value);
            }
        }
        Ok(())
    }

    fn take_short<'a>(&mut self, mut letters: &str, next: &mut Next<'_, 'a>) -> Result<(), String> {
        while let Some(letter) = letters.chars().next() {
            letters = &letters[letter.len_utf8()..];
            let Some((_, long, has_value)) = OPTIONS.iter().find(|(own, ..)| *own == letter) else {
                return Err(format!("there is no option -{letter}"));
            };
            if *has_value {
                let value = match letters {
                    "" => next()?.ok_or_else(|| format!("option -{letter} requires a value"))?,
                    rest => rest,
                };
                self.set(long, value);
                return Ok(());
            }
            self.set(long, "");
        }
        Ok(())
    }

    /// Sets an option by its name.
    fn set(&mut self, name: &str, value: &str) {
        let text = match name {
            "master" => &mut self.master,
            "alias" => &mut self.alias,
            "position" => &mut self.position,
            "domain" => &mut self.domain,
            "type" => &mut self.data_type,
            "skin" => &mut self.skin,
            "output-file" => &mut self.output_file,
            "main" => &mut self.main,
            "redundant" => &mut self.redundant,
            "sim" => &mut self.sim,
            _ => {
                let flag = match name {
                    "force" => &mut self.force,
                    "quiet" => &mut self.quiet,
                    "verbose" => &mut self.verbose,
                    "emergency" => &mut self.emergency,
                    "follow" => &mut self.follow,
                    "once" => &mut self.once,
                    "json" => &mut self.json,
                    _ => &mut self.help,
                };
                *flag = true;
                return;
            }
        };
        *text = Some(value.to_owned());
    }
}

/// The option with this name, or the only one that begins with it; whether a value follows.
fn find(name: &str) -> Option<(&'static str, bool)> {
    let theirs = || OPTIONS.iter().map(|(_, long, has_value)| (*long, *has_value));
    let own = || OWN.iter().copied();
    let exact = theirs().chain(own()).find(|(long, _)| *long == name);
    let begin = |(long, _): &(&str, bool)| !name.is_empty() && long.starts_with(name);
    exact.or_else(|| {
        let fitting: Vec<_> = theirs().filter(begin).collect();
        let fitting = if fitting.is_empty() { own().filter(begin).collect() } else { fitting };
        match fitting[..] {
            [one] => Some(one),
            _ => None,
        }
    })
}

type Next<'f, 'a> = dyn FnMut() -> Result<Option<&'a str>, String> + 'f;

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Arguments {
        let words: Vec<OsString> = text.split_whitespace().map(OsString::from).collect();
        Arguments::parse(&words).expect("it is right")
    }

    // covers: daemon
    #[test]
    fn options_stand_before_and_behind_the_command_joined_and_abbreviated() {
        let wanted = Arguments {
            words: vec!["slaves".to_owned(), "x".to_owned()],
            master: Some("0-1".to_owned()),
            position: Some("-1".to_owned()),
            verbose: true,
            ..Arguments::default()
        };
        for text in [
            "-m 0-1 -p -1 -v slaves x",
            "slaves -vp-1 x -m0-1",
            "--master=0-1 slaves x --pos -1 --verb",
            "--position=-1 -vm 0-1 -- slaves x",
        ] {
            assert_eq!(parse(text), wanted, "{text}");
        }
    }

    // covers: daemon
    #[test]
    fn a_minus_alone_and_negative_numbers_are_words() {
        let arguments = parse("download -t int8 0x2000 0 -5 - -- -v");
        assert_eq!(arguments.words, ["download", "0x2000", "0", "-5", "-", "-v"]);
        assert!(!arguments.verbose);
    }

    // covers: daemon
    #[test]
    fn abbreviations_mean_options_of_our_own_only_where_they_mean_no_other() {
        assert_eq!(parse("slaves --ma 1").master.as_deref(), Some("1"));
        assert_eq!(parse("pdos --s etherlab").skin.as_deref(), Some("etherlab"));
        assert!(parse("alias --fo 1").force && parse("events --fol").follow);
        for text in ["slaves --main eth1", "slaves --mai=eth1"] {
            assert_eq!(parse(text).main.as_deref(), Some("eth1"), "{text}");
        }
        assert_eq!(parse("slaves --si a.toml").sim.as_deref(), Some("a.toml"));
        assert_eq!(parse("slaves --r=eth2").redundant.as_deref(), Some("eth2"));
        assert!(parse("--js slaves").json && parse("slaves --j").json);
    }

    // covers: daemon
    #[test]
    fn no_option_of_our_own_changes_an_abbreviation_of_the_originals() {
        for (_, name, has_value) in OPTIONS {
            for length in 1..=name.len() {
                let begin = &name[..length];
                let is_alone = OPTIONS.iter().filter(|(_, other, _)| other.starts_with(begin)).count() == 1;
                let is_own = OWN.iter().any(|(own, _)| *own == begin);
                let wanted = (is_alone && !is_own).then_some((name, has_value));
                assert!(is_own || find(begin) == wanted, "--{begin} is {:?}", find(begin));
            }
        }
    }

    // covers: daemon
    #[test]
    fn wrong_options_are_named() {
        for (text, part) in [
            ("-x slaves", "no option -x"),
            ("slaves --nothing", "--nothing"),
            ("slaves -p", "-p requires a value"),
            ("slaves --type", "--type requires a value"),
            ("slaves --force=1", "--force takes no value"),
            ("slaves --=1", "--"),
        ] {
            let words: Vec<OsString> = text.split_whitespace().map(OsString::from).collect();
            let failure = Arguments::parse(&words).expect_err("it is wrong");
            assert!(failure.contains(part), "{text}: {failure}");
        }
    }
}
