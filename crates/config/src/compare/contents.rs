//! One SubDevice: identity, PDOs, mailboxes and properties of the file and of the bus.

use std::collections::BTreeSet;

use ringcat_engine::config::{
    DeclaredSyncManager, IdentityMismatch, PdoEntry, PdoMapping, SubDeviceConfig, SyncManagerRole,
};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::{PdoInfo, SubDeviceInfo};
use ringcat_engine::{PlanWarning, plan};

use super::assignment;
use super::difference::{Difference, DifferenceKind, StatedProperties};
use super::modules;
use super::process_data;
use super::properties::{self, buffers, words};
use super::samples;
use super::signals;

/// A SubDevice of the file and the one that was found.
pub(super) struct Both<'a> {
    /// Index in the file.
    pub(super) config: usize,
    /// Its declaration.
    pub(super) declared: &'a SubDeviceConfig,
    /// Its name.
    pub(super) name: &'a str,
    /// What the file states besides.
    pub(super) stated: Option<&'a StatedProperties>,
    /// What the scan found.
    pub(super) info: &'a SubDeviceInfo,
    /// Version of its firmware, if it was read.
    pub(super) firmware: Option<&'a str>,
    /// The modules that the SubDevice has detected, if they were read.
    pub(super) modules: Option<&'a [u32]>,
    /// The activation fails because of its place or its identity.
    pub(super) fails: bool,
}

impl Both<'_> {
    /// Appends the differences.
    pub(super) fn compare(&self, differences: &mut Vec<Difference>) {
        let (declared, stated, info) = (self.declared, self.stated, self.info);
        if self.identity(differences) {
            return;
        }
        let mut add = |kind, prevents_op, text: String| differences.push(self.difference(kind, prevents_op, text));
        if let Some(expected) = mailbox(declared, stated) {
            let got = info.mailbox.as_ref().map(buffers);
            if got != Some(expected) {
                let text = format!("expected mailboxes {}, got {}", words(Some(expected)), words(got));
                // An ENI has its own SyncManagers, which are written; a network file takes those of the SII.
                add(DifferenceKind::Mailbox, declared.declared.is_some(), text);
            }
        } else if declared.declared.is_some()
            && let Ok(planned) = plan(declared, info)
            && planned.warnings.contains(&PlanWarning::MailboxOfSii)
        {
            let got = words(planned.mailbox_layout().as_ref().map(buffers));
            let text = format!("the file has no mailboxes, got {got}: the mailboxes of the SII are used");
            add(DifferenceKind::Mailbox, false, text);
        }
        for (kind, prevents_op, text) in properties::differences(declared, stated, info) {
            add(kind, prevents_op, text);
        }
        for (prevents_op, text) in signals::differences(declared, info) {
            add(DifferenceKind::Clocks, prevents_op, text);
        }
        let (prevents_op, texts) = modules::differences(declared, self.modules);
        for text in texts {
            add(DifferenceKind::Modules, prevents_op, text);
        }
        self.process_data(differences);
        let mut add = |kind, prevents_op, text: String| differences.push(self.difference(kind, prevents_op, text));
        if let Err(error) = plan(declared, info) {
            add(DifferenceKind::ProcessData, true, error.to_string());
        }
        let expected = stated.map(|stated| stated.firmware.as_str()).filter(|firmware| !firmware.is_empty());
        if let (Some(expected), Some(got)) = (expected, self.firmware)
            && expected != got
        {
            let text = format!("expected firmware \"{}\", got \"{}\"", expected.escape_debug(), got.escape_debug());
            add(DifferenceKind::Firmware, false, text);
        }
    }

    /// Appends the differences of the identity; whether it is another device, which has nothing to compare.
    fn identity(&self, differences: &mut Vec<Difference>) -> bool {
        let identity = &self.info.identity;
        let stated = self.stated.cloned().unwrap_or_default();
        if let Some(mismatch) = self.declared.expected.mismatch(self.info) {
            let kind = DifferenceKind::of_field(mismatch.field);
            let IdentityMismatch { field, expected, got, .. } = mismatch;
            let text = format!("expected {field} {expected:#010x}, got {got:#010x}");
            differences.push(self.difference(kind, self.fails, text));
            return kind == DifferenceKind::Device;
        }
        if let Some((vendor, product)) = stated.device
            && (vendor, product) != (identity.vendor_id, identity.product_code)
        {
            let got = format!("{:#010x} and {:#010x}", identity.vendor_id, identity.product_code);
            let text = format!("the file has vendor {vendor:#010x} and product {product:#010x}, found {got}");
            differences.push(self.difference(DifferenceKind::Device, false, text));
            return true;
        }
        if let Some(revision) = stated.revision.filter(|revision| *revision != identity.revision) {
            let text = format!("the file has revision {revision:#010x}, found {:#010x}", identity.revision);
            differences.push(self.difference(DifferenceKind::Revision, false, text));
        }
        false
    }

    /// Appends the differences of the process data, by SyncManager; for a SubDevice with modules, only those of PDOs
    /// that both sides describe, and process data that an ENI leaves out.
    fn process_data(&self, differences: &mut Vec<Difference>) {
        let (declared, info) = (self.declared, self.info);
        let is_modular = assignment::names_modules(declared) || self.stated.is_some_and(|stated| stated.modular);
        let mut unfit = process_data::unfit(declared, info);
        let mut assigned = Vec::new();
        if is_modular {
            // The SII describes none of the modules: only process data that is missing in an ENI is compared. A
            // SyncManager that is declared as disabled has no modules of its direction.
            let has = |number: u8| declared.declared.iter().flatten().any(|it| it.index == number);
            unfit.retain(|number, lengths| lengths.is_left_out() && !has(*number));
        } else {
            assigned = assignment::differences(declared, info);
        }
        // Without modules it may have no process data.
        let has_modules = || self.modules.is_some_and(|list| list.iter().any(|ident| *ident != 0));
        let prevents_op = |lengths: &process_data::Lengths| !is_modular || lengths.is_written || has_modules();
        let mut named = BTreeSet::new();
        let mut add = |sync_manager: u8, text: String, prevents_op: bool| {
            named.insert(sync_manager);
            differences.push(self.difference(DifferenceKind::Pdos, prevents_op, text));
        };
        let assigned_else: BTreeSet<u8> = assigned.iter().map(|(sync_manager, _)| *sync_manager).collect();
        for (sync_manager, text) in assigned {
            match unfit.get(&sync_manager) {
                Some(lengths) => add(sync_manager, format!("{text}; {lengths}"), true),
                None => add(sync_manager, text, false),
            }
        }
        let is_sample = |(sync_manager, pdo): &(u8, &PdoMapping)| samples::is_sample(pdo, *sync_manager, info);
        for (sync_manager, pdo) in process_data::pdos(declared).filter(|it| !is_sample(it)) {
            // One that the SubDevice does not describe is named with the assignment.
            let may_lack = is_modular || assigned_else.contains(&sync_manager);
            if let Some(text) = pdo_difference(pdo, info, may_lack) {
                add(sync_manager, text, unfit.get(&sync_manager).is_some_and(prevents_op));
            }
        }
        unfit.retain(|sync_manager, _| !named.contains(sync_manager));
        for (sync_manager, lengths) in unfit {
            let text = format!("SM {sync_manager}: {lengths}");
            let prevents_op = prevents_op(&lengths);
            differences.push(self.difference(DifferenceKind::Pdos, prevents_op, text));
        }
    }

    fn difference(&self, kind: DifferenceKind, prevents_op: bool, text: String) -> Difference {
        Difference {
            subdevice: Some(SubDeviceId(self.config)),
            position: Some(self.info.position),
            kind,
            prevents_op,
            text: format!("position {} \"{}\": {text}", self.info.position, self.name),
        }
    }
}

/// Mailboxes of the file.
fn mailbox(declared: &SubDeviceConfig, stated: Option<&StatedProperties>) -> Option<[(u16, u16); 2]> {
    let of = |role: SyncManagerRole| {
        let mut sync_managers = declared.declared.iter().flatten();
        sync_managers
            .find(|it: &&DeclaredSyncManager| it.role == role)
            .map(|it| (it.register.start, it.register.length))
    };
    let own = of(SyncManagerRole::MailboxOut).zip(of(SyncManagerRole::MailboxIn)).map(|(out, back)| [out, back]);
    own.or(stated.and_then(|stated| stated.mailbox))
}

/// How a PDO differs from the one that the SubDevice describes. A SubDevice that describes no PDO at all has no
/// difference: its dictionary was not read. With `may_lack`, a PDO that it does not describe is no difference.
fn pdo_difference(pdo: &PdoMapping, info: &SubDeviceInfo, may_lack: bool) -> Option<String> {
    if info.pdos.is_empty() {
        return None;
    }
    let index = pdo.index;
    let Some(described) = info.pdo(index) else {
        let count = info.pdos.len();
        return (!may_lack).then(|| format!("PDO {index:#06x} is not among the {count} that the SubDevice describes"));
    };
    let ours = pdo.entries.as_ref()?;
    let theirs: Vec<PdoEntry> = entries(described);
    let mut others = (0..ours.len().max(theirs.len())).filter(|at| ours.get(*at) != theirs.get(*at));
    let at = others.next()?;
    let more = match others.count() {
        0 => String::new(),
        1 => "; 1 more entry differs".to_owned(),
        count => format!("; {count} more entries differ"),
    };
    let word = |entry: Option<&PdoEntry>| match entry {
        None => "nothing".to_owned(),
        Some(entry) if entry.index == 0 => format!("a gap of {} bits", entry.bit_length),
        Some(entry) => format!("{:#06x}:{:02x} of {} bits", entry.index, entry.sub_index, entry.bit_length),
    };
    let (expected, got) = (word(ours.get(at)), word(theirs.get(at)));
    Some(format!("PDO {index:#06x}, entry {}: expected {expected}, got {got}{more}", at + 1))
}

fn entries(described: &PdoInfo) -> Vec<PdoEntry> {
    described.entries.iter().map(|entry| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length)).collect()
}
