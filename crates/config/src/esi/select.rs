//! A device of a description with choices, checked against the rules of the description: modules, operation mode, PDOs,
//! entries, start-up values (protocol ES-32, ES-40 to ES-71).
//!
//! Input: a description and [`Choices`]. Output: a [`Selection`], or an error with file, line and device.

mod assignment;
mod candidates;
mod commands;
mod dictionary;
mod mapping;
mod work;

use super::choices::Choices;
use super::error::EsiError;
use super::model::{Device, Esi, OpMode};
use super::modules::{PlacedModule, place_modules};
use super::selection::Selection;
use work::Work;

/// Chooses the contents of a device.
///
/// # Errors
/// [`EsiError`] with file, line and device: modules that do not fit, an unknown operation mode, PDOs that cannot be
/// assigned as chosen, entries that cannot be mapped, values that an object does not take.
pub fn select<'a>(esi: &'a Esi, device: &'a Device, choices: &'a Choices) -> Result<Selection<'a>, EsiError> {
    let rule = |line, reason: String| EsiError::rule(&esi.file, line, device.kind.trim(), reason);
    if device.is_invisible {
        return Err(rule(device.line, "it has no controller (Invisible): it is no SubDevice of a network".to_owned()));
    }
    let modules = place_modules(esi, device, &choices.modules)?;
    let mode = mode(esi, device, choices.mode.as_deref(), &modules)?;
    let mut work = Work { esi, device, choices, modules, mode, notices: Vec::new() };
    for other in &device.subdevices {
        let product = other.identity.product_code.unwrap_or(device.product_code);
        let text = format!("its housing has a further SubDevice, product code {product:#010x}: declare it, too");
        work.note(device.line, text);
    }
    for other in &device.alternatives {
        let revision = other.revision.map_or(String::new(), |revision| format!(" revision {revision:#010x}"));
        work.note(device.line, format!("AlternativeType{revision}: declare it by its own description"));
    }
    let sync_managers = assignment::sync_managers(&mut work)?;
    let commands = commands::commands(&mut work)?;
    let Work { modules, mode, notices, .. } = work;
    Ok(Selection { esi, device, modules, mode, sync_managers, commands, notices })
}

/// The operation mode: the one that was chosen, that of the modules, the first.
fn mode<'a>(
    esi: &Esi,
    device: &'a Device,
    wanted: Option<&str>,
    modules: &[PlacedModule<'_>],
) -> Result<Option<&'a OpMode>, EsiError> {
    let rule = |line, reason: String| EsiError::rule(&esi.file, line, device.kind.trim(), reason);
    let modes = device.clock.as_ref().map(|clock| &clock.modes[..]).unwrap_or_default();
    let line = device.clock.as_ref().map_or(device.line, |clock| clock.line);
    if let Some(wanted) = wanted {
        return chosen(modes, wanted).map(Some).map_err(|reason| rule(line, reason));
    }
    let of_modules = modules.iter().filter_map(|placed| Some((placed, placed.module.op_mode.as_deref()?)));
    let mut of_modules = of_modules.filter(|(_, name)| !name.is_empty());
    let Some((first, name)) = of_modules.next() else { return Ok(modes.first()) };
    if let Some((other, differs)) = of_modules.find(|(_, other)| *other != name) {
        let (slots, kinds) = ((first.slot, other.slot), (name.escape_debug(), differs.escape_debug()));
        let reason = format!(
            "slot {} needs the operation mode \"{}\", slot {} \"{}\": choose one",
            slots.0, kinds.0, slots.1, kinds.1
        );
        return Err(rule(line, reason));
    }
    let found = modes.iter().find(|mode| mode.name.trim() == name.trim());
    let found = found.ok_or_else(|| rule(line, no_mode(modes, name)))?;
    Ok(Some(found))
}

/// The mode with this name, else with this description, else with this number as in "#3". In real files several modes
/// may have the same name.
fn chosen<'a>(modes: &'a [OpMode], wanted: &str) -> Result<&'a OpMode, String> {
    let of = |text: fn(&OpMode) -> &str| -> Vec<(usize, &'a OpMode)> {
        (1..).zip(modes).filter(|(_, mode)| text(mode).trim() == wanted.trim()).collect()
    };
    let number = wanted.trim().strip_prefix('#').and_then(|number| number.parse::<usize>().ok());
    let lists = [of(|mode| &mode.name), of(|mode| &mode.description)];
    match lists.iter().find(|list| !list.is_empty()).map(|list| &list[..]) {
        Some([(_, mode)]) => Ok(mode),
        Some(several) => Err(format!(
            "several operation modes are \"{}\": choose one by its description or its number: {}",
            wanted.trim().escape_debug(),
            listed(several)
        )),
        None => number.and_then(|number| modes.get(number.checked_sub(1)?)).ok_or_else(|| no_mode(modes, wanted)),
    }
}

fn no_mode(modes: &[OpMode], wanted: &str) -> String {
    let all: Vec<(usize, &OpMode)> = (1..).zip(modes).collect();
    let known = if all.is_empty() { "it has none".to_owned() } else { format!("expected {}", listed(&all)) };
    format!("there is no operation mode \"{}\": {known}", wanted.escape_debug())
}

/// Number, name and description of each.
fn listed(modes: &[(usize, &OpMode)]) -> String {
    let shown = |(number, mode): &(usize, &OpMode)| {
        let (name, description) = (mode.name.trim().escape_debug(), mode.description.trim());
        let description =
            if description.is_empty() { String::new() } else { format!(" ({})", description.escape_debug()) };
        format!("#{number} \"{name}\"{description}")
    };
    modes.iter().map(shown).collect::<Vec<_>>().join(", ")
}
