//! A part of a source in one line, without comments and attributes.
//!
//! Input: text of Rust as rustfmt breaks it. Output: the same tokens with at most one space between two of them. A line
//! break behind an opening bracket, before a closing one, and the comma before it leave nothing.

use std::str::FromStr;

use proc_macro2::{Delimiter, Group, LineColumn, Spacing, TokenStream, TokenTree};

/// The text in one line; a text that is no sequence of tokens as it is.
pub fn one_line(text: &str) -> String {
    let Ok(tokens) = TokenStream::from_str(text) else { return text.to_owned() };
    let mut line = Line { text: String::new(), end: LineColumn { line: 1, column: 0 }, is_behind_bracket: true };
    line.add(tokens, 0);
    line.text
}

/// Tokens without attributes; comments of documentation are attributes, too.
pub fn without_attributes(tokens: TokenStream) -> Vec<TokenTree> {
    let mut kept = Vec::new();
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        let is_attribute = matches!(&token, TokenTree::Punct(punct) if punct.as_char() == '#')
            && matches!(tokens.peek(), Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Bracket);
        if is_attribute {
            tokens.next();
        } else {
            kept.push(token);
        }
    }
    kept
}

struct Line {
    text: String,
    /// End of the last token.
    end: LineColumn,
    /// A line break before the next token leaves nothing.
    is_behind_bracket: bool,
}

impl Line {
    /// Adds the tokens of a group that is closed in the line `closed_in`.
    fn add(&mut self, tokens: TokenStream, closed_in: usize) {
        let tokens = without_attributes(tokens);
        for (at, token) in tokens.iter().enumerate() {
            let span = token.span();
            match token {
                TokenTree::Group(group) => self.add_group(group),
                TokenTree::Punct(punct) => {
                    let sign = punct.as_char();
                    let closing = match tokens.get(at + 1) {
                        Some(TokenTree::Punct(next)) if next.as_char() == '>' => next.span().start().line,
                        Some(_) => 0,
                        None => closed_in,
                    };
                    if sign == ',' && closing > span.start().line {
                        continue;
                    }
                    self.push(&sign.to_string(), span.start(), span.end(), matches!(sign, '>' | '.'));
                    self.is_behind_bracket = sign == '<' && punct.spacing() == Spacing::Alone;
                }
                other => self.push(&other.to_string(), span.start(), span.end(), false),
            }
        }
    }

    fn add_group(&mut self, group: &Group) {
        let (open, close) = match group.delimiter() {
            Delimiter::Parenthesis => ("(", ")"),
            Delimiter::Bracket => ("[", "]"),
            Delimiter::Brace => ("{", "}"),
            Delimiter::None => ("", ""),
        };
        let (opened, closed) = (group.span_open(), group.span_close());
        self.push(open, opened.start(), opened.end(), false);
        self.is_behind_bracket = open != "{";
        self.add(group.stream(), closed.start().line);
        self.push(close, closed.start(), closed.end(), close != "}");
    }

    /// Adds one token; `is_closing`: a line break before it leaves nothing.
    fn push(&mut self, token: &str, start: LineColumn, end: LineColumn, is_closing: bool) {
        let is_broken = start.line != self.end.line;
        let is_apart = is_broken || start.column > self.end.column;
        let leaves_nothing = is_broken && (self.is_behind_bracket || is_closing);
        if is_apart && !leaves_nothing && !self.text.is_empty() {
            self.text.push(' ');
        }
        self.text.push_str(token);
        self.end = end;
        self.is_behind_bracket = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_and_unbroken_signatures_give_the_same_line() {
        let broken = "pub fn long(\n    &self,\n    // A comment.\n    more: (u8,),\n) -> Result<\n    A,\n    B,\n>";
        assert_eq!(one_line(broken), "pub fn long(&self, more: (u8,)) -> Result<A, B>");
        let fields = "Long {\n    /// It.\n    #[cfg(a)]\n    one: u8,\n    two: [u8; 2],\n}";
        assert_eq!(one_line(fields), "Long { one: u8, two: [u8; 2] }");
        for text in ["pub fn f<'a>(&'a mut self) -> impl Fn(&str) -> bool + 'a", "pub use a::{B, C as D}", "A = -1"] {
            assert_eq!(one_line(text), text);
        }
    }
}
