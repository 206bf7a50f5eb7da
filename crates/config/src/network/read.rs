//! From text to [`NetworkFile`]: TOML, keys and types, then what the values say together.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::check::check;
use super::error::{Fault, MAX_NETWORK_BYTES, NetworkError, Step, path_text, short};
use super::model::NetworkFile;

/// Maximum bytes of a message of the TOML reader.
const MAX_MESSAGE: usize = 600;

impl NetworkFile {
    /// Reads the bytes of a file; `name` is the file in messages.
    ///
    /// # Errors
    /// [`NetworkError`]: text that is not UTF-8 or not TOML, unknown, missing or duplicate keys, values of another type
    /// or out of range, references to names that the file lacks.
    pub fn read(name: &str, bytes: &[u8]) -> Result<NetworkFile, NetworkError> {
        let failed = |line: Option<usize>, message: String| NetworkError {
            file: name.to_owned(),
            line,
            key: String::new(),
            subdevice: String::new(),
            message,
        };
        if bytes.len() > MAX_NETWORK_BYTES {
            return Err(NetworkError::too_long(name, bytes.len() as u64));
        }
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
            failed(Some(line), "expected UTF-8 text".to_owned())
        })?;
        let tree = DeTable::parse(text).map_err(|error| {
            let line = error.span().map_or_else(|| too_deep_line(text), |span| Some(line_of(text, span.start)));
            failed(line, in_plain_words(error.message()))
        })?;
        let root = tree.get_ref();
        version(root).map_err(|fault| placed(name, text, root, &fault))?;
        let file: NetworkFile = toml::from_str(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let path = path_at(root, &span);
            NetworkError {
                line: Some(line_of(text, span.start)),
                key: path_text(&path),
                subdevice: subdevice_of(root, &path),
                ..failed(None, in_plain_words(error.message()))
            }
        })?;
        tables(root, &mut Vec::new()).map_err(|fault| placed(name, text, root, &fault))?;
        check(&file).map_err(|fault| placed(name, text, root, &fault))?;
        Ok(file)
    }
}

/// The line with the most levels of tables and lists, if these can be more than the reader takes: it gives no place for
/// them.
fn too_deep_line(text: &str) -> Option<usize> {
    /// Levels that the reader takes.
    const LEVELS: usize = 80;
    let (mut open, mut deepest) = (0_usize, (0, 1));
    for (number, line) in (1..).zip(text.lines()) {
        let mut most = open;
        for byte in line.bytes() {
            match byte {
                b'[' | b'{' => open += 1,
                b']' | b'}' => open = open.saturating_sub(1),
                _ => {}
            }
            most = most.max(open);
        }
        let levels = most + line.matches('.').count();
        if levels > deepest.0 {
            deepest = (levels, number);
        }
    }
    (deepest.0 >= LEVELS).then_some(deepest.1)
}

/// The version comes first: a file of a later version may have any keys.
fn version(root: &DeTable<'_>) -> Result<(), Fault> {
    let fault = |got: &str| Fault {
        path: vec!["ringcat_network".into()],
        message: format!("expected version {} of the format, got {got}", super::model::VERSION),
    };
    let Some(value) = root.get("ringcat_network") else {
        return Err(Fault {
            path: Vec::new(),
            message: "expected a network file of RingCAT, which begins with ringcat_network = 1".to_owned(),
        });
    };
    match value.get_ref() {
        DeValue::Integer(number) if number.as_str() == super::model::VERSION.to_string() => Ok(()),
        DeValue::Integer(number) => Err(fault(number.as_str())),
        _ => Err(fault("no number")),
    }
}

/// Keys whose values are arrays.
const ARRAYS: [&str; 8] =
    ["domain", "subdevice", "sync_manager", "pdo", "entries", "startup", "connection", "protocols"];

/// Refuses arrays in place of tables: the deserializer would take their elements as the values of the keys in order.
fn tables(table: &DeTable<'_>, path: &mut Vec<Step>) -> Result<(), Fault> {
    for (key, value) in table {
        path.push(Step::Key(key.get_ref().to_string()));
        match value.get_ref() {
            DeValue::Array(array) if ARRAYS.contains(&&**key.get_ref()) => {
                for (index, value) in array.iter().enumerate() {
                    path.push(Step::Index(index));
                    no_array(value.get_ref(), path)?;
                    path.pop();
                }
            }
            other => no_array(other, path)?,
        }
        path.pop();
    }
    Ok(())
}

fn no_array(value: &DeValue<'_>, path: &mut Vec<Step>) -> Result<(), Fault> {
    match value {
        DeValue::Table(table) => tables(table, path),
        DeValue::Array(_) => Err(Fault { path: path.clone(), message: "expected a table, got an array".to_owned() }),
        _ => Ok(()),
    }
}

/// The error of a key, with its line or that of the nearest table that contains it.
pub(super) fn placed(name: &str, text: &str, root: &DeTable<'_>, fault: &Fault) -> NetworkError {
    let line = place_of(root, &fault.path).map(|span| line_of(text, span.start));
    NetworkError {
        file: name.to_owned(),
        line,
        key: path_text(&fault.path),
        subdevice: subdevice_of(root, &fault.path),
        message: fault.message.clone(),
    }
}

/// The place of a key; of the last step that exists.
fn place_of(root: &DeTable<'_>, path: &[Step]) -> Option<Range<usize>> {
    let mut place = None;
    let mut at: Option<&DeValue<'_>> = None;
    for step in path {
        let table = match (at, step) {
            (None, Step::Key(_)) => Some(root),
            (Some(DeValue::Table(table)), Step::Key(_)) => Some(table),
            _ => None,
        };
        match (table, at, step) {
            (Some(table), _, Step::Key(key)) => {
                let Some((name, value)) = table.get_key_value(key.as_str()) else { return place };
                let is_nested = matches!(value.get_ref(), DeValue::Table(_) | DeValue::Array(_));
                // The span of a table is that of its header or braces.
                place = Some(if is_nested && place.is_some() { value.span() } else { name.span() });
                at = Some(value.get_ref());
            }
            (_, Some(DeValue::Array(array)), Step::Index(index)) => {
                let Some(value) = array.get(*index) else { return place };
                place = Some(value.span());
                at = Some(value.get_ref());
            }
            _ => return place,
        }
    }
    place
}

/// The path of the innermost key around a place.
fn path_at(root: &DeTable<'_>, span: &Range<usize>) -> Vec<Step> {
    let mut path = Vec::new();
    in_table(root, span, &mut path);
    path
}

fn in_table(table: &DeTable<'_>, span: &Range<usize>, path: &mut Vec<Step>) -> bool {
    for (key, value) in table {
        path.push(Step::Key(key.get_ref().to_string()));
        if key.span() == *span || in_value(value, span, path) {
            return true;
        }
        path.pop();
    }
    false
}

fn in_value(value: &Spanned<DeValue<'_>>, span: &Range<usize>, path: &mut Vec<Step>) -> bool {
    let is_it = value.span() == *span;
    match value.get_ref() {
        DeValue::Table(table) => in_table(table, span, path) || is_it,
        DeValue::Array(array) => {
            for (index, value) in array.iter().enumerate() {
                path.push(Step::Index(index));
                if in_value(value, span, path) {
                    return true;
                }
                path.pop();
            }
            is_it
        }
        _ => is_it,
    }
}

/// The name of the SubDevice in which a key is.
fn subdevice_of(root: &DeTable<'_>, path: &[Step]) -> String {
    let (Some(Step::Key(key)), Some(Step::Index(index))) = (path.first(), path.get(1)) else { return String::new() };
    let tables = root.get(key.as_str()).filter(|_| key == "subdevice").and_then(|value| value.get_ref().as_array());
    let table = tables.and_then(|tables| tables.get(*index)).and_then(|table| table.get_ref().as_table());
    let name = table.and_then(|table| table.get("name")).and_then(|name| name.get_ref().as_str());
    short(name.unwrap_or_default())
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}

/// Types and tables of Rust in terms of TOML.
fn in_plain_words(message: &str) -> String {
    const WORDS: [(&str, &str); 16] = [
        ("expected u8", "expected a whole number from 0 to 255"),
        ("expected u16", "expected a whole number from 0 to 65535"),
        ("expected u32", "expected a whole number from 0 to 4294967295"),
        ("expected u64", "expected a whole number, not negative"),
        ("expected a boolean", "expected true or false"),
        ("expected a sequence", "expected an array"),
        ("expected a string", "expected a text in quotation marks"),
        ("expected struct ", "expected a table "),
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
        ("duplicate field", "key that is given twice"),
        ("unknown variant", "unknown word"),
        ("invalid type: ", "got "),
        ("invalid value: ", "got "),
        ("integer `", "the number `"),
        ("string \"", "the text \""),
    ];
    let mut text = message.trim().replace('\n', " ");
    for (from, to) in WORDS {
        text = text.replace(from, to);
    }
    if text.len() > MAX_MESSAGE {
        let end = (0..=MAX_MESSAGE).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
        text.truncate(end);
        text.push_str(" ...");
    }
    text
}
