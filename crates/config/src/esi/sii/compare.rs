//! Comparison of two images, field by field.

use std::collections::BTreeMap;

use super::build::build;
use super::fields::{Field, ORDER_OF_STRINGS, fields};
use super::profile::{SiiOptions, SiiProfile};
use crate::esi::error::EsiError;
use crate::esi::model::{Device, Esi};

/// A field that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldDifference {
    /// The field.
    pub field: String,
    /// Value in the first image; empty if the field is missing there.
    pub expected: String,
    /// Value in the second image; empty if the field is missing there.
    pub got: String,
    /// The field is written in production or at commissioning: alias, serial number, production data.
    pub is_individual: bool,
}

/// How alike two images are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Likeness {
    /// All bytes are equal.
    Identical,
    /// Only fields that are individual differ.
    Individual,
    /// Other fields differ.
    Different,
}

/// The result of a comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Comparison {
    /// How alike they are.
    pub likeness: Likeness,
    /// The fields that differ, in the order of the first image.
    pub differences: Vec<FieldDifference>,
}

/// Compares two images.
pub fn compare(expected: &[u8], got: &[u8]) -> Comparison {
    if expected == got {
        return Comparison { likeness: Likeness::Identical, differences: Vec::new() };
    }
    let (first, second) = (fields(expected), fields(got));
    let by_name: BTreeMap<&str, &Field> = second.iter().map(|field| (field.name.as_str(), field)).collect();
    let known: BTreeMap<&str, &Field> = first.iter().map(|field| (field.name.as_str(), field)).collect();
    let mut differences = Vec::new();
    for field in &first {
        let got = by_name.get(field.name.as_str());
        if got.is_none_or(|got| got.value != field.value) {
            differences.push(FieldDifference {
                field: field.name.clone(),
                expected: field.value.clone(),
                got: got.map(|got| got.value.clone()).unwrap_or_default(),
                is_individual: field.is_individual,
            });
        }
    }
    for field in second.iter().filter(|field| !known.contains_key(field.name.as_str())) {
        differences.push(FieldDifference {
            field: field.name.clone(),
            expected: String::new(),
            got: field.value.clone(),
            is_individual: field.is_individual,
        });
    }
    if differences.iter().any(|it| it.field.starts_with("string ")) {
        differences.retain(|it| it.field != ORDER_OF_STRINGS);
    }
    if differences.is_empty() {
        // Long values are shortened.
        let at = expected.iter().zip(got).position(|(a, b)| a != b).unwrap_or(expected.len().min(got.len()));
        let field = format!("byte {at:#06x}");
        let byte = |of: &[u8]| of.get(at).map(|byte| format!("{byte:#04x}")).unwrap_or_default();
        let (expected, got) = (byte(expected), byte(got));
        differences.push(FieldDifference { field, expected, got, is_individual: false });
    }
    // The checksum follows from the alias.
    let alias = differences.iter().any(|difference| difference.field == "alias");
    let is_individual =
        |difference: &FieldDifference| difference.is_individual || alias && difference.field == "checksum";
    let individual = differences.iter().all(is_individual);
    Comparison { likeness: if individual { Likeness::Individual } else { Likeness::Different }, differences }
}

/// The comparison with the fewest differences among all profiles and all languages of a description, with its options.
///
/// # Errors
/// The errors of [`build`], if no profile has an image.
pub fn most_alike(esi: &Esi, device: &Device, image: &[u8]) -> Result<(SiiOptions, Comparison), EsiError> {
    let mut languages: Vec<u32> = device.name.all().iter().map(|(id, _)| *id).collect();
    languages.extend(esi.group_of(device).into_iter().flat_map(|group| group.name.all()).map(|(id, _)| *id));
    languages.push(1033);
    languages.sort_unstable();
    languages.dedup();
    let mut best: Option<(SiiOptions, Comparison)> = None;
    let mut refused = None;
    for (profile, language) in
        SiiProfile::ALL.iter().flat_map(|profile| languages.iter().map(move |id| (*profile, *id)))
    {
        for without_pdos in [false, true] {
            let options = SiiOptions { without_pdos, ..SiiOptions::of(profile, language) };
            match build(esi, device, &options) {
                Ok(built) => {
                    let found = compare(image, &built.bytes);
                    let rank = |of: &Comparison| (of.likeness, of.differences.len());
                    if best.as_ref().is_none_or(|(_, known)| rank(&found) < rank(known)) {
                        best = Some((options, found));
                    }
                }
                Err(error) => refused = Some(error),
            }
        }
    }
    match (best, refused) {
        (Some(best), _) => Ok(best),
        (None, Some(error)) => Err(error),
        (None, None) => Err(EsiError::rule(&esi.file, device.line, &device.kind, "no image can be built")),
    }
}
