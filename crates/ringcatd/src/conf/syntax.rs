//! The syntax of a configuration file: assignments as `sh` reads them, and nothing else of `sh`.
//!
//! In: the bytes of a file. Out: its assignments with their lines, and its mistakes. `NAME=value`, both kinds of
//! quotes, `\` and comments mean what they mean in `sh`, so a script can read the same file. Nothing is expanded: what
//! `sh` would expand, or run, is a mistake with its name. Each byte is read a few times at most.

use super::model::Mistake;

/// Longest name of a variable.
const LONGEST_NAME: usize = 64;
/// Longest value.
const LONGEST_VALUE: usize = 4096;
/// Mistakes that are listed.
const MOST_MISTAKES: usize = 50;

/// A variable gets a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The line of its name, from 1.
    pub line: usize,
    /// The variable.
    pub name: String,
    /// Its value, without quotes.
    pub value: String,
}

/// All assignments in their order, and all mistakes.
pub fn assignments(bytes: &[u8]) -> (Vec<Assignment>, Vec<Mistake>) {
    let (mut found, mut mistakes) = (Vec::new(), Vec::new());
    let mut reader = Reader { rest: bytes, line: 1 };
    while !reader.rest.is_empty() {
        let (line, begin) = (reader.line, reader.rest);
        match reader.assignment() {
            Ok(None) => {}
            Ok(Some((name, value))) => found.push(Assignment { line, name, value }),
            Err(text) => {
                mistakes.push(Mistake { line: Some(line), text });
                // The rest of the line belongs to the mistake; what follows is read.
                reader = Reader { rest: begin, line };
                reader.skip_line();
                if mistakes.len() == MOST_MISTAKES {
                    let text = "there are more mistakes, which are not listed".to_owned();
                    mistakes.push(Mistake { line: Some(reader.line), text });
                    break;
                }
            }
        }
    }
    (found, mistakes)
}

struct Reader<'a> {
    rest: &'a [u8],
    line: usize,
}

impl Reader<'_> {
    fn peek(&self) -> Option<u8> {
        self.rest.first().copied()
    }

    fn next(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.line += usize::from(*first == b'\n');
        self.rest = rest;
        Some(*first)
    }

    fn skip_line(&mut self) {
        while self.next().is_some_and(|byte| byte != b'\n') {}
    }

    fn skip_blanks(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t')) {
            self.next();
        }
    }

    /// One line, or several where quotes or `\` go on; `None` if it is empty or a comment.
    fn assignment(&mut self) -> Result<Option<(String, String)>, String> {
        self.skip_blanks();
        match self.peek() {
            None => return Ok(None),
            Some(b'\n' | b'#') => {
                self.skip_line();
                return Ok(None);
            }
            Some(_) => {}
        }
        let name = self.name()?;
        let value = self.value(&name)?;
        self.skip_blanks();
        match self.peek() {
            None => {}
            Some(b'\n' | b'#') => self.skip_line(),
            Some(b'\r') => return Err(carriage_return()),
            Some(_) => {
                return Err(format!("{name}: expected the end of the line; a value with blanks needs quotes"));
            }
        }
        let value = String::from_utf8(value).map_err(|_| format!("{name}: expected text in UTF-8"))?;
        if value.chars().any(|it| it.is_control() && !matches!(it, '\n' | '\t')) {
            return Err(format!("{name}: the value has a control character"));
        }
        Ok(Some((name, value)))
    }

    /// A name with its `=`.
    fn name(&mut self) -> Result<String, String> {
        let length = self.rest.iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_').count();
        let (name, rest) = self.rest.split_at(length);
        let is_name = !name.is_empty() && !name[0].is_ascii_digit() && length <= LONGEST_NAME;
        let name = String::from_utf8_lossy(&name[..length.min(LONGEST_NAME)]).into_owned();
        match rest.first() {
            Some(b'=') if is_name => {
                self.rest = &rest[1..];
                Ok(name)
            }
            Some(b' ' | b'\t') if is_name && followed_by_equals(rest) => {
                Err(format!("{name}: expected no blank before \"=\""))
            }
            _ if is_name && matches!(name.as_str(), "export" | "readonly" | "local") => {
                Err(format!("expected NAME=VALUE alone, without {name:?}"))
            }
            Some(b'\r') => Err(carriage_return()),
            _ => Err("expected NAME=VALUE or a comment; commands of a shell are not run".to_owned()),
        }
    }

    /// A word of `sh`: parts with and without quotes.
    fn value(&mut self, name: &str) -> Result<Vec<u8>, String> {
        if matches!(self.peek(), Some(b' ' | b'\t')) && followed_by_word(self.rest) {
            return Err(format!("{name}: expected no blank behind \"=\""));
        }
        let mut value = Vec::new();
        let is_home = self.peek() == Some(b'~');
        while let Some(byte) = self.peek() {
            if value.len() > LONGEST_VALUE {
                return Err(format!("{name}: expected a value of at most {LONGEST_VALUE} bytes"));
            }
            match byte {
                b' ' | b'\t' | b'\n' => break,
                b'\r' => return Err(carriage_return()),
                b'\'' => self.single(name, &mut value)?,
                b'"' => self.double(name, &mut value)?,
                b'\\' => self.escaped(name, None, &mut value)?,
                b'$' | b'`' => return Err(expansion(name, byte)),
                b';' | b'&' | b'|' | b'<' | b'>' | b'(' | b')' => {
                    let shown = char::from(byte);
                    return Err(format!("{name}: {shown:?} needs quotes; commands of a shell are not run"));
                }
                _ => {
                    self.next();
                    value.push(byte);
                }
            }
        }
        if is_home {
            return Err(format!("{name}: \"~\" is not expanded here; write the value itself, in quotes"));
        }
        Ok(value)
    }

    fn single(&mut self, name: &str, value: &mut Vec<u8>) -> Result<(), String> {
        self.next();
        loop {
            match self.next() {
                None => return Err(format!("{name}: the quote ' does not end")),
                Some(b'\'') => return Ok(()),
                Some(byte) => value.push(byte),
            }
        }
    }

    fn double(&mut self, name: &str, value: &mut Vec<u8>) -> Result<(), String> {
        self.next();
        loop {
            match self.peek() {
                None => return Err(format!("{name}: the quote \" does not end")),
                Some(b'"') => {
                    self.next();
                    return Ok(());
                }
                Some(b'\\') => self.escaped(name, Some(b"\"\\$`"), value)?,
                Some(byte @ (b'$' | b'`')) => return Err(expansion(name, byte)),
                Some(byte) => {
                    self.next();
                    value.push(byte);
                }
            }
        }
    }

    /// `\` and what follows; inside of quotes it is kept unless one of these follows.
    fn escaped(&mut self, name: &str, special: Option<&[u8]>, value: &mut Vec<u8>) -> Result<(), String> {
        self.next();
        match self.next() {
            None => Err(format!("{name}: expected a character behind \"\\\"")),
            Some(b'\n') => Ok(()),
            Some(byte) => {
                if special.is_some_and(|special| !special.contains(&byte)) {
                    value.push(b'\\');
                }
                value.push(byte);
                Ok(())
            }
        }
    }
}

/// Blanks and then `=`.
fn followed_by_equals(rest: &[u8]) -> bool {
    rest.iter().find(|byte| !matches!(byte, b' ' | b'\t')) == Some(&b'=')
}

/// Blanks and then a word on the same line.
fn followed_by_word(rest: &[u8]) -> bool {
    rest.iter().find(|byte| !matches!(byte, b' ' | b'\t')).is_some_and(|byte| !matches!(byte, b'\n' | b'\r' | b'#'))
}

fn expansion(name: &str, byte: u8) -> String {
    let shown = char::from(byte);
    format!("{name}: {shown:?} is not expanded here; write the value itself (a literal {shown:?}: in single quotes)")
}

fn carriage_return() -> String {
    "the line ends with CR LF; expected the ends of lines of Unix (dos2unix)".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<(usize, String, String)> {
        let (found, mistakes) = assignments(text.as_bytes());
        assert_eq!(mistakes, [], "{text:?}");
        found.into_iter().map(|it| (it.line, it.name, it.value)).collect()
    }

    fn mistakes(text: &[u8]) -> Vec<(usize, String)> {
        assignments(text).1.into_iter().map(|it| (it.line.expect("it has a line"), it.text)).collect()
    }

    // covers: daemon
    #[test]
    fn assignments_have_the_values_that_sh_gives_them() {
        let text = "# a comment\n\nA=\"00:11\"\n  B='x y'  # behind\nC=\nD=a\"b c\"'d'e\n\tE=\"two\nlines\"\nF=a\\ b\n\
                    G=\"a\\\"b\\\\c\\d\\$\"\nH=x\\\ny\nI=a#b\nJ= # empty\nK=\"\"'$5'\nL=last";
        let expected = [
            (3, "A", "00:11"),
            (4, "B", "x y"),
            (5, "C", ""),
            (6, "D", "ab cde"),
            (7, "E", "two\nlines"),
            (9, "F", "a b"),
            (10, "G", "a\"b\\c\\d$"),
            (11, "H", "xy"),
            (13, "I", "a#b"),
            (14, "J", ""),
            (15, "K", "$5"),
            (16, "L", "last"),
        ];
        let expected = expected.map(|(line, name, value)| (line, name.to_owned(), value.to_owned()));
        assert_eq!(values(text), expected);
        // The same by the shell itself.
        let print = |script: String, name: &String| format!("{script}\nprintf '%s\\0' \"${name}\"");
        let script = expected.iter().map(|(_, name, _)| name).fold(text.to_owned(), print);
        let output = std::process::Command::new("sh").args(["-c", &script]).output().expect("sh is there");
        let of_sh: Vec<String> =
            String::from_utf8(output.stdout).expect("text").split_terminator('\0').map(str::to_owned).collect();
        assert_eq!(of_sh, expected.map(|(_, _, value)| value));
    }

    // covers: daemon
    #[test]
    fn what_sh_would_expand_or_run_is_a_mistake_with_its_line() {
        let cases = [
            ("A=$B", "'$' is not expanded here"),
            ("A=\"${B}\"", "'$' is not expanded here"),
            ("A=`id`", "'`' is not expanded here"),
            ("A=~/x", "\"~\" is not expanded here"),
            ("A=1; reboot", "';' needs quotes"),
            ("A=1 reboot", "expected the end of the line"),
            ("A = 1", "expected no blank before"),
            ("A= 1", "expected no blank behind"),
            ("export A=1", "without \"export\""),
            ("if true; then", "commands of a shell are not run"),
            ("1A=2", "expected NAME=VALUE"),
            ("A=\"1", "the quote \" does not end"),
            ("A='1", "the quote ' does not end"),
            ("A=1\\", "expected a character behind"),
            ("A=1\r", "CR LF"),
            ("\r", "CR LF"),
            ("A='\u{7}'", "control character"),
        ];
        for (text, expected) in cases {
            let found = mistakes(format!("\nX=1\n{text}\n").trim_end_matches('\n').as_bytes());
            let [(3, found)] = &found[..] else { panic!("{text}: {found:?}") };
            assert!(found.contains(expected), "{text}: {found}");
        }
        assert!(mistakes(b"A=\xff")[0].1.contains("UTF-8"));
        let long = format!("A={}\n{}=1\n", "x".repeat(5000), "N".repeat(65));
        let found = mistakes(long.as_bytes());
        assert!(found[0].1.contains("at most 4096 bytes") && found[1].1.contains("NAME=VALUE"), "{found:?}");
    }

    // covers: daemon
    #[test]
    fn all_mistakes_are_found_and_what_is_right_between_them_is_read() {
        let text = b"A=$1\nB=2\nC='open\nD=\"4\"\nE = 5\n";
        let (found, wrong) = assignments(text);
        let found: Vec<_> = found.iter().map(|it| (it.line, it.name.as_str())).collect();
        assert_eq!(found, [(2, "B"), (4, "D")]);
        assert_eq!(wrong.iter().filter_map(|it| it.line).collect::<Vec<_>>(), [1, 3, 5]);
    }

    // covers: daemon
    #[test]
    fn any_bytes_end_in_assignments_and_mistakes_soon() {
        let begin = std::time::Instant::now();
        let kinds: [&[u8]; 8] = [b"A=", b"\"", b"'", b"\\", b"\n", b"$", b" #=x\n", b"\xff\0\r"];
        let mut seed = 1_u32;
        for length in [0, 1, 2, 3, 7, 50, 1000, 30_000] {
            for _ in 0..20 {
                let mut text = Vec::new();
                for _ in 0..length {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    text.extend(kinds[seed as usize >> 29]);
                }
                let (found, wrong) = assignments(&text);
                let lines = text.iter().filter(|byte| **byte == b'\n').count() + 1;
                assert!(found.len() + wrong.len() <= lines);
            }
        }
        // Each of these opens a quote that ends nowhere.
        let open = "A=\"\\\"\n".repeat(10_000) + &"B='".repeat(10_000);
        assert!(!assignments(open.as_bytes()).1.is_empty());
        assert!(begin.elapsed() < std::time::Duration::from_secs(20), "{:?}", begin.elapsed());
    }
}
