//! Modules in the slots of a device, and the indices of what they add (protocol ES-64 to ES-71).

use ringcat_wire::mailbox::coe::pdo_objects::is_mapping;

use super::error::EsiError;
use super::model::{CoeCommand, Device, Esi, Module, Object, Pdo, Slot, SlotDistances, SlotIndex, Slots};
use crate::xml::shown;

/// Slots of a device, at most: subindices of 0xF030.
pub(super) const MAX_SLOTS: usize = 255;

/// A module in a slot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedModule<'a> {
    /// Number of the slot, from 0.
    pub slot: u16,
    /// The slot's definition.
    pub definition: &'a Slot,
    /// The module.
    pub module: &'a Module,
    distances: SlotDistances,
}

/// The modules of a device: the choice for each slot in order, `None` for its preset, an empty text or `-` for none;
/// slots without a choice have their preset. A module is named by its type, or by its ident as a number.
///
/// # Errors
/// [`EsiError`]: a device without slots, modules that are unknown or do not fit, an empty slot that has to be filled.
pub fn place_modules<'a>(
    esi: &'a Esi,
    device: &'a Device,
    choices: &[Option<String>],
) -> Result<Vec<PlacedModule<'a>>, EsiError> {
    let rule = |line, reason: String| EsiError::rule(&esi.file, line, device.kind.trim(), reason);
    let Some(slots) = &device.slots else {
        return match choices.is_empty() {
            true => Ok(Vec::new()),
            false => Err(rule(device.line, "it has no slots for modules".to_owned())),
        };
    };
    let definitions: Vec<(&Slot, u16)> = definitions(slots).collect();
    if choices.len() > definitions.len() {
        let reason = format!("{} modules for {} slots", choices.len(), definitions.len());
        return Err(rule(slots.line, reason));
    }
    let mut placed = Vec::new();
    for (number, (slot, instance)) in definitions.into_iter().enumerate() {
        let module =
            match choices.get(number).and_then(Option::as_deref).map(str::trim) {
                Some("" | "-") => None,
                Some(wanted) => Some(chosen(esi, slot, wanted).map_err(|reason| {
                    rule(slot.line, format!("slot {number} \"{}\": {reason}", slot.name.english()))
                })?),
                None => preset(esi, slot),
            };
        if let Some(module) = module {
            placed.push(PlacedModule::new(slots, number as u16, slot, module));
        } else if instance < slot.least {
            let reason = format!("slot {number} \"{}\" has to be filled: {}", slot.name.english(), allowed(esi, slot));
            return Err(rule(slot.line, reason));
        }
    }
    Ok(placed)
}

/// The slots of a device by number, each with its instance of the definition.
pub(super) fn definitions(slots: &Slots) -> impl Iterator<Item = (&Slot, u16)> {
    let most = slots.most.map_or(MAX_SLOTS, usize::from).min(MAX_SLOTS);
    slots.slots.iter().flat_map(|slot| (0..slot.most).map(move |instance| (slot, instance))).take(most)
}

/// The module that is the preset of a slot; the only one of a slot that has to be filled counts as one.
fn preset<'a>(esi: &'a Esi, slot: &Slot) -> Option<&'a Module> {
    let preset = slot.modules.iter().find(|module| module.is_default);
    let only = (slot.least > 0 && slot.modules.len() == 1 && slot.classes.is_empty()).then(|| slot.modules.first());
    let ident = preset.or(only.flatten())?.ident;
    esi.modules.iter().find(|module| module.ident == ident)
}

pub(super) fn fits(esi: &Esi, slot: &Slot, module: &Module) -> bool {
    let by_class = |class: &super::model::ModuleClass| {
        module.class.as_deref() == Some(class.class.as_str())
            && class.vendor_id.unwrap_or(esi.vendor.id) == module.vendor_id
    };
    slot.modules.iter().any(|allowed| allowed.ident == module.ident) || slot.classes.iter().any(by_class)
}

fn chosen<'a>(esi: &'a Esi, slot: &Slot, wanted: &str) -> Result<&'a Module, String> {
    let ident = super::number::number(wanted).and_then(|number| u32::try_from(number.value).ok());
    let is_wanted = |module: &&Module| module.kind.trim() == wanted || Some(module.ident) == ident;
    let mut found = esi.modules.iter().filter(is_wanted).peekable();
    if found.peek().is_none() {
        return Err(format!("there is no module {}: {}", shown(wanted), allowed(esi, slot)));
    }
    found
        .find(|module| fits(esi, slot, module))
        .ok_or_else(|| format!("module {} does not fit: {}", shown(wanted), allowed(esi, slot)))
}

/// The modules that fit a slot, in words.
fn allowed(esi: &Esi, slot: &Slot) -> String {
    /// Modules that are named.
    const NAMED: usize = 12;
    let fitting: Vec<String> =
        esi.modules.iter().filter(|module| fits(esi, slot, module)).map(|module| shown(module.kind.trim())).collect();
    match fitting.len() {
        0 => match &esi.missing[..] {
            [] => "no module of the file fits it".to_owned(),
            [gone, ..] => {
                format!("no module of the file fits it, and the file {} with modules is missing", shown(&gone.path))
            }
        },
        count if count > NAMED => {
            format!("expected {} or one of {} others", fitting[..NAMED].join(", "), count - NAMED)
        }
        _ => format!("expected {}", fitting.join(", ")),
    }
}

impl<'a> PlacedModule<'a> {
    pub(super) fn new(slots: &Slots, slot: u16, definition: &'a Slot, module: &'a Module) -> PlacedModule<'a> {
        let (own, all) = (definition.distances, slots.distances);
        let distances = SlotDistances {
            pdo: own.pdo.or(all.pdo),
            object: own.object.or(all.object),
            group_pdo: own.group_pdo.or(all.group_pdo),
            group_object: own.group_object.or(all.group_object),
        };
        PlacedModule { slot, definition, module, distances }
    }

    /// An index of the module in its slot; `None` above 0xFFFF.
    pub fn index(&self, of: SlotIndex) -> Option<u16> {
        let is_pdo = is_mapping(of.index);
        let distance =
            |pdo: Option<u16>, object: Option<u16>| u32::from(if is_pdo { pdo } else { object }.unwrap_or(0));
        let mut index = u32::from(of.index);
        // A gap stays a gap.
        if of.by_slot && of.index != 0 {
            index += u32::from(self.slot) * distance(self.distances.pdo, self.distances.object);
        }
        if of.by_group && of.index != 0 {
            let group = u32::from(self.definition.group.unwrap_or(0));
            index += group * distance(self.distances.group_pdo, self.distances.group_object);
        }
        u16::try_from(index).ok()
    }

    fn shifted(&self, line: u32, of: SlotIndex) -> Result<SlotIndex, EsiError> {
        let index = self.index(of).ok_or_else(|| {
            let reason = format!("index {:#06x} in slot {} is above 0xffff", of.index, self.slot);
            EsiError::rule(&self.module.file, line, self.module.kind.trim(), reason)
        })?;
        Ok(SlotIndex { index, by_slot: false, by_group: false })
    }

    /// PDOs as they are in this slot.
    ///
    /// # Errors
    /// An index above 0xFFFF.
    pub fn pdos(&self, pdos: &[Pdo]) -> Result<Vec<Pdo>, EsiError> {
        let shifted = |pdo: &Pdo| -> Result<Pdo, EsiError> {
            let mut pdo = pdo.clone();
            pdo.index = self.shifted(pdo.line, pdo.index)?;
            for exclude in &mut pdo.excludes {
                *exclude = self.shifted(pdo.line, *exclude)?;
            }
            for entry in &mut pdo.entries {
                entry.index = self.shifted(pdo.line, entry.index)?;
            }
            Ok(pdo)
        };
        pdos.iter().map(shifted).collect()
    }

    /// The name of one of its PDOs in a list of all PDOs of the device: that of the module before its own.
    pub fn pdo_name(&self, pdo: &Pdo, language: u32) -> String {
        let (module, own) = (self.module.kind.trim(), pdo.name.in_language(language).trim());
        if own.is_empty() { module.to_owned() } else { format!("{module}/{own}") }
    }

    /// Start-up commands as they are in this slot.
    ///
    /// # Errors
    /// An index above 0xFFFF.
    pub fn commands(&self) -> Result<Vec<CoeCommand>, EsiError> {
        let shifted = |command: &CoeCommand| -> Result<CoeCommand, EsiError> {
            Ok(CoeCommand { index: self.shifted(command.line, command.index)?, ..command.clone() })
        };
        self.module.commands.iter().map(shifted).collect()
    }

    /// An object as it is in this slot.
    ///
    /// # Errors
    /// An index above 0xFFFF.
    pub fn object(&self, object: &Object) -> Result<Object, EsiError> {
        Ok(Object { index: self.shifted(object.line, object.index)?, ..object.clone() })
    }
}
