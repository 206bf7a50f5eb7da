//! From a network file to an ENI. What the engine takes from the EEPROM at a start is stated: SyncManagers and
//! mailboxes as the file notes them for exports, the commands that assign and map PDOs, the reference clock.

mod pdos;

use std::collections::BTreeSet;

use ringcat_engine::config::{DeclaredArea, DeclaredSyncManager, ReferenceClock, SyncManagerRole};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::{Declaration, DomainMember};
use ringcat_wire::register::{SyncManager as Register, SyncManagerActivate, SyncManagerControl};

use super::model::{self, Buffer, Lrw, NetworkFile, SubDevice, SyncManager};
use crate::configuration::{Configuration, ImageArea};
use crate::eni;
use crate::export::{Export, ExportDetails, ExportError, ExportOptions, LeftOut, SubDeviceDetails, export, odd_limit};

/// Control bytes of mailboxes (protocol 3.11).
const MAILBOX_OUT: u8 = 0x26;
const MAILBOX_IN: u8 = 0x22;
/// Control bytes of SyncManagers of process data: three buffers, event to the PDI for outputs.
const OUTPUTS: u8 = 0x24;
const INPUTS: u8 = 0x20;
/// Watchdog enable in the control byte.
const WATCHDOG: u8 = 0x40;
/// Consequence of an ENI without SyncManagers for a SubDevice.
const WITHOUT_PROCESS_DATA: &str = "the file has no process data of it, and an ENI leaves none to the EEPROM: a \
                                    SubDevice with process data does not reach SAFEOP then; `ringcat init` and \
                                    `ringcat esi declare` write the tables `[[subdevice.sync_manager]]`";
/// Consequence of an ENI that has some SyncManagers of a SubDevice, but not this one.
const WITHOUT_TABLE: &str = "the file has no table of it, and an ENI leaves none to the EEPROM: if the SubDevice has \
                             process data there, it does not reach SAFEOP; a table without `length` and without PDOs \
                             declares that it has none";

impl NetworkFile {
    /// The ENI of the network.
    ///
    /// # Errors
    /// [`ExportError`]: what an ENI cannot express, or what it has to state and the file leaves to the EEPROM.
    pub fn to_eni(&self, options: &ExportOptions) -> Result<Export, ExportError> {
        let mut configuration = self.configuration();
        let mut left_out = of_file(self);
        for (index, of) in self.subdevice.iter().enumerate() {
            limits(&configuration, index, of)?;
            let declared = declared(&configuration, index, of)?;
            let placed = pdos::place(&configuration.declaration.subdevices[index].startup, of);
            if let Some(undone) = placed.undone(&declared) {
                let refused = ExportError::of(&configuration, index, "start-up commands", undone.to_string());
                return Err(refused.at("startup"));
            }
            if !placed.is_exact {
                let reason = "an ENI has the commands of each protocol, and those to registers, in lists of their own: \
                              the commands that assign PDOs follow the other CoE commands without `after_pdos`";
                left_out.push(LeftOut::new(index, "order of the start-up commands at PS", reason));
            }
            let config = &mut configuration.declaration.subdevices[index];
            config.startup = placed.startup;
            config.sync_managers.clear();
            config.pdos = None;
            config.declared_bootstrap = bootstrap(of);
            if declared.iter().all(|it| it.area().is_none()) {
                left_out.extend((!is_coupler(of)).then(|| LeftOut::new(index, "sync_manager", WITHOUT_PROCESS_DATA)));
            } else {
                let missing = without_table(&declared, of);
                left_out
                    .extend(missing.map(|number| LeftOut::new(index, format!("sync_manager {number}"), WITHOUT_TABLE)));
            }
            config.declared = Some(declared);
        }
        places(&mut configuration);
        let names = domains(self, &mut configuration.declaration, &mut left_out);
        reference(&mut configuration, &mut left_out)?;
        let mut export = export(&configuration, &self.details(names), options)?;
        left_out.append(&mut export.left_out);
        export.left_out = left_out;
        Ok(export)
    }

    /// What is for people and for other MainDevices.
    fn details(&self, tasks: Vec<String>) -> ExportDetails {
        let of = |it: &SubDevice| SubDeviceDetails {
            vendor_id: it.vendor,
            product_code: it.product,
            revision: it.revision,
            serial: it.serial,
            physics: it.ports.clone(),
            protocols: it.mailbox.iter().flat_map(|it| &it.protocols).map(|it| format!("{it:?}")).collect(),
            pdos: it.sync_manager.iter().flat_map(|sm| sm.pdo.iter().map(|pdo| named(sm, pdo))).collect(),
        };
        let subdevices = self.subdevice.iter().map(of).collect();
        ExportDetails { name: self.name.clone(), subdevices, tasks }
    }
}

/// Time limits of start-up commands that an ENI can have.
fn limits(configuration: &Configuration, index: usize, of: &SubDevice) -> Result<(), ExportError> {
    let mut odd = of.startup.iter().enumerate().filter_map(|(at, it)| Some((at, odd_limit(it.limit?.0)?)));
    match odd.next() {
        Some((at, reason)) => {
            Err(ExportError::of(configuration, index, "time limit", reason).at(format!("startup[{at}].limit")))
        }
        None => Ok(()),
    }
}

/// Couplers, extensions and junctions have no process data. They are recognised by ports of two kinds, or more than two
/// ports.
fn is_coupler(of: &SubDevice) -> bool {
    let ports: Vec<char> = of.ports.chars().filter(|kind| !kind.is_whitespace()).collect();
    let has_branches = ports.len() > 2 || ports.windows(2).any(|pair| pair[0] != pair[1]);
    has_branches && of.mailbox.is_none() && of.domain.is_none() && of.sync.is_none()
}

/// SyncManagers of process data that a SubDevice may have and that the file does not contain: those below its last one,
/// and with mailboxes, which are SyncManagers 0 and 1, both 2 and 3 (protocol 3.11).
fn without_table(declared: &[DeclaredSyncManager], of: &SubDevice) -> impl Iterator<Item = u8> {
    let of_data: BTreeSet<u8> = declared.iter().filter_map(|it| Some(it.area()?.sync_manager)).collect();
    let last = of_data.last().copied().unwrap_or_default();
    let has_mailbox = of.mailbox.is_some() || of_data.first().is_some_and(|first| *first >= 2);
    let possible = if has_mailbox { 2..=last.max(3) } else { 0..=last };
    possible.filter(move |number| !of_data.contains(number))
}

/// Mailboxes that a file leaves to the EEPROM. If the file has the ports of a SubDevice, the entry comes from a scan or
/// a description: such a SubDevice has no mailbox.
fn mailboxes(file: &NetworkFile) -> Vec<LeftOut> {
    let subdevices = (0..).zip(&file.subdevice).filter(|(_, of)| of.mailbox.is_none());
    let (with_commands, others): (Vec<_>, Vec<_>) = subdevices.partition(|(_, of)| of.startup.iter().any(is_mail));
    let advice = "`ringcat init` and `ringcat esi declare` write the table `[subdevice.mailbox]`";
    let reason = format!(
        "start-up commands need a mailbox, and the file has none: RingCAT takes it from the EEPROM, other MainDevices \
         may not send these commands: {advice}"
    );
    let mut left_out: Vec<_> =
        with_commands.iter().map(|(index, _)| LeftOut::new(*index, "mailbox", reason.clone())).collect();
    let unknown = others.iter().filter(|(_, of)| of.ports.is_empty()).count();
    if unknown > 0 {
        let reason = format!(
            "the file does not say whether {unknown} of {} SubDevices have mailboxes: the ENI has none, RingCAT takes \
             those of the EEPROMs, with other MainDevices such a SubDevice may refuse PREOP; {advice}",
            file.subdevice.len()
        );
        left_out.push(LeftOut::new(None, "mailbox", reason));
    }
    left_out
}

/// Whether a start-up command is sent through a mailbox.
fn is_mail(command: &model::Startup) -> bool {
    command.write.is_none() && command.check.is_none()
}

/// What only network files have.
fn of_file(file: &NetworkFile) -> Vec<LeftOut> {
    let mut left_out = mailboxes(file);
    if file.redundancy != model::Redundancy::default() {
        let reason = "an ENI does not name rings: options of the MainDevice declare them";
        left_out.push(LeftOut::new(None, "redundancy", reason));
    }
    if file.lrw == Lrw::Always && file.redundancy.ring {
        left_out.push(LeftOut::new(None, "lrw", "a ring refuses the LRW commands of this file"));
    }
    for (index, of) in file.subdevice.iter().enumerate() {
        if !of.firmware.is_empty() {
            left_out.push(LeftOut::new(index, "firmware", "an ENI has no version of the firmware"));
        }
        if !of.order_code.is_empty() && of.order_code != of.name {
            left_out.push(LeftOut::new(index, "order_code", "an ENI has the name alone"));
        }
    }
    left_out
}

/// The SyncManagers, with the mailboxes.
fn declared(
    configuration: &Configuration,
    index: usize,
    of: &SubDevice,
) -> Result<Vec<DeclaredSyncManager>, ExportError> {
    let mut found = Vec::new();
    if let Some(mailbox) = &of.mailbox {
        found.push(buffer(0, SyncManagerRole::MailboxOut, mailbox.write, MAILBOX_OUT));
        found.push(buffer(1, SyncManagerRole::MailboxIn, mailbox.read, MAILBOX_IN));
    }
    for (at, it) in of.sync_manager.iter().enumerate() {
        let refused = |reason: &str| {
            let what = format!("SyncManager {}", it.number);
            ExportError::of(configuration, index, what, reason.to_owned()).at(format!("sync_manager[{at}]"))
        };
        if found.iter().any(|other| other.index == it.number) {
            return Err(refused("a mailbox uses it"));
        }
        // The file does not declare process data for this SyncManager.
        if it.pdo.is_empty() && it.length == Some(0) {
            continue;
        }
        let length = length(it).ok_or_else(|| {
            refused("the entries of its PDOs are those of the EEPROM: an ENI has to state them (`ringcat init` does)")
        })?;
        let (start, control) = match length {
            0 => (it.start.unwrap_or_default(), control_while_disabled(it)),
            _ => it
                .start
                .zip(it.control)
                .ok_or_else(|| refused("an ENI needs its `start` and `control` (`ringcat init` writes them)"))?,
        };
        let control = match it.watchdog {
            None => control,
            Some(true) => control | WATCHDOG,
            Some(false) => control & !WATCHDOG,
        };
        let role = match it.direction {
            model::Direction::Outputs => SyncManagerRole::Outputs,
            model::Direction::Inputs => SyncManagerRole::Inputs,
        };
        let pdos = it.pdo.iter().map(|pdo| super::declare::mapping(pdo).with_fixed(false)).collect();
        let mut one = buffer(it.number, role, Buffer { start, length }, control);
        one.register.activate.enable = length > 0;
        found.push(one.with_op_only(it.op_only && length > 0).with_pdos(pdos));
    }
    found.sort_by_key(|it| it.index);
    Ok(found)
}

/// The process data of a SyncManager; `None` if it has none.
fn exchanged(of: &DeclaredSyncManager) -> Option<DeclaredArea> {
    of.area().filter(|area| area.length > 0)
}

/// Bytes of a SyncManager; 0 if it is disabled, `None` if they are not known.
fn length(of: &SyncManager) -> Option<u16> {
    let mut bits = 0_u32;
    for pdo in &of.pdo {
        bits += pdo.entries.as_ref()?.iter().map(|entry| u32::from(entry.bits)).sum::<u32>();
    }
    Some(of.length.unwrap_or_else(|| u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX)))
}

/// A disabled SyncManager has no memory, so its control byte does not matter; a control byte of 0 would mean that the
/// SyncManager is cleared.
fn control_while_disabled(of: &SyncManager) -> u8 {
    let is_cleared = |control: &u8| control & !WATCHDOG == 0;
    of.control.filter(|control| !is_cleared(control)).unwrap_or(match of.direction {
        model::Direction::Outputs => OUTPUTS,
        model::Direction::Inputs => INPUTS,
    })
}

fn buffer(index: u8, role: SyncManagerRole, of: Buffer, control: u8) -> DeclaredSyncManager {
    let register = Register {
        start: of.start,
        length: of.length,
        control: SyncManagerControl::from_bits(control),
        activate: SyncManagerActivate { enable: true, ..SyncManagerActivate::default() },
        ..Register::default()
    };
    DeclaredSyncManager::new(index, role, register)
}

fn bootstrap(of: &SubDevice) -> Option<[DeclaredSyncManager; 2]> {
    let mailbox = of.mailbox.as_ref()?;
    let (write, read) = mailbox.boot_write.zip(mailbox.boot_read)?;
    let out = buffer(0, SyncManagerRole::MailboxOut, write, MAILBOX_OUT);
    Some([out, buffer(1, SyncManagerRole::MailboxIn, read, MAILBOX_IN)])
}

/// Process data without PDOs has no variables, so the image of a network file does not have it; the commands of an ENI
/// need a place for it: behind all other.
fn places(configuration: &mut Configuration) {
    let Configuration { declaration, image, .. } = configuration;
    for (subdevice, config) in declaration.subdevices.iter().enumerate() {
        for area in config.declared.iter().flatten().filter_map(exchanged) {
            let number = Some(area.sync_manager);
            if image.areas.iter().any(|it| it.subdevice == subdevice && it.sync_manager == number) {
                continue;
            }
            let (direction, bits) = (area.direction, u32::from(area.length) * 8);
            let length = match direction {
                Direction::Outputs => &mut image.outputs_len,
                Direction::Inputs => &mut image.inputs_len,
            };
            let image_bit = u32::try_from(*length * 8).unwrap_or(u32::MAX);
            *length += usize::from(area.length);
            image.areas.push(ImageArea { subdevice, direction, sync_manager: number, bit_offset: 0, image_bit, bits });
        }
    }
    image.areas.sort_by_key(|area| (area.direction == Direction::Inputs, area.image_bit));
}

/// Domains as an ENI has them: members are the SyncManagers with process data. Returns the names of those that are
/// left.
fn domains(file: &NetworkFile, declaration: &mut Declaration, left_out: &mut Vec<LeftOut>) -> Vec<String> {
    let of = |at: usize| -> BTreeSet<u8> {
        let declared = declaration.subdevices[at].declared.iter().flatten();
        declared.filter_map(exchanged).map(|area| area.sync_manager).collect()
    };
    let mut names = Vec::new();
    let mut kept = Vec::new();
    for (mut domain, named) in declaration.domains.iter().cloned().zip(&file.domain) {
        let own = |member: &DomainMember| {
            let SubDeviceId(at) = member.subdevice;
            let all = of(at);
            let here: Vec<u8> = match &member.sync_managers {
                None => return (!all.is_empty()).then(|| DomainMember::new(member.subdevice)),
                Some(numbers) => all.iter().copied().filter(|number| numbers.contains(number)).collect(),
            };
            let is_whole = here.len() == all.len();
            let member = DomainMember::new(member.subdevice);
            (!here.is_empty()).then(|| member.with_sync_managers((!is_whole).then_some(here)))
        };
        domain.members = domain.members.iter().filter_map(own).collect();
        if domain.members.is_empty() {
            let what = format!("domain {:?}", named.name);
            left_out.push(LeftOut::new(None, what, "no SubDevice has process data in it"));
        } else {
            names.push(named.name.clone());
            kept.push(domain);
        }
    }
    declaration.domains = kept;
    names
}

/// An ENI names the reference clock. Without a name the engine takes the first SubDevice with a clock. The
/// file does not have this information: here it is the first SubDevice with SYNC signals.
fn reference(configuration: &mut Configuration, left_out: &mut Vec<LeftOut>) -> Result<(), ExportError> {
    let configs = &configuration.declaration.subdevices;
    let first = configs.iter().position(|config| config.sync.is_some());
    let Some(clocks) = &mut configuration.declaration.clocks else {
        let Some(index) = first else { return Ok(()) };
        let reason = "they need the distributed clocks: add a table `[clocks]`";
        return Err(ExportError::of(configuration, index, "SYNC signals", reason).at("sync"));
    };
    if matches!(clocks.reference, ReferenceClock::Declared(_)) {
        return Ok(());
    }
    let Some(index) = first else {
        let reason = "an ENI names the SubDevice with the reference clock: add `reference` to the table `[clocks]`";
        return Err(ExportError::whole("clocks", reason).at("clocks"));
    };
    clocks.reference = ReferenceClock::Declared(SubDeviceId(index));
    let reason = "the file names no reference clock: in the ENI it is this SubDevice, the first with SYNC signals";
    left_out.push(LeftOut::new(index, "clocks", reason));
    Ok(())
}

/// A PDO with its names.
fn named(sync_manager: &SyncManager, pdo: &model::Pdo) -> eni::Pdo {
    let entry = |it: &model::Entry| eni::PdoEntry {
        index: it.index,
        sub_index: it.sub,
        bit_length: it.bits.into(),
        name: it.name.clone(),
        data_type: it.data_type.clone(),
    };
    eni::Pdo {
        place: eni::Place::default(),
        outputs: sync_manager.direction == model::Direction::Outputs,
        index: pdo.index,
        name: pdo.name.clone(),
        sync_manager: Some(sync_manager.number),
        entries: pdo.entries.iter().flatten().map(entry).collect(),
    }
}
