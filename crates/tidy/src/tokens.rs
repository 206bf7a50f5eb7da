//! A small Rust lexer: identifiers and punctuation with their lines; comments, literals and lifetimes are dropped.
//!
//! Input: the text of a source file. Output: [`Token`]s. The lexer does not check whether the text is valid Rust;
//! invalid text results in some tokens, never in a panic.

/// Kind of a token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An identifier or keyword.
    Ident(String),
    /// Any other character.
    Punct(char),
}

/// A token and its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// Kind.
    pub kind: Kind,
    /// Line, counted from 1.
    pub line: usize,
}

impl Token {
    /// The identifier, if it is one.
    pub fn ident(&self) -> Option<&str> {
        match &self.kind {
            Kind::Ident(name) => Some(name),
            Kind::Punct(_) => None,
        }
    }

    /// Whether it is this identifier.
    pub fn is_ident(&self, name: &str) -> bool {
        self.ident() == Some(name)
    }

    /// Whether it is this character.
    pub fn is(&self, punct: char) -> bool {
        self.kind == Kind::Punct(punct)
    }
}

/// Whether a path separator is at `at`.
pub fn separator_at(tokens: &[Token], at: usize) -> bool {
    tokens.get(at).is_some_and(|t| t.is(':')) && tokens.get(at + 1).is_some_and(|t| t.is(':'))
}

/// Converts a source file into tokens.
pub fn tokens(text: &str) -> Vec<Token> {
    let mut lexer = Lexer { chars: text.chars().collect(), at: 0, line: 1, tokens: Vec::new() };
    while let Some(c) = lexer.peek(0) {
        lexer.step(c);
    }
    lexer.tokens
}

struct Lexer {
    chars: Vec<char>,
    at: usize,
    line: usize,
    tokens: Vec<Token>,
}

impl Lexer {
    fn peek(&self, ahead: usize) -> Option<char> {
        self.chars.get(self.at + ahead).copied()
    }

    fn advance(&mut self, count: usize) {
        let end = (self.at + count).min(self.chars.len());
        self.line += self.chars[self.at..end].iter().filter(|c| **c == '\n').count();
        self.at = end;
    }

    fn skip_while(&mut self, keep_on: impl Fn(char) -> bool) {
        while self.peek(0).is_some_and(&keep_on) {
            self.advance(1);
        }
    }

    fn step(&mut self, c: char) {
        match (c, self.peek(1)) {
            ('/', Some('/')) => self.skip_while(|c| c != '\n'),
            ('/', Some('*')) => self.block_comment(),
            ('"', _) => self.string(),
            ('\'', _) => self.char_or_lifetime(),
            _ if c.is_whitespace() => self.advance(1),
            _ if c.is_ascii_digit() => self.skip_while(|c| c.is_alphanumeric() || c == '_'),
            _ if c.is_alphabetic() || c == '_' => self.word(),
            _ => {
                self.tokens.push(Token { kind: Kind::Punct(c), line: self.line });
                self.advance(1);
            }
        }
    }

    fn block_comment(&mut self) {
        let mut depth = 0;
        while self.peek(0).is_some() {
            match (self.peek(0), self.peek(1)) {
                (Some('/'), Some('*')) => {
                    depth += 1;
                    self.advance(2);
                }
                (Some('*'), Some('/')) => {
                    depth -= 1;
                    self.advance(2);
                    if depth == 0 {
                        return;
                    }
                }
                _ => self.advance(1),
            }
        }
    }

    fn string(&mut self) {
        self.advance(1);
        while let Some(c) = self.peek(0) {
            self.advance(if c == '\\' { 2 } else { 1 });
            if c == '"' {
                return;
            }
        }
    }

    fn raw_string(&mut self, hashes: usize) {
        self.advance(hashes + 1);
        while let Some(c) = self.peek(0) {
            self.advance(1);
            if c == '"' && (0..hashes).all(|i| self.peek(i) == Some('#')) {
                self.advance(hashes);
                return;
            }
        }
    }

    /// `'a'` and `'\n'` are literals, `'a` without a closing quote is a lifetime.
    fn char_or_lifetime(&mut self) {
        if self.peek(1) == Some('\\') {
            self.advance(3);
            self.skip_while(|c| c != '\'');
            self.advance(1);
        } else if self.peek(2) == Some('\'') {
            self.advance(3);
        } else {
            self.advance(1);
            self.skip_while(|c| c.is_alphanumeric() || c == '_');
        }
    }

    fn word(&mut self) {
        let (start, line) = (self.at, self.line);
        self.skip_while(|c| c.is_alphanumeric() || c == '_');
        let word: String = self.chars[start..self.at].iter().collect();
        let hashes = (0..).take_while(|i| self.peek(*i) == Some('#')).count();
        let raw = matches!(word.as_str(), "r" | "br" | "cr") && self.peek(hashes) == Some('"');
        if raw {
            self.raw_string(hashes);
        } else if matches!(word.as_str(), "b" | "c") && matches!(self.peek(0), Some('"' | '\'')) {
            // A byte or C literal: the prefix belongs to it.
        } else if word == "r" && hashes == 1 {
            self.advance(1);
        } else {
            self.tokens.push(Token { kind: Kind::Ident(word), line });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        tokens(text).iter().filter_map(|t| t.ident().map(str::to_owned)).collect()
    }

    #[test]
    fn words_in_comments_and_literals_are_not_code() {
        let text = "a // b\n/* c /* d */ e */ f \"g \\\" h\" r#\"i \" j\"# b\"k\" b'l' 'm' '\\'' '\\u{6e}' n";
        assert_eq!(words(text), ["a", "f", "n"]);
    }

    #[test]
    fn lifetimes_do_not_open_a_literal() {
        assert_eq!(
            words("fn f<'a>(x: &'a str) -> &'static str { 'b: loop {} }"),
            ["fn", "f", "x", "str", "str", "loop"]
        );
    }

    #[test]
    fn raw_identifiers_are_identifiers() {
        assert_eq!(words("r#type"), ["type"]);
    }

    #[test]
    fn lines_count_through_literals() {
        let tokens = tokens("\"one\ntwo\"\nthree");
        assert_eq!((tokens[0].ident(), tokens[0].line), (Some("three"), 3));
    }

    #[test]
    fn an_open_literal_ends_with_the_file() {
        for text in ["\"", "'", "'\\", "/*", "r#\"", "b'"] {
            assert!(words(text).is_empty(), "{text}");
        }
    }
}
