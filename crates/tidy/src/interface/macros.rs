//! Public items that macros of a crate make.
//!
//! Macros are not expanded. Input: the definition of a macro, or a call. Output: the public items in the definition's
//! body, as they are written there, and one line for each part of a call, so that a change of either shows. A macro
//! without a public item has no lines, and its calls have none.

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

use super::one_line::{one_line, without_attributes};

/// Words behind `pub` that begin an item; any other is the name of a field.
const KEYWORDS: [&str; 10] = ["async", "const", "enum", "fn", "mod", "static", "struct", "trait", "type", "unsafe"];

/// A public item in the body of a macro.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made {
    /// The type that it is about, or `$name` where each call names it.
    pub owner: String,
    /// As it is written.
    pub text: String,
}

/// The public items in the body of a macro; `is_private` finds traits without a meaning for other crates.
pub fn made(definition: &TokenStream, is_private: &dyn Fn(&str) -> bool) -> Vec<Made> {
    let mut body = Body { is_private, found: Vec::new() };
    let mut is_body = false;
    for token in definition.clone() {
        match token {
            TokenTree::Group(group) if is_body => body.walk(group.stream(), ""),
            TokenTree::Punct(punct) => is_body = punct.as_char() == '>',
            _ => is_body = false,
        }
    }
    body.found
}

struct Body<'a> {
    is_private: &'a dyn Fn(&str) -> bool,
    found: Vec<Made>,
}

impl Body<'_> {
    fn walk(&mut self, tokens: TokenStream, owner: &str) {
        let tokens = without_attributes(tokens);
        let mut at = 0;
        while at < tokens.len() {
            let word = tokens[at].to_string();
            let is_restricted = matches!(tokens.get(at + 1), Some(TokenTree::Group(_)));
            if (word == "pub" && !is_restricted) || word == "impl" {
                let end = end_of_signature(&tokens, at);
                self.add_item(&tokens[at..end], tokens.get(end), owner);
                // The body of the item, if there is one, belongs to it.
                at = end + 1;
                continue;
            }
            if let (TokenTree::Group(group), true) = (&tokens[at], at > 0 && is_dollar(&tokens[at - 1])) {
                self.walk(group.stream(), owner);
            }
            at += 1;
        }
    }

    fn add_item(&mut self, signature: &[TokenTree], next: Option<&TokenTree>, owner: &str) {
        let text = text_of(signature);
        let is_impl = signature[0].to_string() == "impl";
        let of_trait = is_impl.then(|| text.split_once(" for ")).flatten();
        let names = |text: &str| words(text).into_iter().next().unwrap_or_default();
        if of_trait.is_some_and(|(before, _)| {
            let name = before.rsplit("::").next().unwrap_or(before);
            (self.is_private)(names(name.trim_start_matches("impl")).as_str())
        }) {
            return;
        }
        let own = match of_trait {
            Some((_, after)) => names(after),
            None if is_impl => names(without_parameters(&text["impl".len()..])),
            None if owner.is_empty() => declared(&text),
            None => owner.to_owned(),
        };
        let body = match next {
            Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => Some(group),
            _ => None,
        };
        let is_inherent = is_impl && of_trait.is_none();
        if !is_inherent {
            self.found.push(Made { owner: own.clone(), text });
        }
        let has_members = is_inherent || matches!(signature.get(1), Some(word) if is_type(word));
        if let (Some(group), true) = (body, has_members) {
            self.walk(group.stream(), &own);
        }
    }
}

/// One line for each part of a call: `A(u8) { a: B; c: D; }` has three parts with the name before them.
pub fn parts(call: TokenStream) -> Vec<String> {
    let tokens = without_attributes(call);
    let is = |token: &TokenTree, sign| matches!(token, TokenTree::Punct(punct) if punct.as_char() == sign);
    let sign = if tokens.iter().any(|token| is(token, ';')) { ';' } else { ',' };
    let mut found = Vec::new();
    for part in tokens.split(|token| is(token, sign)).filter(|part| !part.is_empty()) {
        match part {
            [head @ .., TokenTree::Group(group)] if is_block(head, group) => {
                let head = text_of(head);
                found.push(head.clone());
                found.extend(parts(group.stream()).into_iter().map(|inner| format!("{head}: {inner}")));
            }
            _ => found.push(text_of(part)),
        }
    }
    found
}

fn is_block(head: &[TokenTree], group: &Group) -> bool {
    !head.is_empty() && group.delimiter() == Delimiter::Brace
}

fn is_dollar(token: &TokenTree) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == '$')
}

fn is_type(word: &TokenTree) -> bool {
    ["struct", "enum", "trait"].contains(&word.to_string().as_str())
}

/// The place of what ends the signature that begins here: a body, a semicolon, a comma between fields.
fn end_of_signature(tokens: &[TokenTree], from: usize) -> usize {
    let second = tokens.get(from + 1).map_or_else(String::new, ToString::to_string);
    let is_field = tokens[from].to_string() == "pub" && !KEYWORDS.contains(&second.as_str());
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        TokenTree::Punct(punct) => punct.as_char() == ';' || (is_field && punct.as_char() == ','),
        _ => false,
    };
    tokens[from..].iter().position(ends).map_or(tokens.len(), |length| from + length)
}

/// The source of these tokens in one line.
fn text_of(tokens: &[TokenTree]) -> String {
    let stream: TokenStream = tokens.iter().cloned().collect();
    let whole = tokens.first().zip(tokens.last()).and_then(|(first, last)| first.span().join(last.span()));
    one_line(&whole.and_then(|span| span.source_text()).unwrap_or_else(|| stream.to_string()))
}

/// What follows the `<...>` behind `impl`.
fn without_parameters(text: &str) -> &str {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '<' => depth += 1,
            '>' if !text[..at].ends_with('-') => depth -= 1,
            _ => {}
        }
        if depth == 0 && !c.is_whitespace() {
            return if c == '>' { &text[at + 1..] } else { &text[at..] };
        }
    }
    text
}

/// The name that a signature declares.
fn declared(signature: &str) -> String {
    let is_name = |word: &String| word != "pub" && !KEYWORDS.contains(&word.as_str());
    words(signature).into_iter().find(is_name).unwrap_or_default()
}

/// The words in a text, variables of macros with their dollar.
pub fn words(text: &str) -> Vec<String> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '$'));
    words.filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made_by(text: &str) -> Vec<String> {
        let syn::Item::Macro(item) = syn::parse_str(text).expect("parses") else { panic!("a macro") };
        let found = made(&item.mac.tokens, &|name| name == "Own");
        found.into_iter().map(|made| format!("{} | {}", made.owner, made.text)).collect()
    }

    #[test]
    fn public_items_in_a_body_are_found_with_their_owner() {
        let text = "macro_rules! a {\n    ($($name:ident { $field:ident })*) => {$(\n        /// It.\n        \
                    pub struct $name {\n            pub $field: u8,\n            own: u8,\n        }\n        \
                    impl $name {\n            pub const N: u8 = 1;\n            pub(crate) fn no() {}\n            \
                    pub fn yes(self) -> u8 {\n                1\n            }\n        }\n        \
                    impl Own for $name {}\n        impl Copy for $name {}\n        pub enum Fixed {}\n    )*};\n}";
        let expected = [
            "$name | pub struct $name",
            "$name | pub $field: u8",
            "$name | pub const N: u8 = 1",
            "$name | pub fn yes(self) -> u8",
            "$name | impl Copy for $name",
            "Fixed | pub enum Fixed",
        ];
        assert_eq!(made_by(text), expected);
        assert_eq!(made_by("macro_rules! b { ($a:ident) => { impl Own for $a {} }; }"), [""; 0]);
    }

    #[test]
    fn a_call_has_a_line_for_each_part() {
        let of = |text: &str| parts(text.parse().expect("tokens"));
        assert_eq!(of("Input Output"), ["Input Output"]);
        assert_eq!(of("/// It.\n    A = 1;\n    B = 2;"), ["A = 1", "B = 2"]);
        assert_eq!(
            of("A(u8, reset 0) {\n    a: bool = 0, 1;\n    b: u8 = 1, 2;\n}"),
            ["A(u8, reset 0)", "A(u8, reset 0): a: bool = 0, 1", "A(u8, reset 0): b: u8 = 1, 2"]
        );
    }
}
