//! Names and types of PDOs and entries of a SubDevice from a description, where the file has none: the EEPROM of a
//! device whose PDOs are in its dictionary only, or of a small one, has no texts (protocol ES-47, ES-72, ES-73).

use super::from_esi::printable;
use super::model::{Entry, SubDevice};
use crate::esi::sii::name_of;
use crate::esi::{self, Device, parts};

impl SubDevice {
    /// Fills in the names and types of PDOs and entries that it does not have, in `language`, an LcId: those of the PDO
    /// in the description, else those of the object in its dictionary. Returns how many names were filled in.
    pub fn name_from_esi(&mut self, device: &Device, language: u32) -> usize {
        let mut named = 0;
        for pdo in self.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo) {
            let described = device.rx_pdos.iter().chain(&device.tx_pdos).find(|it| it.index.index == pdo.index);
            let name = described.map(|described| described.name.in_language(language));
            named += usize::from(fill(&mut pdo.name, name));
            for entry in pdo.entries.iter_mut().flatten().filter(|entry| entry.index != 0) {
                named += usize::from(of_entry(entry, described, device, language));
            }
        }
        named
    }
}

/// Sets a text that is empty; whether it is one now.
fn fill(text: &mut String, name: Option<&str>) -> bool {
    if !text.is_empty() {
        return false;
    }
    *text = name.map(printable).unwrap_or_default();
    !text.is_empty()
}

fn of_entry(entry: &mut Entry, pdo: Option<&esi::Pdo>, device: &Device, language: u32) -> bool {
    let same = |it: &&esi::PdoEntry| {
        (it.index.index, it.sub_index, it.bit_length) == (entry.index, entry.sub, u16::from(entry.bits))
    };
    let described = pdo.and_then(|pdo| pdo.entries.iter().find(same));
    let mut is_named = fill(&mut entry.name, described.map(|it| it.name.in_language(language)));
    fill(&mut entry.data_type, described.map(|it| it.data_type.as_str()));
    if !entry.name.is_empty() && !entry.data_type.is_empty() {
        return is_named;
    }
    if let Some((name, data_type)) = of_object(device, entry, language) {
        is_named |= fill(&mut entry.name, Some(&name));
        fill(&mut entry.data_type, Some(&data_type));
    }
    is_named
}

/// Name and type of the object that an entry maps, if it has as many bits.
fn of_object(device: &Device, entry: &Entry, language: u32) -> Option<(String, String)> {
    let mut dictionaries = device.profiles.iter().filter_map(|profile| profile.dictionary.as_ref());
    dictionaries.find_map(|dictionary| {
        let object = dictionary.objects.iter().find(|object| object.index.index == entry.index)?;
        let parts = parts(dictionary, object);
        let part = parts.iter().find(|part| part.sub_index == entry.sub && part.bit_size == u32::from(entry.bits))?;
        let name = if parts.len() == 1 { object.name.in_language(language) } else { &part.name };
        Some((name.to_owned(), name_of(part.data_type)))
    })
}
