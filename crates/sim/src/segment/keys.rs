//! The keys that a segment file may have, with their types: errors in terms of TOML, with the key, the line and what is
//! allowed.
//!
//! The check comes before the text is read into [`File`](super::format::File), whose fields have the same keys.

use core::fmt;
use core::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::SegmentError;
use super::format::line;

/// What a value has to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// A text.
    Text,
    /// An array of texts.
    Texts,
    /// True or false.
    Flag,
    /// A whole number from 0 to this one.
    Whole(u64),
    /// A number, whole or not.
    Number,
    /// True, false or a port: `ring`.
    Ring,
}

use Kind::{Flag, Number, Ring, Text, Texts, Whole};

/// Limits of whole numbers: TOML ends at 63 bits.
const BITS_8: Kind = Whole(u8::MAX as u64);
const BITS_16: Kind = Whole(u16::MAX as u64);
const BITS_32: Kind = Whole(u32::MAX as u64);
const BITS_63: Kind = Whole(i64::MAX as u64);

/// A kind of table: its keys with their types.
type Keys = &'static [(&'static str, Kind)];

/// Table `[segment]`.
pub(super) const SEGMENT: Keys = &[
    ("name", Text),
    ("seed", BITS_63),
    ("ring", Ring),
    ("cable_ns", BITS_63),
    ("link_down_delay_us", Number),
    ("link_up_delay_us", Number),
    ("hop_ns", BITS_63),
    ("processing_ns", BITS_63),
    ("forwarding_ns", BITS_63),
    ("max_datagrams", BITS_16),
    ("more_datagrams", Text),
];

/// Tables `[[device]]`.
pub(super) const DEVICE: Keys = &[
    ("name", Text),
    ("type", Text),
    ("sii", Text),
    ("esi", Text),
    ("revision", BITS_32),
    ("product", BITS_32),
    ("modules", Texts),
    ("count", BITS_63),
    ("alias", BITS_16),
    ("serial", BITS_32),
    ("drift_ppm", Number),
    ("clock_start_ns", BITS_63),
    ("clock_bits", BITS_8),
    ("wander_ppm", Number),
    ("wander_s", Number),
    ("receive_jitter_ns", Number),
    ("latches_processing_only", Flag),
    ("latches_any_frame", Flag),
    ("processing_ns", BITS_63),
    ("forwarding_ns", BITS_63),
    ("eight_byte_sii", Flag),
    ("sii_busy_us", Number),
    ("transition_ms", Number),
    ("to_init_ms", Number),
    ("to_preop_ms", Number),
    ("to_safeop_ms", Number),
    ("to_op_ms", Number),
    ("back_ms", Number),
    ("answer_us", Number),
    ("mailbox_bytes", BITS_16),
    ("files", Texts),
    ("password", BITS_32),
    ("erase_ms", Number),
    ("ethernet", Text),
    ("ip", Text),
    ("gateway", Text),
    ("attach", Text),
    ("port", BITS_63),
    ("cable_ns", BITS_63),
];

/// Tables `[[cable]]`; the first two are required.
pub(super) const CABLE: Keys = &[("from", Text), ("to", Text), ("delay_ns", BITS_63)];

/// Tables `[[fault]]`; the first one is required, and one of the others.
pub(super) const FAULT: Keys =
    &[("at_ms", Number), ("cut", BITS_63), ("heal", BITS_63), ("power_off", Text), ("power_on", Text)];

/// Refuses keys that are unknown, missing, given twice or of another type. Text that is no TOML is left to its reader.
pub(super) fn check(text: &str) -> Result<(), SegmentError> {
    let file = match DeTable::parse(text) {
        Ok(file) => file,
        Err(error) => return duplicate(text, error.message(), error.span()),
    };
    for (key, value) in file.get_ref() {
        let at = |message: String, span: Range<usize>| Err(SegmentError::new(message).at_line(line(text, &span)));
        match (key.get_ref().as_ref(), value.get_ref()) {
            ("segment", DeValue::Table(table)) => check_table(text, "[segment]", None, table, SEGMENT)?,
            ("segment", other) => {
                return at(format!("segment: expected one table [segment], got {}", Found(other)), key.span());
            }
            (name @ ("device" | "cable" | "fault"), DeValue::Array(tables)) => {
                for (number, table) in (1..).zip(tables) {
                    let DeValue::Table(keys) = table.get_ref() else {
                        let found = Found(table.get_ref());
                        return at(format!("{name}: expected tables [[{name}]], got {found} among them"), table.span());
                    };
                    check_entry(text, name, number, keys, &table.span())?;
                }
            }
            (name @ ("device" | "cable" | "fault"), other) => {
                return at(format!("{name}: expected tables [[{name}]], got {}", Found(other)), key.span());
            }
            (other, _) => {
                let known = "expected [segment], [[device]], [[cable]] or [[fault]]";
                return at(format!("unknown table or key \"{}\": {known}", other.escape_debug()), key.span());
            }
        }
    }
    Ok(())
}

/// One `[[device]]`, `[[cable]]` or `[[fault]]`.
fn check_entry(
    text: &str,
    name: &str,
    number: usize,
    table: &DeTable<'_>,
    span: &Range<usize>,
) -> Result<(), SegmentError> {
    if name == "device" {
        let called = table.get("name").or_else(|| table.get("type")).and_then(|value| value.get_ref().as_str());
        // Where it has neither, its number in the file.
        let called = called.map_or_else(|| format!("number {number}"), str::to_owned);
        return check_table(text, "[[device]]", Some(&called), table, DEVICE);
    }
    let (title, keys, required, expected): (_, _, &[&str], _) = match name {
        "cable" => ("[[cable]]", CABLE, &["from", "to"], "from and to"),
        _ => ("[[fault]]", FAULT, &["at_ms"], "at_ms and a fault"),
    };
    check_table(text, title, None, table, keys)?;
    match required.iter().find(|key| !table.contains_key(**key)) {
        Some(key) => {
            let message = format!("{title} has no key {key}: expected {expected}");
            Err(SegmentError::new(message).at_line(line(text, span)))
        }
        None => Ok(()),
    }
}

/// The keys of one table.
fn check_table(
    text: &str,
    table_name: &str,
    device: Option<&str>,
    table: &DeTable<'_>,
    keys: Keys,
) -> Result<(), SegmentError> {
    let refuse = |message: String, span: Range<usize>| {
        let error = SegmentError::new(message).at_line(line(text, &span));
        Err(match device {
            Some(device) => error.about(device),
            None => error,
        })
    };
    for (key, value) in table {
        let name = key.get_ref().as_ref();
        let Some((_, kind)) = keys.iter().find(|(known, _)| *known == name) else {
            let known: Vec<&str> = keys.iter().map(|(known, _)| *known).collect();
            let (name, known) = (name.escape_debug(), known.join(", "));
            return refuse(format!("unknown key \"{name}\" in {table_name}: expected one of {known}"), key.span());
        };
        if let Some(wrong) = wrong(*kind, value) {
            let (found, span) = (Found(wrong.get_ref()), wrong.span());
            return refuse(format!("{name}: expected {kind}, got {found}"), span);
        }
    }
    Ok(())
}

/// The value, or the part of it, that is not of a kind.
fn wrong<'a>(kind: Kind, value: &'a Spanned<DeValue<'a>>) -> Option<&'a Spanned<DeValue<'a>>> {
    let fits = match (kind, value.get_ref()) {
        (Text | Ring, DeValue::String(_)) | (Flag | Ring, DeValue::Boolean(_)) => true,
        (Texts, DeValue::Array(texts)) => return texts.iter().find(|text| !text.get_ref().is_str()),
        (Number, DeValue::Float(_)) => true,
        (Number, DeValue::Integer(_)) => whole(value.get_ref()).is_some(),
        (Whole(most), DeValue::Integer(_)) => {
            whole(value.get_ref()).is_some_and(|number| (0..=i128::from(most)).contains(&number))
        }
        _ => false,
    };
    (!fits).then_some(value)
}

/// A whole number that TOML can hold.
fn whole(value: &DeValue<'_>) -> Option<i128> {
    let number = value.as_integer()?;
    let number = i128::from_str_radix(number.as_str(), number.radix()).ok()?;
    (i128::from(i64::MIN)..=i128::from(i64::MAX)).contains(&number).then_some(number)
}

/// The error of a key that is given twice, which the reader does not name.
fn duplicate(text: &str, message: &str, span: Option<Range<usize>>) -> Result<(), SegmentError> {
    let Some(span) = span.filter(|_| message.starts_with("duplicate key")) else { return Ok(()) };
    let key = text.get(span.clone()).unwrap_or_default().trim();
    Err(SegmentError::new(format!("key {key} is given twice in one table")).at_line(line(text, &span)))
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Text => f.write_str("a text in quotation marks"),
            Texts => f.write_str("an array of texts"),
            Flag => f.write_str("true or false"),
            Whole(most) if *most == i64::MAX as u64 => f.write_str("a whole number, not negative"),
            Whole(most) => write!(f, "a whole number from 0 to {most}"),
            Number => f.write_str("a number"),
            Ring => f.write_str("true, false or \"device.port\""),
        }
    }
}

/// A value in an error.
struct Found<'a>(&'a DeValue<'a>);

impl fmt::Display for Found<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            DeValue::String(text) => write!(f, "the text \"{}\"", text.escape_debug()),
            DeValue::Integer(number) => {
                let prefix = match number.radix() {
                    16 => "0x",
                    8 => "0o",
                    2 => "0b",
                    _ => "",
                };
                write!(f, "{prefix}{}", number.as_str())
            }
            DeValue::Float(number) => f.write_str(number.as_str()),
            DeValue::Boolean(value) => write!(f, "{value}"),
            DeValue::Datetime(time) => write!(f, "the time {time}"),
            DeValue::Array(_) => f.write_str("an array"),
            DeValue::Table(_) => f.write_str("a table"),
        }
    }
}

#[cfg(test)]
mod tests;
