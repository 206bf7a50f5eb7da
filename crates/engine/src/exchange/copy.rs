//! Copies inputs of one SubDevice to outputs of another within a cycle (Master Redundancy 10.8): inputs received with
//! this cycle's frames leave with its next ones, independently of the application. Devices of functional safety
//! communicate this way.
//!
//! A copy is refused where its source is stale: the outputs keep the last copied value, or become zero. The table is
//! checked and split into words when it is set; afterwards a copy is bounded work without allocation.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;

use super::domain::Domain;
use super::entry::Entry;
use super::flight::CyclicFrame;
use super::image::InputNumber;
use crate::order::InOrder;

/// Value of the outputs while their source is stale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum WhenStale {
    /// The last copied value; zero before the first copy.
    #[default]
    Hold,
    /// Zero.
    Zero,
}

/// Inputs that are copied to outputs in every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CopyRule {
    /// The inputs: any bits of one area of a SubDevice.
    pub source: Entry,
    /// The outputs, of as many bits, in the same or another domain.
    pub target: Entry,
    /// Value of the outputs while the source is stale.
    pub when_stale: WhenStale,
    /// The source is stale when it is older than this many cycles; 0 means inputs received for this cycle.
    pub max_age: u64,
}

impl CopyRule {
    /// Sets [`CopyRule::max_age`].
    #[must_use]
    pub const fn with_max_age(mut self, max_age: u64) -> CopyRule {
        self.max_age = max_age;
        self
    }

    /// Sets [`CopyRule::when_stale`].
    #[must_use]
    pub const fn with_when_stale(mut self, when_stale: WhenStale) -> CopyRule {
        self.when_stale = when_stale;
        self
    }

    /// A copy that is refused where its source was not received for this cycle; the outputs hold their value then.
    pub const fn new(source: Entry, target: Entry) -> CopyRule {
        CopyRule { source, target, when_stale: WhenStale::Hold, max_age: 0 }
    }
}

/// A copy, by the place of its rule in the table, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CopyId(pub usize);

impl fmt::Display for CopyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Why a table of copies cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CopyError {
    /// The source does not lie in inputs of one SubDevice.
    Source {
        /// The rule.
        rule: CopyId,
    },
    /// The target does not lie in outputs.
    Target {
        /// The rule.
        rule: CopyId,
    },
    /// Source and target have different numbers of bits, or none.
    Length {
        /// The rule.
        rule: CopyId,
        /// Bits of the source.
        source: u16,
        /// Bits of the target.
        target: u16,
    },
    /// Two rules copy to the same bits.
    Overlap {
        /// The first rule.
        rule: CopyId,
        /// The second rule.
        with: CopyId,
    },
}

impl fmt::Display for CopyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CopyError::Source { rule } => write!(f, "copy {rule}: the source is not in inputs of one SubDevice"),
            CopyError::Target { rule } => write!(f, "copy {rule}: the target is not in outputs"),
            CopyError::Length { rule, source, target } => {
                write!(f, "copy {rule}: expected as many bits in source and target, got {source} and {target}")
            }
            CopyError::Overlap { rule, with } => write!(f, "copy {rule} writes to outputs of copy {with}"),
        }
    }
}

impl core::error::Error for CopyError {}

/// Inputs of one SubDevice, and the record of their arrival.
#[derive(Debug)]
struct Source {
    domain: usize,
    subdevice: usize,
    /// All its inputs.
    inputs: Box<[InputNumber]>,
    /// Age in cycles of the oldest of these, as of the current copying.
    age: u64,
}

/// At most 64 bits of a rule.
#[derive(Clone, Copy, Debug)]
struct Piece {
    rule: usize,
    source: usize,
    from: Entry,
    to: Entry,
    last: u64,
}

/// A table that was checked.
#[derive(Debug, Default)]
pub(super) struct Copies {
    rules: Box<[CopyRule]>,
    sources: Box<[Source]>,
    /// Ordered by the domain of the target.
    pieces: Box<[Piece]>,
    /// The pieces of each domain.
    by_domain: Box<[Range<usize>]>,
    /// Rules whose source was stale at the last copy.
    stale: Box<[bool]>,
}

impl Copies {
    pub(super) fn new(rules: &[CopyRule], domains: &[Domain], frames: &[CyclicFrame]) -> Result<Copies, CopyError> {
        let mut sources: Vec<Source> = Vec::new();
        let mut pieces: Vec<Piece> = Vec::new();
        for (number, rule) in rules.iter().enumerate() {
            let CopyRule { source, target, .. } = *rule;
            if source.bit_length != target.bit_length || source.bit_length == 0 {
                let (source, target) = (source.bit_length, target.bit_length);
                return Err(CopyError::Length { rule: CopyId(number), source, target });
            }
            let subdevice = of_inputs(&source, domains, frames).ok_or(CopyError::Source { rule: CopyId(number) })?;
            if !is_outputs(&target, domains, frames) {
                return Err(CopyError::Target { rule: CopyId(number) });
            }
            let known = sources.iter().position(|s| (s.domain, s.subdevice) == (source.domain.0, subdevice));
            let at = match known {
                Some(at) => at,
                None => {
                    let found = find(source.domain.0, subdevice, domains, frames);
                    sources.push(found.ok_or(CopyError::Source { rule: CopyId(number) })?);
                    sources.len() - 1
                }
            };
            pieces.extend(words(&source).zip(words(&target)).map(|(from, to)| Piece {
                rule: number,
                source: at,
                from,
                to,
                last: 0,
            }));
        }
        pieces.put_in_order_by_key(|piece| (piece.to.domain, piece.to.bit_offset));
        let overlap = pieces.windows(2).find(|pair| {
            let [first, second] = [pair[0].to, pair[1].to];
            first.domain == second.domain && first.bit_offset + u32::from(first.bit_length) > second.bit_offset
        });
        if let Some([first, second]) = overlap {
            return Err(CopyError::Overlap { rule: CopyId(second.rule), with: CopyId(first.rule) });
        }
        let range = |domain: usize| {
            let first = pieces.partition_point(|piece| piece.to.domain.0 < domain);
            first..pieces.partition_point(|piece| piece.to.domain.0 <= domain)
        };
        Ok(Copies {
            by_domain: (0..domains.len()).map(range).collect(),
            rules: rules.into(),
            sources: sources.into(),
            stale: rules.iter().map(|_| true).collect(),
            pieces: pieces.into(),
        })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Whether the source of a rule was stale at its last copy, or it was never copied.
    pub(super) fn is_stale(&self, rule: CopyId) -> bool {
        self.stale.get(rule.0).copied().unwrap_or(true)
    }

    /// Copies all rules with their target in a domain. Returns the number of words with a stale source.
    pub(super) fn run(&mut self, target: usize, domains: &mut [Domain], cycle: u64) -> u64 {
        let Some(range) = self.by_domain.get(target).cloned().filter(|range| !range.is_empty()) else { return 0 };
        for source in &mut self.sources {
            source.check(domains, cycle);
        }
        let mut refused = 0;
        for piece in &mut self.pieces[range] {
            let (rule, source) = (&self.rules[piece.rule], &self.sources[piece.source]);
            let stale = source.age > rule.max_age;
            self.stale[piece.rule] = stale;
            if !stale {
                piece.last = piece.from.read(domains[source.domain].image());
            }
            refused += u64::from(stale);
            let value = if stale && rule.when_stale == WhenStale::Zero { 0 } else { piece.last };
            piece.to.write(domains[target].image_mut(), value);
        }
        refused
    }
}

impl Source {
    fn check(&mut self, domains: &[Domain], cycle: u64) {
        let domain = &domains[self.domain];
        // Cycles are counted from 1; 0 is none.
        let oldest = self.inputs.iter().map(|input| domain.came(*input)).min().unwrap_or(0);
        self.age = if oldest == 0 { u64::MAX } else { (cycle + 1).saturating_sub(oldest) };
    }
}

fn find(domain: usize, subdevice: usize, domains: &[Domain], frames: &[CyclicFrame]) -> Option<Source> {
    let of = domains.get(domain)?;
    let mut inputs: Vec<InputNumber> = of.frames().flat_map(|frame| frames[frame].inputs_of(subdevice)).collect();
    // Each is there once per cycle that may be on the wire.
    inputs.put_in_order_by_key(|input| (input.datagram, input.part));
    inputs.dedup();
    Some(Source { domain, subdevice, inputs: inputs.into(), age: u64::MAX })
}

/// Bytes of an image that an entry covers.
fn bytes(entry: &Entry) -> Range<usize> {
    let end = entry.bit_offset as usize + usize::from(entry.bit_length);
    entry.byte_offset()..end.div_ceil(8)
}

/// The SubDevice with these inputs.
fn of_inputs(entry: &Entry, domains: &[Domain], frames: &[CyclicFrame]) -> Option<usize> {
    let domain = domains.get(entry.domain.0)?;
    domain.frames().find_map(|frame| frames[frame].whose_inputs(bytes(entry)))
}

fn is_outputs(entry: &Entry, domains: &[Domain], frames: &[CyclicFrame]) -> bool {
    let domain = domains.get(entry.domain.0);
    domain.is_some_and(|domain| domain.frames().any(|frame| frames[frame].has_outputs(bytes(entry))))
}

/// The words of an entry.
fn words(entry: &Entry) -> impl Iterator<Item = Entry> {
    let entry = *entry;
    (0..entry.bit_length).step_by(64).map(move |at| Entry {
        bit_offset: entry.bit_offset + u32::from(at),
        bit_length: (entry.bit_length - at).min(64),
        ..entry
    })
}

#[cfg(test)]
mod tests;
