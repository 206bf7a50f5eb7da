//! Fields of an image that have no place in a description: an image that a tool makes from the description does not
//! have them.

use std::collections::{BTreeMap, BTreeSet};

use ringcat_wire::sii::{Pdo, PdoDirection, Sii};

use crate::esi::sii::build::build;
use crate::esi::sii::compare::{FieldDifference, compare};
use crate::esi::sii::fields::ORDER_OF_STRINGS;
use crate::esi::sii::profile::{SiiOptions, SiiProfile};
use crate::esi::{Esi, EsiError, read};

/// Categories that the elements of a description give.
pub(super) const GENERATED: [u16; 8] = [10, 30, 40, 41, 43, 50, 51, 60];
/// Fields that a tool decides, or that have a notice of their own.
const ASIDE: [&str; 7] = [
    ORDER_OF_STRINGS,
    "padding of the strings",
    "behind the end marker",
    "categories",
    "checksum",
    "mailboxes",
    "mailbox protocols",
];
/// Fields that are listed; further ones are counted.
const LISTED: usize = 20;

/// A notice for each field that is lost.
pub(super) fn notices(image: &[u8], sii: &Sii<'_>, text: &str) -> Vec<String> {
    let mut notices = samples(sii);
    notices.extend(repeated(sii));
    let lost = match read("description", text.as_bytes()).and_then(|esi| lost(image, &esi)) {
        Ok(lost) => lost,
        // For example, PDOs can lie beyond the size that the image states.
        Err(error) => {
            notices.push(format!("no image can be made of the description: {error}"));
            return notices;
        }
    };
    let strings = lost.iter().any(|it| it.field.starts_with("string "));
    let named: Vec<_> = lost.iter().filter(|it| !(strings && it.field == "number of strings")).map(notice).collect();
    let more = named.len().saturating_sub(LISTED);
    notices.extend(named.into_iter().take(LISTED));
    if more > 0 {
        notices.push(format!("{more} further fields have no place in a description"));
    }
    notices
}

/// The fields that no tool gives back from the description.
fn lost(image: &[u8], esi: &Esi) -> Result<Vec<FieldDifference>, EsiError> {
    let mut lost: Option<Vec<FieldDifference>> = None;
    let mut refused = None;
    for device in &esi.devices {
        for profile in SiiProfile::ALL {
            let options = SiiOptions { sync1_factor: true, ..SiiOptions::of(profile, 1033) };
            let built = match build(esi, device, &options) {
                Ok(built) => built,
                Err(error) => {
                    refused = Some(error);
                    continue;
                }
            };
            let found = compare(image, &built.bytes).differences;
            lost = Some(match lost {
                None => found.into_iter().filter(is_of_image).collect(),
                Some(known) => {
                    let found: BTreeSet<&str> = found.iter().map(|it| it.field.as_str()).collect();
                    known.into_iter().filter(|it| found.contains(it.field.as_str())).collect()
                }
            });
        }
    }
    match (lost, refused) {
        (Some(lost), _) => Ok(lost),
        (None, Some(error)) => Err(error),
        (None, None) => Ok(Vec::new()),
    }
}

/// Whether it is a field of the image that a description could have.
fn is_of_image(difference: &FieldDifference) -> bool {
    let FieldDifference { field, expected, is_individual, .. } = difference;
    // Bytes after the last used FMMU may be padding.
    let is_no_fmmu = field.starts_with("fmmu ") && ["0x00", "0xff"].contains(&expected.as_str());
    !is_individual && !expected.is_empty() && !is_no_fmmu && !ASIDE.contains(&field.as_str())
}

fn notice(lost: &FieldDifference) -> String {
    let FieldDifference { field, expected, got, .. } = lost;
    if field.starts_with("string ") {
        return format!("{field}: nothing refers to it, so it has no place in a description");
    }
    let got = if got.is_empty() { "none" } else { got };
    format!("{field}: {expected} has no place in a description; an image made of it has {got}")
}

/// An image says that a PDO has several samples, not how many.
fn samples(sii: &Sii<'_>) -> Vec<String> {
    let pdos = [PdoDirection::Rx, PdoDirection::Tx].into_iter().flat_map(|direction| sii.pdos(direction));
    let of = |pdo: Pdo<'_>| {
        format!("PDO {:#06x} has several samples: OSFac is 1, the image does not have the factor", pdo.index)
    };
    pdos.filter(|pdo| pdo.flags & Pdo::OVERSAMPLING != 0).take(LISTED).map(of).collect()
}

/// Categories of the vendor that occur more than once.
fn repeated(sii: &Sii<'_>) -> Vec<String> {
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    for code in sii.categories().map(|it| it.kind.code()).filter(|code| !GENERATED.contains(code)) {
        *counts.entry(code).or_default() += 1;
    }
    let repeated = counts.into_iter().filter(|(_, count)| *count > 1).take(LISTED);
    repeated
        .map(|(code, count)| {
            format!("category {code} occurs {count} times: the description gives back only the last one")
        })
        .collect()
}
