//! Objects of a device and its modules, by index and subindex.

use super::work::Work;
use crate::esi::model::{Dictionary, Object, Profile};
use crate::esi::values::{Part, PartsRoom, parts};

/// An object's part with the line of the object.
pub(super) struct Found {
    pub part: Part,
    pub object: String,
    pub line: u32,
    pub file: String,
}

impl Work<'_> {
    /// Whether the description has objects at all.
    pub(super) fn has_objects(&self) -> bool {
        let own = self.device.profiles.iter();
        let all = own.chain(self.modules.iter().flat_map(|placed| &placed.module.profiles));
        dictionaries(all).any(|dictionary| !dictionary.objects.is_empty())
    }

    /// A subindex of an object; `None` if the description does not have it.
    pub(super) fn find(&self, index: u16, sub_index: u8) -> Option<Found> {
        for placed in &self.modules {
            for dictionary in dictionaries(placed.module.profiles.iter()) {
                for object in &dictionary.objects {
                    if placed.index(object.index) == Some(index)
                        && let Some(found) = part_of(dictionary, object, sub_index, &placed.module.file)
                    {
                        return Some(found);
                    }
                }
            }
        }
        for dictionary in dictionaries(self.device.profiles.iter()) {
            let object = dictionary.objects.iter().find(|object| object.index.index == index);
            if let Some(found) = object.and_then(|object| part_of(dictionary, object, sub_index, &self.esi.file)) {
                return Some(found);
            }
        }
        None
    }
}

fn dictionaries<'a>(profiles: impl Iterator<Item = &'a Profile>) -> impl Iterator<Item = &'a Dictionary> {
    profiles.filter_map(|profile| profile.dictionary.as_deref())
}

fn part_of(dictionary: &Dictionary, object: &Object, sub_index: u8, file: &str) -> Option<Found> {
    let parts = parts(dictionary, object, &mut PartsRoom::default()).ok()?;
    let part = parts.into_iter().find(|part| part.sub_index == sub_index)?;
    Some(Found { part, object: object.name.english().trim().to_owned(), line: object.line, file: file.to_owned() })
}
