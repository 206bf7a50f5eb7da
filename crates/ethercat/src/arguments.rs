//! Options and words of the command line.
//!
//! Options may stand before and after the command, short ones may be joined (`-vp1`), long ones may be abbreviated and
//! have their value behind `=`. What begins with a minus and a digit is a word, so that negative values need nothing
//! special; behind `--` everything is.

use std::ffi::OsString;

/// What the command line says.
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
}

/// All options: letter, name, and whether a value follows.
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
        let mut fitting = OPTIONS.iter().filter(|(_, long, _)| long.starts_with(name));
        let exact = OPTIONS.iter().find(|(_, long, _)| *long == name);
        let only = fitting.next().filter(|_| fitting.next().is_none());
        let Some((letter, long, has_value)) = exact.or(only).filter(|_| !name.is_empty()) else {
            return Err(format!("there is no option --{name}, or several begin like this"));
        };
        match (has_value, given) {
            (false, Some(_)) => Err(format!("option --{long} takes no value")),
            (false, None) => self.set(*letter, ""),
            (true, Some(value)) => self.set(*letter, value),
            (true, None) => {
                let value = next()?.ok_or_else(|| format!("option --{long} requires a value"))?;
                self.set(*letter, value)
            }
        }
    }

    fn take_short<'a>(&mut self, mut letters: &str, next: &mut Next<'_, 'a>) -> Result<(), String> {
        while let Some(letter) = letters.chars().next() {
            letters = &letters[letter.len_utf8()..];
            let Some((_, _, has_value)) = OPTIONS.iter().find(|(own, ..)| *own == letter) else {
                return Err(format!("there is no option -{letter}"));
            };
            if *has_value {
                let value = match letters {
                    "" => next()?.ok_or_else(|| format!("option -{letter} requires a value"))?,
                    rest => rest,
                };
                return self.set(letter, value);
            }
            self.set(letter, "")?;
        }
        Ok(())
    }

    fn set(&mut self, letter: char, value: &str) -> Result<(), String> {
        let text = match letter {
            'm' => &mut self.master,
            'a' => &mut self.alias,
            'p' => &mut self.position,
            'd' => &mut self.domain,
            't' => &mut self.data_type,
            's' => &mut self.skin,
            'o' => &mut self.output_file,
            _ => {
                let flag = match letter {
                    'f' => &mut self.force,
                    'q' => &mut self.quiet,
                    'v' => &mut self.verbose,
                    'e' => &mut self.emergency,
                    _ => &mut self.help,
                };
                *flag = true;
                return Ok(());
            }
        };
        *text = Some(value.to_owned());
        Ok(())
    }
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
