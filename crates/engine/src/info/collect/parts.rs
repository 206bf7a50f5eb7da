//! The categories that were read from an SII, and warnings with their offset.

use alloc::vec::Vec;

use ringcat_wire::sii::{Category, CategoryKind};

use crate::info::warning::{InfoWarning, SiiProblem};

/// Number of erased bytes at the end of a category that is more than padding.
const ERASED: usize = 4;

/// The categories that were read.
pub(super) struct Parts<'p, 'a> {
    pub(super) parts: &'p [Category<'a>],
}

impl<'a> Parts<'_, 'a> {
    pub(super) fn all(&self, kind: CategoryKind) -> impl Iterator<Item = Category<'a>> {
        self.parts.iter().filter(move |part| part.kind == kind).copied()
    }

    /// The first category of a kind; more than one is a fault.
    pub(super) fn first(&self, kind: CategoryKind, warnings: &mut Vec<InfoWarning>) -> Option<Category<'a>> {
        let mut all = self.all(kind);
        let first = all.next();
        if let Some(again) = all.next() {
            warnings.push(InfoWarning {
                category: Some(kind),
                offset: Some(again.offset),
                problem: SiiProblem::Repeated,
            });
        }
        first
    }

    /// Categories with an erased end: a truncated image in an otherwise empty EEPROM ends like this.
    pub(super) fn erased(&self) -> impl Iterator<Item = InfoWarning> {
        let has_text = |kind| {
            matches!(kind, CategoryKind::Strings | CategoryKind::General | CategoryKind::SyncManager | CategoryKind::Dc)
                || matches!(kind, CategoryKind::TxPdo | CategoryKind::RxPdo)
        };
        self.parts.iter().filter(move |part| has_text(part.kind)).filter_map(|part| {
            let kept = part.data.iter().rposition(|byte| *byte != 0xFF).map_or(0, |last| last + 1);
            let bytes = part.data.len() - kept;
            let offset = Some(part.data_offset() + kept);
            let problem = SiiProblem::Erased { bytes };
            (bytes >= ERASED).then_some(InfoWarning { category: Some(part.kind), offset, problem })
        })
    }
}

pub(super) fn fixed_area(offset: usize, problem: SiiProblem) -> InfoWarning {
    InfoWarning { category: None, offset: Some(offset), problem }
}

/// A warning about a fault at a byte of a category's data.
pub(super) fn within(category: &Category<'_>, at: usize, problem: SiiProblem) -> InfoWarning {
    InfoWarning { category: Some(category.kind), offset: Some(category.data_offset() + at), problem }
}

/// Warns about a category that does not end with a whole entry. Padding to a word is not an entry.
pub(super) fn whole(category: &Category<'_>, entry: usize, warnings: &mut Vec<InfoWarning>) {
    let data = category.data;
    let got = data.len() % entry;
    let offset = data.len() - got;
    if data[offset..].iter().any(|byte| *byte != 0 && *byte != 0xFF) {
        warnings.push(within(category, offset, SiiProblem::Short { expected: entry, got }));
    }
}
