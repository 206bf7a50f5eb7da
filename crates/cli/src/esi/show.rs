//! `ringcat esi show`: one device of a description, and what can be chosen for it.

use clap::Args;
use ringcat::config::esi::{Device, Esi, Pdo, Slot, SyncManagerRole};

use super::device::{DeviceArguments, read};
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::esi::{EsiShow, ShownMode, ShownPdo, ShownSlot, ShownSyncManager};
use crate::output::{counted, say};
use crate::verdict::{Report, Verdict};

/// Options of `ringcat esi show`.
#[derive(Args, Debug)]
pub struct ShowArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Language of names: 1033 English, 1031 German
    #[arg(long, value_name = "LCID", default_value_t = crate::descriptions::ENGLISH, help_heading = "Output")]
    language: u32,
}

/// Prints a device.
pub fn run(arguments: &ShowArguments) -> Result<Report, Failure> {
    let esi = read(&arguments.device.esi)?;
    let device = arguments.device.choose(&esi)?;
    let data = shown(&esi, device, arguments.language);
    lines(&data).iter().for_each(|line| say!("{line}"));
    let held = format!(
        "{} revision {:#010x}, {}, {}",
        data.device,
        data.revision,
        counted(data.pdos.len(), "PDO", "PDOs"),
        counted(data.objects, "object", "objects")
    );
    Ok(Report { verdict: Verdict::Held(held), data: Data::EsiShow(data) })
}

fn shown(esi: &Esi, device: &Device, language: u32) -> EsiShow {
    let role = |role: SyncManagerRole| match role {
        SyncManagerRole::MailboxOut => "mailbox out",
        SyncManagerRole::MailboxIn => "mailbox in",
        SyncManagerRole::Outputs => "outputs",
        SyncManagerRole::Inputs => "inputs",
        SyncManagerRole::Unused => "unused",
    };
    let sync_managers = device.sync_managers.iter().map(|sm| ShownSyncManager {
        role: role(sm.role).to_owned(),
        start: sm.start,
        default_bytes: sm.default_size,
        is_virtual: sm.is_virtual,
        op_only: sm.op_only,
    });
    let rx = device.rx_pdos.iter().map(|pdo| shown_pdo(pdo, true, language));
    let pdos = rx.chain(device.tx_pdos.iter().map(|pdo| shown_pdo(pdo, false, language))).collect();
    let modes = device.clock.iter().flat_map(|clock| &clock.modes).map(|mode| ShownMode {
        name: mode.name.trim().to_owned(),
        description: mode.description.trim().to_owned(),
        assign_activate: mode.assign_activate,
    });
    let slots = device.slots.iter().flat_map(|slots| &slots.slots).map(|slot| shown_slot(esi, slot, language));
    let dictionaries = device.profiles.iter().filter_map(|profile| profile.dictionary.as_deref());
    let mailbox = device.mailbox.as_ref();
    let protocols = [
        ("AoE", mailbox.is_some_and(|it| it.aoe.is_some())),
        ("EoE", mailbox.is_some_and(|it| it.eoe.is_some())),
        ("CoE", mailbox.is_some_and(|it| it.coe.is_some())),
        ("FoE", mailbox.is_some_and(|it| it.foe)),
        ("SoE", mailbox.is_some_and(|it| it.soe.is_some())),
        ("VoE", mailbox.is_some_and(|it| it.voe)),
    ];
    EsiShow {
        esi: esi.file.clone(),
        line: device.line,
        device: device.kind.trim().to_owned(),
        name: device.name.in_language(language).trim().to_owned(),
        vendor_id: device.vendor_id,
        product_code: device.product_code,
        revision: device.revision,
        ports: device.physics.clone(),
        protocols: protocols.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned()).collect(),
        sync_managers: sync_managers.collect(),
        pdos,
        modes: modes.collect(),
        slots: slots.collect(),
        objects: dictionaries.map(|dictionary| dictionary.objects.len()).sum(),
        startup_commands: mailbox.and_then(|it| it.coe.as_ref()).map_or(0, |coe| coe.commands.len()),
        notices: esi.notices.iter().map(ToString::to_string).collect(),
    }
}

fn shown_pdo(pdo: &Pdo, outputs: bool, language: u32) -> ShownPdo {
    ShownPdo {
        index: pdo.index.index,
        name: pdo.name.in_language(language).trim().to_owned(),
        is_output: outputs,
        bits: pdo.bit_length(),
        sync_manager: pdo.sync_manager,
        is_mandatory: pdo.is_mandatory,
        is_fixed: pdo.is_fixed,
        is_virtual: pdo.is_virtual,
        excludes: pdo.excludes.iter().map(|exclude| exclude.index).collect(),
        line: pdo.line,
    }
}

fn shown_slot(esi: &Esi, slot: &Slot, language: u32) -> ShownSlot {
    let by_class = |class: Option<&str>| slot.classes.iter().any(|it| Some(it.class.as_str()) == class);
    let fits = esi
        .modules
        .iter()
        .filter(|module| slot.modules.iter().any(|it| it.ident == module.ident) || by_class(module.class.as_deref()));
    ShownSlot {
        name: slot.name.in_language(language).trim().to_owned(),
        least: slot.least,
        most: slot.most,
        modules: fits.map(|module| module.kind.trim().to_owned()).collect(),
    }
}

/// Lines for people, within 80 columns where texts allow it.
fn lines(of: &EsiShow) -> Vec<String> {
    let mut lines = vec![
        format!("device      {} \"{}\" ({}:{})", of.device, of.name, of.esi, of.line),
        format!(
            "identity    vendor {:#010x}, product {:#010x}, revision {:#010x}",
            of.vendor_id, of.product_code, of.revision
        ),
        format!("ports       {}", if of.ports.trim().is_empty() { "unknown" } else { &of.ports }),
    ];
    if !of.protocols.is_empty() {
        lines.push(format!("mailbox     {}", of.protocols.join(", ")));
    }
    for (number, sm) in of.sync_managers.iter().enumerate() {
        let start = sm.start.map_or(String::new(), |start| format!(" at {start:#06x}"));
        let words = [("virtual", sm.is_virtual), ("in OP only", sm.op_only)];
        let words: String = words.iter().filter(|(_, is)| *is).map(|(word, _)| format!(", {word}")).collect();
        lines.push(format!("SM {number:<8} {}{start}{words}", sm.role));
    }
    for mode in &of.modes {
        lines.push(format!("mode        \"{}\" {:#06x} {}", mode.name, mode.assign_activate, mode.description));
    }
    for slot in &of.slots {
        let (count, modules) = (format!("{} to {}", slot.least, slot.most), slot.modules.join(", "));
        lines.push(format!("slot        \"{}\", {count}: {modules}", slot.name));
    }
    for pdo in &of.pdos {
        let sm = pdo.sync_manager.map_or("SM -".to_owned(), |number| format!("SM {number}"));
        let flags = [("mandatory", pdo.is_mandatory), ("fixed", pdo.is_fixed), ("virtual", pdo.is_virtual)];
        let mut words: Vec<String> = flags.iter().filter(|(_, is)| *is).map(|(word, _)| (*word).to_owned()).collect();
        if !pdo.excludes.is_empty() {
            let others: Vec<String> = pdo.excludes.iter().map(|index| format!("{index:#06x}")).collect();
            words.push(format!("excludes {}", others.join(" ")));
        }
        let kind = if pdo.is_output { "RxPdo" } else { "TxPdo" };
        let words = if words.is_empty() { String::new() } else { format!(", {}", words.join(", ")) };
        lines.push(format!("{kind}       {:#06x} {sm} {:4} bits \"{}\"{words}", pdo.index, pdo.bits, pdo.name));
    }
    if of.startup_commands > 0 {
        lines.push(format!("start-up    {}", counted(of.startup_commands, "command", "commands")));
    }
    lines
}
