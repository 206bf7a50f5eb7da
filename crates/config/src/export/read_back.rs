//! The comparison of what was to be written with what the reader gives for it. A difference is a setting that an ENI
//! cannot express: it is named instead of being lost.

use std::collections::BTreeSet;

use ringcat_engine::config::{Expected, StartupAction, StartupCommand, SubDeviceConfig};
use ringcat_engine::main_device::{Declaration, DomainConfig};

use super::error::ExportError;
use super::explicit::{OTHERS, UP};
use super::lrw::Lrw;
use crate::configuration::{Configuration, ImageCopy, ProcessImage, SubDeviceFacts};

pub(super) fn check(whole: &Configuration, read: &Configuration, lrw: &Lrw) -> Result<(), ExportError> {
    let (expected, got) = (&whole.declaration, &read.declaration);
    if expected.subdevices.len() != got.subdevices.len() {
        return Err(lost("SubDevices", expected.subdevices.len(), got.subdevices.len()));
    }
    for (index, (expected, got)) in expected.subdevices.iter().zip(&got.subdevices).enumerate() {
        let facts = (&whole.subdevices[index], &read.subdevices[index]);
        if let Some(what) = different(expected, got).or_else(|| of_facts(facts.0, facts.1)) {
            let reason = "an ENI that RingCAT reads cannot express this value";
            return Err(ExportError::of(whole, index, what, reason));
        }
    }
    if whole.groups != read.groups {
        return Err(lost("groups", &whole.groups, &read.groups));
    }
    domains(expected, got)?;
    let clocks = |of: &Declaration| of.clocks.as_ref().map(|clocks| (clocks.reference, clocks.bus_shift));
    if clocks(expected) != clocks(got) {
        return Err(lost("clocks", clocks(expected), clocks(got)));
    }
    let with_data = |of: &Declaration| -> BTreeSet<usize> {
        of.explicit_lrw.iter().flat_map(|it| &it.subdevices).map(|subdevice| subdevice.0).collect()
    };
    let has_data = |subdevice: &&usize| {
        whole.image.areas.iter().any(|area| area.subdevice == **subdevice && area.sync_manager.is_some())
    };
    let of_lrw: BTreeSet<usize> = lrw.iter().filter(has_data).copied().collect();
    if of_lrw != with_data(got) {
        return Err(lost("SubDevices in LRW commands", of_lrw, with_data(got)));
    }
    image(&whole.image, &read.image)
}

fn lost(what: &str, expected: impl std::fmt::Debug, got: impl std::fmt::Debug) -> ExportError {
    ExportError::whole(what, format!("an ENI that RingCAT reads cannot express it: {expected:?} would be {got:?}"))
}

/// The first setting that differs.
fn different(expected: &SubDeviceConfig, got: &SubDeviceConfig) -> Option<&'static str> {
    let (a, b) = (expected, got);
    let pdos = |of: &SubDeviceConfig| of.pdos.clone().filter(|_| of.declared.is_none());
    let mut changes = UP.into_iter().chain(OTHERS);
    let limits_differ = a.declared.is_some() && changes.any(|(from, to)| a.limit(from, to) != b.limit(from, to));
    let optional = |of: &SubDeviceConfig| of.optional && of.group.is_some();
    let found = [
        ("place", a.address != b.address),
        ("expected identity", compared(a) != b.expected),
        ("group", a.group != b.group || optional(a) != optional(b)),
        ("SyncManagers", a.declared != b.declared),
        ("mailboxes of BOOT", a.declared_bootstrap != b.declared_bootstrap),
        ("PDOs", pdos(a) != pdos(b)),
        ("watchdog divider", a.watchdog_divider != b.watchdog_divider),
        ("process data watchdog", a.watchdog_intervals != b.watchdog_intervals),
        ("PDI watchdog", a.pdi_watchdog_intervals != b.pdi_watchdog_intervals),
        ("EEPROM of the PDI", a.sii_to_pdi != b.sii_to_pdi),
        ("SYNC signals", a.sync != b.sync),
        ("start-up commands", by_transition(&a.startup) != by_transition(&b.startup)),
        ("time limits of state changes", limits_differ),
    ];
    found.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
}

/// The identity without the lowest revision, which the file leaves to the MainDevice (protocol ES-121).
fn compared(config: &SubDeviceConfig) -> Expected {
    let mut expected = config.expected;
    expected.minimum_revision = None;
    if expected.revision.is_none() {
        expected.revision_mask = u32::MAX;
    }
    expected
}

/// In the order of sending. Commands to registers have no time limit in a file.
fn by_transition(startup: &[StartupCommand]) -> Vec<StartupCommand> {
    let mut sorted = startup.to_vec();
    sorted.sort_by_key(|command| command.transition as u8);
    let registers = sorted.iter_mut().filter(|command| matches!(command.action, StartupAction::Register(_)));
    registers.for_each(|command| command.limit = None);
    sorted
}

fn of_facts(expected: &SubDeviceFacts, got: &SubDeviceFacts) -> Option<&'static str> {
    let found = [
        ("name", expected.name != got.name),
        ("station address", expected.station != got.station),
        ("cable", expected.plugged_into != got.plugged_into),
        ("NetId", expected.net_id != got.net_id),
    ];
    found.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
}

fn domains(expected: &Declaration, got: &Declaration) -> Result<(), ExportError> {
    let shape = |domain: &DomainConfig| {
        let members = domain.members.iter().map(|it| (it.subdevice.0, it.sync_managers.clone()));
        (domain.period, members.collect::<Vec<_>>())
    };
    if expected.domains.len() != got.domains.len() {
        return Err(lost("domains", expected.domains.len(), got.domains.len()));
    }
    let mut pairs = expected.domains.iter().zip(&got.domains);
    match pairs.position(|(expected, got)| shape(expected) != shape(got)) {
        Some(number) => {
            let reason = "an ENI that RingCAT reads cannot express its cycle time or its members";
            Err(ExportError::whole(format!("domain {number}"), reason))
        }
        None => Ok(()),
    }
}

fn image(expected: &ProcessImage, got: &ProcessImage) -> Result<(), ExportError> {
    let sizes = |of: &ProcessImage| (of.inputs_len, of.outputs_len);
    if sizes(expected) != sizes(got) {
        return Err(lost("size of the image", sizes(expected), sizes(got)));
    }
    if let Some((expected, got)) = first_other(&expected.areas, &got.areas) {
        return Err(lost("place in the image", expected, got));
    }
    if let Some((expected, got)) = first_other(&expected.variables, &got.variables) {
        return Err(lost("variable", expected, got));
    }
    let sorted = |copies: &[ImageCopy]| {
        let key = |it: &ImageCopy| (it.target_area, it.target_bit, it.source_area, it.source_bit, it.bits);
        let mut all: Vec<_> = copies.iter().map(key).collect();
        all.sort_unstable();
        all
    };
    if sorted(&expected.copies) != sorted(&got.copies) {
        return Err(lost("copies", &expected.copies, &got.copies));
    }
    Ok(())
}

/// The first pair that differs.
fn first_other<'a, T: PartialEq>(expected: &'a [T], got: &'a [T]) -> Option<(Option<&'a T>, Option<&'a T>)> {
    let count = expected.len().max(got.len());
    (0..count).map(|at| (expected.get(at), got.get(at))).find(|(expected, got)| expected != got)
}
