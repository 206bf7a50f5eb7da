//! Names of the PDOs, entries and objects of a SubDevice, for messages: those of a file of the network, of the
//! SubDevice itself, of its description. The first source that names an object counts (`docs/sources.md`).

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use ringcat_engine::info::SubDeviceInfo;

use crate::eni;
use crate::esi::{Device, Dictionary, Module, Object, PartsRoom, Pdo, PlacedModule, parts};
#[cfg(feature = "network")]
use crate::network::model;

/// Names of a SubDevice at most; further ones are left out.
const MAX_NAMES: usize = 1 << 16;
/// Characters of a name; the rest is left out.
const MAX_NAME: usize = 256;
/// Words before an index without a subindex that is that of an object.
const BEFORE_INDEX: [&str; 2] = ["PDO ", "object "];
/// The word before the ident of a module.
const BEFORE_IDENT: &str = "module ";

/// Names of the PDOs, entries and objects of a SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectNames {
    objects: BTreeMap<u16, String>,
    entries: BTreeMap<(u16, u8), String>,
    modules: BTreeMap<u32, String>,
    shared: Option<Arc<ObjectNames>>,
}

impl ObjectNames {
    /// Sets the names that it shares with other SubDevices of the same kind; its own count before them.
    pub fn share(&mut self, names: Arc<ObjectNames>) {
        self.shared = Some(names);
    }

    /// Adds the names that a SubDevice has itself, in its EEPROM or its dictionary.
    pub fn add_found(&mut self, info: &SubDeviceInfo) {
        for pdo in &info.pdos {
            self.add_object(pdo.index, &pdo.name);
            for entry in &pdo.entries {
                self.add_entry(entry.index, entry.sub_index, &entry.name);
            }
        }
    }

    /// Adds the names of a network file.
    #[cfg(feature = "network")]
    pub fn add_declared(&mut self, subdevice: &model::SubDevice) {
        for pdo in subdevice.sync_manager.iter().flat_map(|sm| &sm.pdo) {
            self.add_object(pdo.index, &pdo.name);
            for entry in pdo.entries.iter().flatten() {
                self.add_entry(entry.index, entry.sub, &entry.name);
            }
        }
    }

    /// Adds the names of an ENI.
    pub fn add_eni(&mut self, subdevice: &eni::SubDevice) {
        for pdo in subdevice.process_data.iter().flat_map(|data| &data.pdos) {
            self.add_object(pdo.index, &pdo.name);
            for entry in &pdo.entries {
                self.add_entry(entry.index, entry.sub_index, &entry.name);
            }
        }
    }

    /// Adds the names of a description with the modules that are in its slots, in `language`, an LcId: those of PDOs
    /// and their entries, then those of the dictionaries. A part of an object is named `object: part`, a PDO of a
    /// module `module/PDO`.
    pub fn add_described(&mut self, device: &Device, modules: &[PlacedModule<'_>], language: u32) {
        for pdo in device.rx_pdos.iter().chain(&device.tx_pdos) {
            self.add_object(pdo.index.index, pdo.name.in_language(language));
            self.add_entries(pdo, language);
        }
        for placed in modules {
            for pdos in [&placed.module.rx_pdos, &placed.module.tx_pdos] {
                for pdo in placed.pdos(pdos).unwrap_or_default() {
                    self.add_object(pdo.index.index, &placed.pdo_name(&pdo, language));
                    self.add_entries(&pdo, language);
                }
            }
        }
        let room = &mut PartsRoom::default();
        for dictionary in device.profiles.iter().filter_map(|profile| profile.dictionary.as_deref()) {
            for object in &dictionary.objects {
                self.add_dictionary(dictionary, object, object.index.index, (language, room));
            }
        }
        for placed in modules {
            for dictionary in placed.module.profiles.iter().filter_map(|profile| profile.dictionary.as_deref()) {
                for object in &dictionary.objects {
                    if let Some(index) = placed.index(object.index) {
                        self.add_dictionary(dictionary, object, index, (language, room));
                    }
                }
            }
        }
    }

    /// Adds the types of the modules of a description, by their idents.
    pub fn add_modules(&mut self, modules: &[Module]) {
        for module in modules {
            if !self.is_full() {
                add(self.modules.entry(module.ident), &module.kind);
            }
        }
    }

    fn add_entries(&mut self, pdo: &Pdo, language: u32) {
        for entry in &pdo.entries {
            self.add_entry(entry.index.index, entry.sub_index, entry.name.in_language(language));
        }
    }

    fn add_dictionary(
        &mut self,
        dictionary: &Dictionary,
        object: &Object,
        index: u16,
        (language, room): (u32, &mut PartsRoom),
    ) {
        if self.is_full() {
            return;
        }
        let name = object.name.in_language(language);
        self.add_object(index, name);
        // Parts without room are left out like names above the limit.
        let Ok(parts) = parts(dictionary, object, room) else { return };
        if parts.len() == 1 {
            return;
        }
        for part in parts.iter().filter(|part| part.sub_index > 0) {
            self.add_entry(index, part.sub_index, &format!("{}: {}", name.trim(), part.name.trim()));
        }
    }

    fn is_full(&self) -> bool {
        self.objects.len() + self.entries.len() + self.modules.len() >= MAX_NAMES
    }

    fn add_object(&mut self, index: u16, name: &str) {
        if !self.is_full() {
            add(self.objects.entry(index), name);
        }
    }

    fn add_entry(&mut self, index: u16, sub_index: u8, name: &str) {
        // Index 0 is a gap.
        if index != 0 && !self.is_full() {
            add(self.entries.entry((index, sub_index)), name);
        }
    }

    /// The name of an object or a PDO.
    pub fn object(&self, index: u16) -> Option<&str> {
        let own = self.objects.get(&index).map(String::as_str);
        own.or_else(|| self.shared.as_ref().and_then(|shared| shared.object(index)))
    }

    /// The type of a module.
    pub fn module(&self, ident: u32) -> Option<&str> {
        let own = self.modules.get(&ident).map(String::as_str);
        own.or_else(|| self.shared.as_ref().and_then(|shared| shared.module(ident)))
    }

    /// The name of an entry, else that of its object.
    pub fn entry(&self, index: u16, sub_index: u8) -> Option<&str> {
        self.exact(index, sub_index).or_else(|| self.object(index))
    }

    fn exact(&self, index: u16, sub_index: u8) -> Option<&str> {
        let own = self.entries.get(&(index, sub_index)).map(String::as_str);
        own.or_else(|| self.shared.as_ref().and_then(|shared| shared.exact(index, sub_index)))
    }

    /// A message about the SubDevice, with the name appended to each object (`0x6060:00`, `PDO 0x1a00` or `object
    /// 0x6060`) and to each module (`module 0x0001a001`) that it mentions.
    pub fn annotate(&self, text: &str) -> String {
        let mut out = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(at) = rest.find("0x") {
            let (head, tail) = rest.split_at(at);
            out.push_str(head);
            let is_begin = !out.ends_with(is_word);
            if let Some((ident, length)) = module_ident(tail).filter(|_| out.ends_with(BEFORE_IDENT)) {
                out.push_str(&tail[..length]);
                rest = &tail[length..];
                quote(&mut out, self.module(ident).filter(|_| !rest.starts_with(" \"")));
                continue;
            }
            let Some((index, sub_index, length)) = mentioned(tail).filter(|_| is_begin) else {
                out.push_str("0x");
                rest = &tail[2..];
                continue;
            };
            let is_object = sub_index.is_some() || BEFORE_INDEX.iter().any(|word| out.ends_with(word));
            let name = match sub_index {
                Some(sub_index) => self.entry(index, sub_index),
                None => self.object(index),
            };
            out.push_str(&tail[..length]);
            rest = &tail[length..];
            quote(&mut out, name.filter(|_| is_object && !rest.starts_with(" \"")));
        }
        out.push_str(rest);
        out
    }
}

/// Sets a name that is not known yet.
fn add<K: Ord>(entry: Entry<'_, K, String>, name: &str) {
    let name: String = name.trim().chars().filter(|character| !character.is_control()).take(MAX_NAME).collect();
    if let Entry::Vacant(free) = entry
        && !name.is_empty()
    {
        free.insert(name);
    }
}

/// Appends a name in quotation marks.
fn quote(out: &mut String, name: Option<&str>) {
    if let Some(name) = name {
        out.push_str(" \"");
        out.extend(name.escape_debug());
        out.push('"');
    }
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == ':'
}

/// The ident of a module that a text begins with, and its length in it.
fn module_ident(text: &str) -> Option<(u32, usize)> {
    const LENGTH: usize = "0x12345678".len();
    let digits = text.get(2..LENGTH).filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
    let ends = !text[LENGTH..].starts_with(is_word);
    u32::from_str_radix(digits, 16).ok().filter(|_| ends).map(|ident| (ident, LENGTH))
}

/// Index and subindex that a text begins with, and their length in it.
fn mentioned(text: &str) -> Option<(u16, Option<u8>, usize)> {
    /// Length of an index, and of an index with a subindex.
    const LENGTHS: [usize; 2] = ["0x1234".len(), "0x1234:56".len()];
    let hexadecimal = |from: usize, to: usize| {
        let digits = text.get(from..to).filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
        u16::from_str_radix(digits, 16).ok()
    };
    let ends = |at: usize| !text[at..].starts_with(|next: char| next.is_alphanumeric());
    let index = hexadecimal(2, LENGTHS[0])?;
    let sub_index = hexadecimal(LENGTHS[0] + 1, LENGTHS[1]).filter(|_| text[LENGTHS[0]..].starts_with(':'));
    if let Some(sub_index) = sub_index.and_then(|sub_index| u8::try_from(sub_index).ok()).filter(|_| ends(LENGTHS[1])) {
        return Some((index, Some(sub_index), LENGTHS[1]));
    }
    (ends(LENGTHS[0]) && !text[LENGTHS[0]..].starts_with(':')).then_some((index, None, LENGTHS[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> ObjectNames {
        let mut names = ObjectNames::default();
        names.add_object(0x1A00, " AI Channel 1 ");
        names.add_object(0x1A00, "another source");
        names.add_entry(0x6000, 0x11, "Value");
        names.add_entry(0, 0, "a gap");
        names.add_object(0x6060, "Modes of \"operation\"\n");
        names.add_object(0x1000, "");
        names.modules.insert(0x1_A001, "csp axis".to_owned());
        names
    }

    // covers: esi-use
    #[test]
    fn objects_in_a_message_get_their_names_and_other_numbers_do_not() {
        let names = names();
        for (text, expected) in [
            ("PDO 0x1a00, entry 3", "PDO 0x1a00 \"AI Channel 1\", entry 3"),
            ("0x6000:11 of 16 bits", "0x6000:11 \"Value\" of 16 bits"),
            ("0x6060:00: aborted", "0x6060:00 \"Modes of \\\"operation\\\"\": aborted"),
            ("object 0x6060", "object 0x6060 \"Modes of \\\"operation\\\"\""),
            (
                "slot 1: expected module 0x0001a001, got module 0x0001a002",
                "slot 1: expected module 0x0001a001 \"csp axis\", got module 0x0001a002",
            ),
            ("0x1a00:01 maps 0x6000:11", "0x1a00:01 \"AI Channel 1\" maps 0x6000:11 \"Value\""),
        ] {
            assert_eq!(names.annotate(text), expected);
        }
        for text in [
            "",
            "0x",
            "PDO 0x",
            "mailbox 0x1a00 (128 bytes)",
            "vendor 0x00001a00",
            "PDO 0x1a00 \"AI Channel 1\"",
            "0x6000:11 \"Value\"",
            "0x6000:111",
            "0x1a00:0x0130",
            "PDO 0x1a001",
            "a0x6000:11",
            "object 0x1000",
            "module 0x0001a0011",
            "module 0x1a01",
            "slot 0x0001a001",
            "module 0x0001a001 \"csp axis\"",
            "PDO 0x1ä00",
            "0x6000:1ä",
        ] {
            assert_eq!(names.annotate(text), text);
        }
    }

    // covers: esi-use
    #[test]
    fn the_first_source_counts_and_a_gap_has_no_name() {
        let names = names();
        assert_eq!(names.object(0x1A00), Some("AI Channel 1"));
        assert_eq!((names.entry(0x6060, 0), names.entry(0, 0)), (Some("Modes of \"operation\""), None));
        assert_eq!((names.object(0x1000), names.entry(0x7000, 1)), (None, None));
        let mut own = ObjectNames::default();
        own.add_object(0x1A00, "its own");
        own.share(Arc::new(names));
        let entries = [(0x1A00, 1), (0x6000, 0x11), (0x6060, 0)].map(|(index, sub)| own.entry(index, sub));
        assert_eq!(entries, [Some("its own"), Some("Value"), Some("Modes of \"operation\"")]);
    }
}
