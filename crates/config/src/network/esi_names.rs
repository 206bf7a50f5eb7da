//! Names and types of PDOs and entries of a SubDevice from a description, where the file has none: the EEPROM of a
//! device whose PDOs are in its dictionary only, or of a small one, has no texts (protocol ES-47, ES-72, ES-73).

use super::from_esi::printable;
use super::model::{Entry, Pdo, SubDevice};
use crate::esi::sii::name_of;
use crate::esi::{self, Device, Dictionary, Object, PartsRoom, PlacedModule, parts};

impl SubDevice {
    /// Fills in the names and types of PDOs and entries that it does not have, in `language`, an LcId: those of the PDO
    /// in the description or in a module, else those of the object in its dictionary. `modules` are those in the slots
    /// of the device ([`esi::detected_modules`]). A PDO with the entries of a description that fixes them is fixed.
    /// Returns how many names were filled in.
    pub fn name_from_esi(&mut self, device: &Device, modules: &[PlacedModule<'_>], language: u32) -> usize {
        let of_modules: Vec<(esi::Pdo, String)> = modules.iter().flat_map(|placed| pdos_of(placed, language)).collect();
        let mut named = 0;
        for pdo in self.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo) {
            let of_module = of_modules.iter().find(|(it, _)| it.index.index == pdo.index);
            let of_device = device.rx_pdos.iter().chain(&device.tx_pdos).find(|it| it.index.index == pdo.index);
            let (described, name) = match of_module {
                Some((described, name)) => (Some(described), Some(name.as_str())),
                None => (of_device, of_device.map(|described| described.name.in_language(language))),
            };
            named += usize::from(fill(&mut pdo.name, name));
            pdo.fixed |= described.is_some_and(|described| described.is_fixed && is_mapped_so(described, pdo));
            for entry in pdo.entries.iter_mut().flatten().filter(|entry| entry.index != 0) {
                named += usize::from(of_entry(entry, described, (device, modules), language));
            }
        }
        named
    }
}

/// Whether a PDO of a file has the entries of the description.
fn is_mapped_so(described: &esi::Pdo, pdo: &Pdo) -> bool {
    let of_esi = described.entries.iter().filter(|it| it.bit_length > 0);
    let of_esi = of_esi.map(|it| (it.index.index, if it.index.index == 0 { 0 } else { it.sub_index }, it.bit_length));
    let of_file = pdo.entries.iter().flatten().map(|it| (it.index, it.sub, u16::from(it.bits)));
    pdo.entries.is_some() && of_esi.eq(of_file)
}

/// The PDOs of a module in its slot, with their names.
fn pdos_of(placed: &PlacedModule<'_>, language: u32) -> Vec<(esi::Pdo, String)> {
    let pdos = [&placed.module.rx_pdos, &placed.module.tx_pdos].into_iter();
    let shifted = pdos.flat_map(|pdos| placed.pdos(pdos).unwrap_or_default());
    let named = |pdo: esi::Pdo| {
        let name = placed.pdo_name(&pdo, language);
        (pdo, name)
    };
    shifted.map(named).collect()
}

/// Sets a text that is empty; whether it is one now.
fn fill(text: &mut String, name: Option<&str>) -> bool {
    if !text.is_empty() {
        return false;
    }
    *text = name.map(printable).unwrap_or_default();
    !text.is_empty()
}

fn of_entry(
    entry: &mut Entry,
    pdo: Option<&esi::Pdo>,
    (device, modules): (&Device, &[PlacedModule<'_>]),
    language: u32,
) -> bool {
    let same = |it: &&esi::PdoEntry| {
        (it.index.index, it.sub_index, it.bit_length) == (entry.index, entry.sub, u16::from(entry.bits))
    };
    let described = pdo.and_then(|pdo| pdo.entries.iter().find(same));
    let mut is_named = fill(&mut entry.name, described.map(|it| it.name.in_language(language)));
    fill(&mut entry.data_type, described.map(|it| it.data_type.as_str()));
    if !entry.name.is_empty() && !entry.data_type.is_empty() {
        return is_named;
    }
    if let Some((name, data_type)) = of_object(device, modules, entry, language) {
        is_named |= fill(&mut entry.name, Some(&name));
        fill(&mut entry.data_type, Some(&data_type));
    }
    is_named
}

/// Name and type of the object that an entry maps, if it has as many bits: of the device, else of a module.
fn of_object(device: &Device, modules: &[PlacedModule<'_>], entry: &Entry, language: u32) -> Option<(String, String)> {
    let mut dictionaries = device.profiles.iter().filter_map(|profile| profile.dictionary.as_deref());
    let of_device = dictionaries.find_map(|dictionary| {
        let object = dictionary.objects.iter().find(|object| object.index.index == entry.index)?;
        of_part(dictionary, object, entry, language)
    });
    of_device.or_else(|| {
        modules.iter().find_map(|placed| {
            let mut dictionaries = placed.module.profiles.iter().filter_map(|profile| profile.dictionary.as_deref());
            dictionaries.find_map(|dictionary| {
                let is_it = |object: &&Object| placed.index(object.index) == Some(entry.index);
                of_part(dictionary, dictionary.objects.iter().find(is_it)?, entry, language)
            })
        })
    })
}

fn of_part(dictionary: &Dictionary, object: &Object, entry: &Entry, language: u32) -> Option<(String, String)> {
    let parts = parts(dictionary, object, &mut PartsRoom::default()).ok()?;
    let part = parts.iter().find(|part| part.sub_index == entry.sub && part.bit_size == u32::from(entry.bits))?;
    let name = if parts.len() == 1 { object.name.in_language(language) } else { &part.name };
    Some((name.to_owned(), name_of(part.data_type)))
}
