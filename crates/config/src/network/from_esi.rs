//! A SubDevice of a network file from a description and choices: identity with its rule, mailboxes, SyncManagers, PDOs
//! with names and types, SYNC signals, time limits, watchdogs, start-up commands (protocol ES-26, ES-33, ES-40 to
//! ES-67).

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat_engine::config::MailMessage;

use super::check::check;
use super::error::path_text;
use super::model::{
    self, At, Buffer, CheckRevision, Clocks, Domain, Entry, Idn, Mailbox, NetworkFile, Pdo, Protocol, Sdo, Startup,
    SubDevice, Sync, SyncManager, Timeouts, Write,
};
use super::unique::Names;
use super::values::{Bytes, Shift, Time};
use crate::esi::{
    self, Device, EsiError, OpMode, PlacedModule, RevisionCheck, SelectedCommand, SelectedMessage, SelectedSyncManager,
    Selection, SyncManagerRole, Transition,
};
use crate::ip;

/// Longest entry of a network file; longer ones are split into gaps behind the first part.
const ENTRY_BITS: u16 = 248;
/// Register with the activation of SYNC and LATCH units.
const ASSIGN_ACTIVATE: u16 = 0x0980;

/// A SubDevice and what of its description is not in it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FromEsi {
    /// The SubDevice.
    pub subdevice: SubDevice,
    /// What is not used, with lines of the description.
    pub notices: Vec<esi::Notice>,
}

impl SubDevice {
    /// The SubDevice of a description with what was chosen for it. `cycle` is that of the MainDevice; texts are in
    /// `language`, an LcId.
    ///
    /// # Errors
    /// SYNC signals that no controller can generate in this cycle; values that a network file cannot have.
    pub fn from_esi(selection: &Selection<'_>, cycle: Duration, language: u32) -> Result<FromEsi, EsiError> {
        let device = selection.device;
        let mut from = Notes { line: device.line, notices: selection.notices.clone() };
        let mut subdevice = SubDevice {
            name: name(device),
            vendor: Some(device.vendor_id),
            product: Some(device.product_code).filter(|_| device.check_product != esi::Check::None),
            revision: Some(device.revision),
            check_revision: check_revision(device.check_revision),
            serial: device.serial.filter(|_| device.check_serial == esi::Check::Equal),
            order_code: printable(&device.kind),
            ports: ports(device),
            mailbox: mailbox(device),
            timeouts: timeouts(device),
            eeprom_to_pdi: device.eeprom.as_ref().is_some_and(|eeprom| eeprom.assign_to_pdi),
            watchdog_divider: device.controller.reg_0400,
            watchdog_pdi: device.controller.reg_0410,
            watchdog_process_data: device.controller.reg_0420,
            ..SubDevice::default()
        };
        let described =
            |of: &SelectedSyncManager<'_>| !of.pdos.is_empty() || of.definition.default_size.unwrap_or(0) == 0;
        let of = selection.sync_managers.iter().filter(|of| described(of));
        let modules = pdos_of_modules(&selection.modules);
        subdevice.sync_manager = of.map(|of| sync_manager(of, &modules, language)).collect();
        if let Some(mode) = selection.mode {
            if device.clock.as_ref().is_some_and(|clock| clock.time_loop_only) {
                from.note("TimeLoopControlOnly: SYNC and LATCH units are not activated".into());
            } else {
                clock(selection, mode, cycle, &mut subdevice)?;
            }
            clock_notices(device, mode, subdevice.sync.as_ref(), &mut from);
        }
        from.note_left_out(device);
        for command in &selection.commands {
            subdevice.startup.extend(startup(command, &mut from));
        }
        valid(selection, &subdevice, cycle)?;
        Ok(FromEsi { subdevice, notices: from.notices })
    }
}

impl Notes {
    /// Settings of a device that a network file has no place for.
    fn note_left_out(&mut self, device: &Device) {
        let aoe = device.mailbox.as_ref().and_then(|mailbox| mailbox.aoe.as_ref());
        let is_separate = device.sync_units.iter().any(|unit| unit.separate);
        let has_frame = device.sync_units.iter().any(|unit| unit.separate_frame);
        let potential = device.clock.as_ref().is_some_and(|clock| clock.potential_reference);
        for (is_stated, notice) in [
            (device.use_lrd_lwr, "UseLrdLwr: the EEPROM of the device states whether it supports LRW"),
            (
                aoe.is_some_and(|aoe| aoe.generate_net_id),
                "AoE GenerateOwnNetId: no AMS NetId is chosen; a start-up command may write one",
            ),
            (
                aoe.is_some_and(|aoe| aoe.initialize_net_id),
                "AoE InitializeOwnNetId: no AMS NetId is sent to it; a start-up command may write one",
            ),
            (is_separate, "Su SeparateSu: its process data shares datagrams; a `domain` of its own separates it"),
            (has_frame, "Su SeparateFrame: its process data shares frames with other SubDevices"),
            (potential, "PotentialReferenceClock: choose the reference clock by `reference` of the table `clocks`"),
        ] {
            if is_stated {
                self.note(notice.into());
            }
        }
    }
}

/// What a network file refuses is refused here with the place in the description.
fn valid(selection: &Selection<'_>, subdevice: &SubDevice, cycle: Duration) -> Result<(), EsiError> {
    let mut file = NetworkFile::empty("", cycle);
    file.push(subdevice.clone());
    check(&file).map_err(|fault| {
        // The path begins with subdevice[0].
        let key = path_text(fault.path.get(2..).unwrap_or_default());
        let (device, reason) = (selection.device, format!("{key}: {}", fault.message));
        EsiError::rule(&selection.esi.file, device.line, device.kind.trim(), reason)
    })
}

/// The type, else the name of the device.
fn name(device: &Device) -> String {
    let texts = [printable(&device.kind), printable(device.name.english())];
    texts.into_iter().find(|text| !text.is_empty()).unwrap_or_else(|| "SubDevice".to_owned())
}

/// Letters of the ports in a network file; others are no port of EtherCAT.
fn ports(device: &Device) -> String {
    let letter = |kind: char| if matches!(kind, 'Y' | 'K' | 'H') { kind } else { ' ' };
    let letters: String = device.physics.chars().take(4).map(letter).collect();
    letters.trim_end().to_owned()
}

impl NetworkFile {
    /// A network of one cycle without SubDevices.
    pub fn empty(name: impl Into<String>, period: Duration) -> NetworkFile {
        let domain = Domain { name: "cycle".to_owned(), period: Time(period), under_way: 1, send_again: false };
        NetworkFile {
            ringcat_network: model::VERSION,
            name: name.into(),
            domain: vec![domain],
            ..NetworkFile::default()
        }
    }

    /// Appends a SubDevice; its name gets a number if another one has it, and clocks are used if it has SYNC signals.
    pub fn push(&mut self, mut subdevice: SubDevice) {
        let mut names = Names::default();
        for known in &self.subdevice {
            let _ = names.unique(known.name.clone());
        }
        subdevice.name = names.unique(subdevice.name);
        if subdevice.sync.is_some() && self.clocks.is_none() {
            self.clocks = Some(Clocks::default());
        }
        self.subdevice.push(subdevice);
    }
}

/// Notices about a device.
struct Notes {
    line: u32,
    notices: Vec<esi::Notice>,
}

impl Notes {
    fn note(&mut self, text: String) {
        match self.notices.last_mut().filter(|known| known.text == text) {
            Some(known) => known.times += 1,
            None => self.notices.push(esi::Notice { line: self.line, text, times: 1 }),
        }
    }
}

const fn check_revision(of: RevisionCheck) -> CheckRevision {
    match of {
        RevisionCheck::Unstated | RevisionCheck::None => CheckRevision::None,
        RevisionCheck::Equal => CheckRevision::Equal,
        RevisionCheck::EqualOrGreater => CheckRevision::EqualOrGreater,
        RevisionCheck::LowEqual => CheckRevision::LowEqual,
        RevisionCheck::LowEqualHighEqualOrGreater => CheckRevision::LowEqualHighEqualOrGreater,
        RevisionCheck::HighEqual => CheckRevision::HighEqual,
        RevisionCheck::HighEqualLowEqualOrGreater => CheckRevision::HighEqualLowEqualOrGreater,
    }
}

fn mailbox(device: &Device) -> Option<Mailbox> {
    let mailbox = device.mailbox.as_ref()?;
    let buffer = |role: SyncManagerRole| {
        let sm = device.sync_managers.iter().find(|sm| sm.role == role)?;
        let (start, length) = sm.start.zip(sm.default_size.filter(|length| *length > 0))?;
        Some(Buffer { start, length })
    };
    let (write, read) = buffer(SyncManagerRole::MailboxOut).zip(buffer(SyncManagerRole::MailboxIn))?;
    let bootstrap = device.eeprom.as_ref().and_then(|eeprom| eeprom.bootstrap.as_deref());
    let words = bootstrap
        .filter(|bytes| bytes.len() >= 8)
        .map(|bytes| [0, 2, 4, 6].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]])));
    let words = words.filter(|[_, out, _, back]| *out > 0 && *back > 0);
    let coe = mailbox.coe.clone().unwrap_or_default();
    let protocols = [
        (Protocol::AoE, mailbox.aoe.is_some()),
        (Protocol::EoE, mailbox.eoe.is_some()),
        (Protocol::CoE, mailbox.coe.is_some()),
        (Protocol::FoE, mailbox.foe),
        (Protocol::SoE, mailbox.soe.is_some()),
        (Protocol::VoE, mailbox.voe),
    ];
    Some(Mailbox {
        write,
        read,
        boot_write: words.map(|[start, length, ..]| Buffer { start, length }),
        boot_read: words.map(|[.., start, length]| Buffer { start, length }),
        protocols: protocols.into_iter().filter(|(_, has)| *has).map(|(protocol, _)| protocol).collect(),
        complete_access: coe.complete_access,
        pdo_assign: coe.pdo_assign,
        pdo_config: coe.pdo_config,
    })
}

fn timeouts(device: &Device) -> Timeouts {
    let time = |ms: Option<u32>| ms.filter(|ms| *ms > 0).map(|ms| Time(Duration::from_millis(ms.into())));
    let (of, info) = (device.info.state_times, &device.info);
    let response = time(info.response_timeout_ms);
    let has = |protocol: fn(&esi::Mailbox) -> bool| device.mailbox.as_ref().is_some_and(protocol);
    Timeouts {
        preop: time(of.preop_ms),
        safeop_op: time(of.safeop_op_ms),
        back_to_init: time(of.back_to_init_ms),
        back_to_safeop: time(of.back_to_safeop_ms),
        mailbox_request: time(info.request_timeout_ms),
        sdo: response.filter(|_| has(|mailbox| mailbox.coe.is_some())),
        soe: response.filter(|_| has(|mailbox| mailbox.soe.is_some())),
        eoe: response.filter(|_| has(|mailbox| mailbox.eoe.is_some())),
    }
}

/// The modules by the PDOs that they have in their slots.
fn pdos_of_modules<'a>(modules: &'a [PlacedModule<'a>]) -> BTreeMap<u16, &'a PlacedModule<'a>> {
    let pdos = modules.iter().flat_map(|placed| {
        let own = placed.module.rx_pdos.iter().chain(&placed.module.tx_pdos);
        own.filter_map(move |pdo| Some((placed.index(pdo.index)?, placed)))
    });
    pdos.collect()
}

fn sync_manager(
    of: &SelectedSyncManager<'_>,
    modules: &BTreeMap<u16, &PlacedModule<'_>>,
    language: u32,
) -> SyncManager {
    SyncManager {
        number: of.number,
        direction: if of.outputs { model::Direction::Outputs } else { model::Direction::Inputs },
        start: of.definition.start,
        control: of.definition.control,
        op_only: of.definition.op_only,
        pdo: of.pdos.iter().map(|of| pdo(of, modules, language)).collect(),
        ..SyncManager::default()
    }
}

fn pdo(of: &esi::Pdo, modules: &BTreeMap<u16, &PlacedModule<'_>>, language: u32) -> Pdo {
    let of_module = modules.get(&of.index.index).map(|placed| placed.pdo_name(of, language));
    Pdo {
        index: of.index.index,
        name: printable(of_module.as_deref().unwrap_or_else(|| of.name.in_language(language))),
        fixed: of.is_fixed,
        entries: Some(
            of.entries.iter().filter(|entry| entry.bit_length > 0).flat_map(|of| entry(of, language)).collect(),
        ),
    }
}

/// An entry; of a long one the first part has the name, and the others are gaps.
fn entry(of: &esi::PdoEntry, language: u32) -> Vec<Entry> {
    let whole = Entry {
        index: of.index.index,
        sub: if of.index.index == 0 { 0 } else { of.sub_index },
        bits: of.bit_length.min(ENTRY_BITS) as u8,
        name: if of.index.index == 0 { String::new() } else { printable(of.name.in_language(language)) },
        data_type: if of.index.index == 0 { String::new() } else { of.data_type.clone() },
    };
    if of.bit_length <= u8::MAX.into() {
        return vec![Entry { bits: of.bit_length as u8, ..whole }];
    }
    let parts = (0..of.bit_length).step_by(ENTRY_BITS.into()).skip(1);
    let gaps = parts.map(|begin| Entry { bits: (of.bit_length - begin).min(ENTRY_BITS) as u8, ..Entry::default() });
    std::iter::once(whole).chain(gaps).collect()
}

pub(super) fn printable(text: &str) -> String {
    let text: String = text.chars().filter(|character| !character.is_control()).collect();
    text.trim().to_owned()
}

/// SYNC signals of the mode; a mode with LATCH units only is a register.
fn clock(selection: &Selection<'_>, mode: &OpMode, cycle: Duration, into: &mut SubDevice) -> Result<(), EsiError> {
    let assign_activate = mode.assign_activate;
    let (has_sync0, has_sync1) = mode.signals();
    if !has_sync0 && !has_sync1 {
        if assign_activate != 0 {
            let data = Bytes(assign_activate.to_le_bytes().to_vec());
            let write = Write { address: ASSIGN_ACTIVATE, data, retries: 3, required: true };
            let comment = Some(format!("operation mode {}", mode.name.trim()));
            into.startup.push(Startup { at: At::Ps, write: Some(write), comment, ..Startup::default() });
        }
        return Ok(());
    }
    let bus = u32::try_from(cycle.as_nanos()).unwrap_or(u32::MAX);
    let wrong = |what: &str, ns: i64| {
        let reason = format!(
            "operation mode \"{}\": {what} of {ns} ns in a cycle of {bus} ns, which no controller generates",
            mode.name.trim()
        );
        EsiError::rule(&selection.esi.file, mode.line, selection.device.kind.trim(), reason)
    };
    let cycle_of = |ns: i64| if ns == 0 { i64::from(bus) } else { ns };
    let sync0 = cycle_of(mode.sync0_cycle_ns(bus));
    let shift0 = mode.sync0_shift_ns(bus);
    let (sync1, shift1) = match has_sync1 {
        true => (mode.sync1_cycle_ns(bus), mode.sync1_shift_ns(bus)),
        false => (0, 0),
    };
    let limit = i64::from(i32::MAX);
    if mode.cycle_0.factor.is_some_and(|factor| factor < 0 && i64::from(bus) % -i64::from(factor) != 0) {
        return Err(wrong("a cycle of SYNC0", sync0));
    }
    if !(1..=limit).contains(&sync0) {
        return Err(wrong("a cycle of SYNC0", sync0));
    }
    if !(0..=limit).contains(&sync1) || sync1 % sync0 != 0 {
        return Err(wrong("a cycle of SYNC1", sync1));
    }
    if shift0.abs() > limit || shift1.abs() > limit {
        return Err(wrong("a shift", shift0));
    }
    into.sync = Some(Sync {
        assign_activate,
        sync0_cycle: Shift(sync0),
        sync0_shift: Shift(shift0),
        sync1_cycle: Shift(sync1),
        sync1_shift: Shift(shift1),
    });
    Ok(())
}

/// What a network file does not hold of the settings of clocks (protocol ES-63).
fn clock_notices(device: &Device, mode: &OpMode, sync: Option<&Sync>, from: &mut Notes) {
    let Some(clock) = &device.clock else { return };
    if clock.is_32_bit {
        from.note("Unknown64Bit: the registers of its clock decide whether it has 32 or 64 bits".into());
    }
    if clock.external_reference {
        from.note("ExternalRefClock: choose the reference clock by `reference` of the table `clocks`".into());
    }
    let shift = sync.map_or(0, |sync| sync.sync0_shift.0);
    if mode.shift_0_for_inputs && shift != 0 {
        let mode = mode.name.trim();
        from.note(format!(
            "operation mode \"{mode}\": the shift of SYNC0 of {shift} ns refers to inputs, it counts from the \
             beginning of the cycle"
        ));
    }
}

/// A start-up command; `None` if it cannot be sent, with a notice.
fn startup(of: &SelectedCommand, from: &mut Notes) -> Option<Startup> {
    let at = match of.transition {
        Transition::Ip => At::Ip,
        Transition::Ps => At::Ps,
        Transition::So => At::So,
        Transition::Sp => At::Sp,
        Transition::Os => At::Os,
        Transition::Op => {
            from.note(format!("InitCmd \"{}\" at OP: not sent, a change from OP to PREOP passes SAFEOP", of.comment));
            return None;
        }
    };
    let comment = Some(printable(&of.comment)).filter(|comment| !comment.is_empty());
    let after_pdos = at == At::Ps && !of.before_pdos;
    let mut startup = Startup { at, after_pdos, comment, ..Startup::default() };
    match &of.message {
        SelectedMessage::Sdo(_, _, _, data) | SelectedMessage::Idn(_, _, data) if data.is_empty() => {
            from.note(format!("InitCmd \"{}\" without Data: not sent", of.comment));
            return None;
        }
        SelectedMessage::Sdo(index, sub, complete, data) => {
            let data = Bytes(data.clone());
            startup.sdo = Some(Sdo { index: *index, sub: *sub, complete: *complete, data });
        }
        SelectedMessage::Idn(drive, idn, data) => {
            startup.idn = Some(Idn { drive: *drive, idn: *idn, data: Bytes(data.clone()) });
        }
        SelectedMessage::Eoe(data) => match ip::settings(data) {
            Ok(settings) => startup.ip = Some(model::Ip::from(settings)),
            Err(reason) => {
                from.note(format!("InitCmd \"{}\" of EoE: {reason}", of.comment));
                return None;
            }
        },
        SelectedMessage::Aoe(data) if MailMessage::Aoe(data.clone()).is_sound() => {
            startup.aoe = Some(Bytes(data.clone()));
        }
        SelectedMessage::Aoe(_) => {
            from.note(format!("InitCmd \"{}\" of AoE: no AMS header with a request, not sent", of.comment));
            return None;
        }
    }
    Some(startup)
}
