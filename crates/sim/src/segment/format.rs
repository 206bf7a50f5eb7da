//! The keys of a segment file.

use core::ops::Range;
use core::time::Duration;

use serde::Deserialize;
use toml::{Spanned, Table, Value};

use super::SegmentError;
use crate::network::{Beyond, DatagramLimit, NetworkOptions};

/// A whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(default)]
    pub(super) segment: Options,
    #[serde(default)]
    pub(super) device: Vec<Spanned<DeviceEntry>>,
    #[serde(default)]
    pub(super) cable: Vec<Spanned<CableEntry>>,
    #[serde(default)]
    pub(super) fault: Vec<Spanned<FaultEntry>>,
}

/// Table `[segment]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Options {
    pub(super) name: Option<String>,
    pub(super) seed: Option<u64>,
    pub(super) ring: Option<Spanned<Value>>,
    pub(super) cable_ns: Option<u64>,
    link_down_delay_us: Option<Spanned<f64>>,
    link_up_delay_us: Option<Spanned<f64>>,
    hop_ns: Option<u64>,
    processing_ns: Option<u64>,
    forwarding_ns: Option<u64>,
    max_datagrams: Option<Spanned<u16>>,
    more_datagrams: Option<Spanned<String>>,
}

/// One table of `[[device]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DeviceEntry {
    pub(super) name: Option<Spanned<String>>,
    #[serde(rename = "type")]
    pub(super) kind: Option<Spanned<String>>,
    pub(super) sii: Option<Spanned<String>>,
    pub(super) esi: Option<Spanned<String>>,
    pub(super) revision: Option<Spanned<u32>>,
    pub(super) product: Option<Spanned<u32>>,
    #[serde(default)]
    pub(super) modules: Vec<Spanned<String>>,
    pub(super) count: Option<Spanned<usize>>,
    pub(super) alias: Option<u16>,
    pub(super) serial: Option<u32>,
    pub(super) drift_ppm: Option<Spanned<f64>>,
    pub(super) clock_start_ns: Option<u64>,
    pub(super) clock_bits: Option<Spanned<u8>>,
    pub(super) wander_ppm: Option<Spanned<f64>>,
    pub(super) wander_s: Option<Spanned<f64>>,
    pub(super) receive_jitter_ns: Option<Spanned<f64>>,
    pub(super) latches_processing_only: Option<bool>,
    pub(super) latches_any_frame: Option<bool>,
    pub(super) processing_ns: Option<u64>,
    pub(super) forwarding_ns: Option<u64>,
    pub(super) eight_byte_sii: Option<bool>,
    pub(super) sii_busy_us: Option<Spanned<f64>>,
    pub(super) transition_ms: Option<Spanned<f64>>,
    pub(super) to_init_ms: Option<Spanned<f64>>,
    pub(super) to_preop_ms: Option<Spanned<f64>>,
    pub(super) to_safeop_ms: Option<Spanned<f64>>,
    pub(super) to_op_ms: Option<Spanned<f64>>,
    pub(super) back_ms: Option<Spanned<f64>>,
    pub(super) answer_us: Option<Spanned<f64>>,
    pub(super) mailbox_bytes: Option<Spanned<u16>>,
    #[serde(default)]
    pub(super) files: Vec<Spanned<String>>,
    pub(super) password: Option<u32>,
    pub(super) erase_ms: Option<Spanned<f64>>,
    pub(super) ethernet: Option<Spanned<String>>,
    pub(super) ip: Option<Spanned<String>>,
    pub(super) gateway: Option<Spanned<String>>,
    pub(super) attach: Option<Spanned<String>>,
    pub(super) port: Option<Spanned<usize>>,
    pub(super) cable_ns: Option<u64>,
}

/// One table of `[[cable]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CableEntry {
    pub(super) from: Spanned<String>,
    pub(super) to: Spanned<String>,
    pub(super) delay_ns: Option<u64>,
}

/// One table of `[[fault]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaultEntry {
    pub(super) at_ms: Spanned<f64>,
    pub(super) cut: Option<Spanned<u64>>,
    pub(super) heal: Option<Spanned<u64>>,
    pub(super) power_off: Option<Spanned<String>>,
    pub(super) power_on: Option<Spanned<String>>,
}

impl File {
    /// Reads the keys.
    pub(super) fn parse(text: &str) -> Result<File, SegmentError> {
        toml::from_str(text).map_err(|error| {
            let message = SegmentError::new(describe(error.message()));
            match error.span() {
                Some(span) => {
                    let at = message.at_line(line(text, &span));
                    match device_around(text, span.start) {
                        Some(device) => at.about(device),
                        None => at,
                    }
                }
                // The reader names no place only for a key of too many parts.
                None => message.at_line(line_of_longest_key(text)),
            }
        })
    }

    /// Options of the network.
    pub(super) fn options(&self, text: &str) -> Result<NetworkOptions, SegmentError> {
        let given = &self.segment;
        let mut options = NetworkOptions { seed: given.seed.unwrap_or(0), ..NetworkOptions::default() };
        for (value, key, target) in [
            (&given.link_down_delay_us, "link_down_delay_us", &mut options.link_down_delay),
            (&given.link_up_delay_us, "link_up_delay_us", &mut options.link_up_delay),
        ] {
            if let Some(value) = value {
                *target = duration(value, key, 1e-6).map_err(|error| error.at_line(line(text, &value.span())))?;
            }
        }
        if let Some(hop) = given.hop_ns {
            options = options.with_hop_delay(Duration::from_nanos(hop));
        }
        if let Some(processing) = given.processing_ns {
            options.processing_delay = Duration::from_nanos(processing);
        }
        if let Some(forwarding) = given.forwarding_ns {
            options.forwarding_delay = Duration::from_nanos(forwarding);
        }
        options.max_datagrams = given.datagram_limit(text)?;
        Ok(options)
    }
}

impl Options {
    /// Maximum number of datagrams in a frame, and handling of further ones.
    fn datagram_limit(&self, text: &str) -> Result<Option<DatagramLimit>, SegmentError> {
        let wrong = |span, message: &str| Err(SegmentError::new(message).at_line(line(text, &span)));
        let beyond = match &self.more_datagrams {
            None => Beyond::Unprocessed,
            Some(name) => match name.get_ref().as_str() {
                "unprocessed" => Beyond::Unprocessed,
                "dropped" => Beyond::Dropped,
                other => {
                    let message = format!("more_datagrams: expected \"unprocessed\" or \"dropped\", got \"{other}\"");
                    return wrong(name.span(), &message);
                }
            },
        };
        match (&self.max_datagrams, &self.more_datagrams) {
            (Some(most), _) if *most.get_ref() == 0 => wrong(most.span(), "max_datagrams: expected 1 or more, got 0"),
            (Some(most), _) => Ok(Some(DatagramLimit { datagrams: *most.get_ref(), beyond })),
            (None, Some(more)) => wrong(more.span(), "more_datagrams: expected max_datagrams beside it"),
            (None, None) => Ok(None),
        }
    }
}

/// A time given as a number of units; `unit` is the unit in seconds.
pub(super) fn duration(value: &Spanned<f64>, key: &str, unit: f64) -> Result<Duration, SegmentError> {
    let given = *value.get_ref();
    Duration::try_from_secs_f64(given * unit)
        .map_err(|_| SegmentError::new(format!("{key}: expected a time, not negative, got {given}")))
}

/// Number of the line, from 1, of the beginning of a span.
pub(super) fn line(text: &str, span: &Range<usize>) -> usize {
    let before = &text.as_bytes()[..span.start.min(text.len())];
    1 + before.iter().filter(|byte| **byte == b'\n').count()
}

/// Name of the device whose table contains an offset of the text, for a file that cannot be parsed as a whole.
fn device_around(text: &str, offset: usize) -> Option<String> {
    let offset = (0..=offset.min(text.len())).rev().find(|offset| text.is_char_boundary(*offset))?;
    // The error may be in the header itself.
    let line_end = text[offset..].find('\n').map_or(text.len(), |end| offset + end);
    let start = text[..line_end].rfind("[[device]]")?;
    let rest = &text[start..];
    let end = rest[2..].find("\n[").map_or(rest.len(), |end| end + 2);
    if start + end < offset {
        return None;
    }
    let number = text[..start].matches("[[device]]").count() + 1;
    let named = rest[..end].parse::<Table>().ok().and_then(|table| {
        let entry = table.get("device")?.as_array()?.first()?.as_table()?.clone();
        Some(entry.get("name").or(entry.get("type"))?.as_str()?.to_owned())
    });
    Some(named.unwrap_or_else(|| format!("number {number}")))
}

/// The message of the TOML reader in one line and without names of Rust types.
fn describe(message: &str) -> String {
    const TYPES: [&str; 12] = ["usize", "u8", "u16", "u32", "u64", "isize", "i8", "i16", "i32", "i64", "f32", "f64"];
    let words = message.split('\n').map(|line| {
        let words = line.split(' ').map(|word| if TYPES.contains(&word) { "a number of its range" } else { word });
        words.collect::<Vec<_>>().join(" ")
    });
    words.collect::<Vec<_>>().join(", ")
}

/// The line with the most points: that of a key of too many parts.
fn line_of_longest_key(text: &str) -> usize {
    let longest = (1..).zip(text.lines()).max_by_key(|(_, line)| line.matches('.').count());
    longest.map_or(1, |(number, _)| number)
}

pub(super) type Place = Option<core::ops::Range<usize>>;
