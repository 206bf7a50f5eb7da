//! Profiles of devices and modules.

use std::sync::Arc;

use super::dictionary::dictionary;
use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{Profile, Reference};

/// Profiles of a device or module.
pub(super) fn profiles(parent: Element<'_>) -> Result<Vec<Profile>, EsiError> {
    parent.children("Profile").map(profile).collect()
}

fn profile(element: Element<'_>) -> Result<Profile, EsiError> {
    let channel = |of: Element<'_>| -> Result<Option<(u32, Option<u32>)>, EsiError> {
        let additional = of.number_of("AddInfo")?;
        Ok(of.number_of("ProfileNo")?.map(|number| (number, additional)))
    };
    let mut channels = Vec::new();
    for of in std::iter::once(element).chain(element.children("ChannelInfo")) {
        channels.extend(channel(of)?);
    }
    let file = element.child("DictionaryFile");
    let file = file.map(|file| Reference { line: file.line(), path: file.raw().trim().to_owned() });
    Ok(Profile {
        channels,
        dictionary: element.child("Dictionary").map(dictionary).transpose()?.map(Arc::new),
        dictionary_file: file.filter(|file| !file.path.is_empty()),
    })
}
