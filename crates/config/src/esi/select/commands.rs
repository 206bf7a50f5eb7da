//! Start-up commands: modules, those of the description, parameters (protocol ES-55, ES-58, ES-59, ES-67, ES-70,
//! ES-125, ES-126).

use std::collections::HashSet;

use ringcat_wire::mailbox::coe::pdo_objects::is_of_pdos;

use super::work::Work;
use crate::esi::choices::Parameter;
use crate::esi::error::EsiError;
use crate::esi::model::{CoeCommand, RawCommand, SoeCommand, Transition};
use crate::esi::selection::{SelectedCommand, SelectedMessage};

/// The list of module idents (protocol ES-69).
const MODULE_IDENTS: u16 = 0xF030;
/// Start-up commands of all modules, at most.
const MAX_COMMANDS: usize = 1 << 16;

/// All commands: the list of modules, then, after the PDOs, those of the description and the parameters.
pub(super) fn commands(work: &mut Work<'_>) -> Result<Vec<SelectedCommand>, EsiError> {
    let mut commands = module_idents(work);
    let device = work.device;
    let mailbox = device.mailbox.as_ref();
    let mut objects: Vec<CoeCommand> = Vec::new();
    for placed in &work.modules {
        if objects.len() + placed.module.commands.len() > MAX_COMMANDS {
            let reason = format!("the modules bring more than {MAX_COMMANDS} start-up commands");
            return Err(work.error(device.line, reason));
        }
        objects.extend(placed.commands()?);
    }
    let own = mailbox.and_then(|mailbox| mailbox.coe.as_ref()).map(|coe| &coe.commands[..]).unwrap_or_default();
    let of_modules: HashSet<(u16, u8)> = objects.iter().map(|it| (it.index.index, it.sub_index)).collect();
    let is_replaced = |command: &CoeCommand| {
        command.overwritten_by_module && of_modules.contains(&(command.index.index, command.sub_index))
    };
    let own: Vec<CoeCommand> = own.iter().filter(|command| !is_replaced(command)).cloned().collect();
    for command in own.iter().chain(&objects) {
        let message =
            SelectedMessage::Sdo(command.index.index, command.sub_index, command.complete_access, command.data.clone());
        add(&mut commands, &command.transitions, message, &command.comment);
    }
    let soe = mailbox.and_then(|mailbox| mailbox.soe.as_ref()).map(|soe| &soe.1[..]).unwrap_or_default();
    for SoeCommand { transitions, channel, idn, data, comment, .. } in soe {
        add(&mut commands, transitions, SelectedMessage::Idn(*channel, *idn, data.clone()), comment);
    }
    let eoe = mailbox.and_then(|mailbox| mailbox.eoe.as_ref()).map(|eoe| &eoe.commands[..]).unwrap_or_default();
    for RawCommand { transitions, data, comment, .. } in eoe {
        add(&mut commands, transitions, SelectedMessage::Eoe(data.clone()), comment);
    }
    let aoe = mailbox.and_then(|mailbox| mailbox.aoe.as_ref()).map(|aoe| &aoe.commands[..]).unwrap_or_default();
    for RawCommand { transitions, data, comment, .. } in aoe {
        add(&mut commands, transitions, SelectedMessage::Aoe(data.clone()), comment);
    }
    for parameter in &work.choices.parameters {
        commands.push(parameter_command(work, parameter)?);
    }
    // If one of them writes PDOs, all are sent before: the engine then corrects the PDOs to what was chosen.
    let before_pdos =
        commands.iter().any(|it| matches!(it.message, SelectedMessage::Sdo(index, ..) if is_of_pdos(index)));
    commands.iter_mut().for_each(|command| command.before_pdos |= before_pdos);
    Ok(commands)
}

fn add(commands: &mut Vec<SelectedCommand>, transitions: &[Transition], message: SelectedMessage, comment: &str) {
    for transition in transitions {
        let (message, comment) = (message.clone(), comment.to_owned());
        commands.push(SelectedCommand { transition: *transition, message, comment, before_pdos: false });
    }
}

/// The list of modules: no entries, the entries, their number.
fn module_idents(work: &mut Work<'_>) -> Vec<SelectedCommand> {
    let Some(slots) = &work.device.slots else { return Vec::new() };
    if slots.download_addresses {
        let text = "DownloadModuleAddressList: the addresses of modules are not known: 0xf020 is not written";
        work.note(slots.line, text);
    }
    if slots.groups.iter().any(|group| !group.pdo_groups.is_empty()) && !work.modules.is_empty() {
        work.note(slots.line, "ModulePdoGroup: PDOs are in the order of the slots, without alignment");
    }
    if !slots.download_idents {
        return Vec::new();
    }
    let count = work.modules.iter().map(|placed| placed.slot + 1).max().unwrap_or(0);
    let ident = |slot: u16| work.modules.iter().find(|placed| placed.slot == slot).map_or(0, |it| it.module.ident);
    let command = |sub_index: u8, data: Vec<u8>, comment: &str| SelectedCommand {
        transition: slots.download_transition,
        message: SelectedMessage::Sdo(MODULE_IDENTS, sub_index, false, data),
        comment: comment.to_owned(),
        before_pdos: true,
    };
    let entries =
        (1..=u8::MAX).zip(0..count).map(|(sub, slot)| command(sub, ident(slot).to_le_bytes().to_vec(), "module ident"));
    let first = command(0, vec![0], "clear module idents");
    let last = command(0, vec![count as u8], "number of modules");
    std::iter::once(first).chain(entries).chain((count > 0).then_some(last)).collect()
}

/// A value that the object takes at its transition.
fn parameter_command(work: &Work<'_>, of: &Parameter) -> Result<SelectedCommand, EsiError> {
    let Parameter { transition, index, sub_index, data } = of;
    let what = format!("object {index:#06x}:{sub_index:02x}");
    let coe_line = work.device.mailbox.as_ref().filter(|mailbox| mailbox.coe.is_some()).map(|mailbox| mailbox.line);
    if coe_line.is_none() {
        return Err(work.error(work.device.line, format!("{what} cannot be written: the device has no CoE")));
    }
    if data.is_empty() {
        return Err(work.error(work.device.line, format!("{what}: expected a value, got no bytes")));
    }
    let comment = match work.find(*index, *sub_index) {
        None if work.has_objects() => {
            let reason = format!("{what}: the dictionary of the device has no such object");
            return Err(work.error(work.device.line, reason));
        }
        None => String::new(),
        Some(found) => {
            let wrong = |reason: String| {
                EsiError::rule(&found.file, found.line, work.device.kind.trim(), format!("{what}: {reason}"))
            };
            let (bit, state) = match transition {
                Transition::Ip | Transition::Ps => (1, "PREOP"),
                Transition::So | Transition::Sp => (2, "SAFEOP"),
                Transition::Op | Transition::Os => (4, "OP"),
            };
            if found.part.flags.access.write & bit == 0 {
                return Err(wrong(format!("it cannot be written in {state}")));
            }
            let bytes = found.part.bit_size.div_ceil(8) as usize;
            let is_text = matches!(found.part.data_type, 0x09..=0x0B);
            if bytes > 0 && (data.len() > bytes || data.len() < bytes && !is_text) {
                return Err(wrong(format!("expected {bytes} bytes, got {}", data.len())));
            }
            limits(&found.part, data).map_err(wrong)?;
            let name = found.part.name.trim();
            if name == found.object { name.to_owned() } else { format!("{}: {name}", found.object) }
        }
    };
    let message = SelectedMessage::Sdo(*index, *sub_index, false, data.clone());
    Ok(SelectedCommand { transition: *transition, message, comment, before_pdos: false })
}

/// Whether a number is within the limits of its object.
fn limits(part: &crate::esi::values::Part, data: &[u8]) -> Result<(), String> {
    /// Codes of signed numbers.
    const SIGNED: [u16; 7] = [0x02, 0x03, 0x04, 0x10, 0x12, 0x13, 0x15];
    /// Codes of unsigned numbers.
    const UNSIGNED: [u16; 7] = [0x05, 0x06, 0x07, 0x16, 0x18, 0x19, 0x1B];
    let is_signed = SIGNED.contains(&part.data_type);
    if !is_signed && !UNSIGNED.contains(&part.data_type) || data.len() > 8 {
        return Ok(());
    }
    let number = |bytes: &[u8]| {
        let negative = is_signed && bytes.last().is_some_and(|byte| byte & 0x80 != 0);
        let mut wide = [if negative { 0xFF } else { 0 }; 16];
        let length = bytes.len().min(8);
        wide[..length].copy_from_slice(&bytes[..length]);
        i128::from_le_bytes(wide)
    };
    let value = number(data);
    let least = part.minimum.as_deref().map(number);
    let most = part.maximum.as_deref().map(number);
    // Some files state the limits 0 and 0 for an object without limits.
    if least.zip(most).is_some_and(|(least, most)| least >= most) {
        return Ok(());
    }
    if least.is_some_and(|least| value < least) || most.is_some_and(|most| value > most) {
        let word = |limit: Option<i128>| limit.map_or("any".to_owned(), |limit| limit.to_string());
        return Err(format!("expected {} to {}, got {value}", word(least), word(most)));
    }
    Ok(())
}
