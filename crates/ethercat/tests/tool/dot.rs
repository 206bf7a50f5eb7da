//! A reader of graphs by the grammar of DOT, as far as undirected graphs without ports and subgraphs need it.

/// A graph.
#[derive(Debug, Default)]
pub struct Graph {
    /// Both ends of each edge.
    pub edges: Vec<(String, String)>,
    attributes: Vec<(String, String, String)>,
}

impl Graph {
    /// The label of a node, as it is written.
    pub fn label(&self, node: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(of, name, _)| of == node && name == "label");
        found.map(|(_, _, value)| value.as_str())
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Id(String),
    Symbol(&'static str),
}

const SYMBOLS: [&str; 8] = ["--", "{", "}", "[", "]", "=", ",", ";"];

/// Reads a graph.
pub fn parse(text: &str) -> Result<Graph, String> {
    let tokens = tokens(text)?;
    let mut parser = Parser { tokens, at: 0, graph: Graph::default() };
    parser.graph()?;
    Ok(parser.graph)
}

fn tokens(mut text: &str) -> Result<Vec<Token>, String> {
    let mut tokens = Vec::new();
    'next: loop {
        text = text.trim_start();
        if let Some(comment) = text.strip_prefix("/*") {
            text = comment.split_once("*/").ok_or("a comment has no end")?.1;
            continue;
        }
        for symbol in SYMBOLS {
            if let Some(rest) = text.strip_prefix(symbol) {
                tokens.push(Token::Symbol(symbol));
                text = rest;
                continue 'next;
            }
        }
        let Some(first) = text.chars().next() else { return Ok(tokens) };
        let length = match first {
            '"' => quoted(text)?,
            it if it.is_ascii_alphanumeric() || matches!(it, '_' | '.') => {
                text.find(|it: char| !it.is_ascii_alphanumeric() && !matches!(it, '_' | '.')).unwrap_or(text.len())
            }
            other => return Err(format!("{other:?} begins nothing")),
        };
        tokens.push(Token::Id(text[..length].trim_matches('"').to_owned()));
        text = &text[length..];
    }
}

/// Bytes of a text between quotes, with them.
fn quoted(text: &str) -> Result<usize, String> {
    let mut is_escaped = false;
    for (at, it) in text.char_indices().skip(1) {
        match it {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => return Ok(at + 1),
            it if it.is_control() => return Err(format!("{it:?} in a text")),
            _ => {}
        }
    }
    Err("a text has no end".to_owned())
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
    graph: Graph,
}

impl Parser {
    fn is_next(&mut self, wanted: &str) -> bool {
        let is = match self.tokens.get(self.at) {
            Some(Token::Id(text)) => text == wanted,
            Some(Token::Symbol(symbol)) => *symbol == wanted,
            None => false,
        };
        self.at += usize::from(is);
        is
    }

    fn expect(&mut self, wanted: &str) -> Result<(), String> {
        let place = self.at;
        if self.is_next(wanted) { Ok(()) } else { Err(format!("no {wanted} but {:?}", self.tokens.get(place))) }
    }

    fn id(&mut self) -> Result<String, String> {
        match self.tokens.get(self.at) {
            Some(Token::Id(text)) => {
                self.at += 1;
                Ok(text.clone())
            }
            other => Err(format!("no word but {other:?}")),
        }
    }

    fn graph(&mut self) -> Result<(), String> {
        self.is_next("strict");
        self.expect("graph")?;
        if !self.is_next("{") {
            self.id()?;
            self.expect("{")?;
        }
        while !self.is_next("}") {
            self.statement()?;
            self.is_next(";");
        }
        if self.at == self.tokens.len() { Ok(()) } else { Err("more behind the graph".to_owned()) }
    }

    fn statement(&mut self) -> Result<(), String> {
        let first = self.id()?;
        if self.is_next("=") {
            return self.id().map(drop);
        }
        let mut near = first.clone();
        let mut is_edge = false;
        while self.is_next("--") {
            let far = self.id()?;
            self.graph.edges.push((near, far.clone()));
            (near, is_edge) = (far, true);
        }
        let of = if is_edge { String::new() } else { first };
        while self.is_next("[") {
            while !self.is_next("]") {
                let name = self.id()?;
                self.expect("=")?;
                let value = self.id()?;
                self.graph.attributes.push((of.clone(), name, value));
                let _ = self.is_next(",") || self.is_next(";");
            }
        }
        Ok(())
    }
}
