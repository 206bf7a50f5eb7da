//! The categories of an image from a description (protocol ES-82 to ES-100).

use ringcat_wire::sii::{
    CoeDetails, DcMode, General, GeneralFlags, Pdo as SiiPdo, PdoEntry as SiiEntry, PhysicalPort, SiiSyncManager,
    SyncManagerKind as SiiKind,
};

use super::data_type::code_of;
use super::profile::{SiiOptions, SiiProfile};
use super::strings::Strings;
use crate::esi::model::{Device, FmmuRole, Group, Mailbox, OpMode, Pdo, ScaledTime, SyncManager, SyncManagerRole};

/// No SyncManager.
const NOT_ASSIGNED: u8 = 0xFF;
/// A sync unit that tolerates repeated frames.
const FRAME_REPEAT: u8 = 0xF0;

/// Builds categories in one order of strings.
pub(super) struct Builder<'a> {
    device: &'a Device,
    group: Option<&'a Group>,
    options: &'a SiiOptions,
    pub strings: Strings,
    indices: Indices,
}

/// Indices of the strings of the general category.
#[derive(Default)]
struct Indices {
    order: u8,
    group: u8,
    group_name: u8,
    name: u8,
    image: u8,
}

impl<'a> Builder<'a> {
    pub fn new(device: &'a Device, group: Option<&'a Group>, options: &'a SiiOptions) -> Builder<'a> {
        let strings = Strings::new(options.profile != SiiProfile::Siitool);
        Builder { device, group, options, strings, indices: Indices::default() }
    }

    fn is_siitool(&self) -> bool {
        self.options.profile == SiiProfile::Siitool
    }

    fn text(&self, names: &'a crate::esi::model::Names) -> &'a str {
        names.in_language(self.options.language)
    }

    /// All categories but the strings, in their order.
    pub fn all(&mut self) -> Vec<(u16, Vec<u8>)> {
        let device = self.device;
        self.add_heading();
        if self.is_siitool() {
            return self.all_of_siitool();
        }
        let modes = self.modes();
        let (tx, rx) = if self.options.without_pdos {
            (Vec::new(), Vec::new())
        } else {
            (self.pdos(&device.tx_pdos), self.pdos(&device.rx_pdos))
        };
        let general = self.general();
        vec![
            (30, general),
            (40, self.fmmus()),
            (41, self.sync_managers()),
            (43, self.sync_units()),
            (50, tx.concat()),
            (51, rx.concat()),
            (60, modes.concat()),
        ]
    }

    /// A category per PDO and per mode; strings in another order (protocol ES-89, ES-97).
    fn all_of_siitool(&mut self) -> Vec<(u16, Vec<u8>)> {
        let device = self.device;
        let rx = self.pdos(&device.rx_pdos);
        let tx = self.pdos(&device.tx_pdos);
        let modes = self.modes();
        let general = self.general();
        let head = [(30, general), (40, self.fmmus()), (41, self.sync_managers())];
        let tx = tx.into_iter().map(|data| (50, data));
        let rx = rx.into_iter().map(|data| (51, data));
        head.into_iter().chain(tx).chain(rx).chain(modes.into_iter().map(|data| (60, data))).collect()
    }

    /// The strings of the device, before those of modes and PDOs.
    fn add_heading(&mut self) {
        let name = self.text(&self.device.name);
        if self.is_siitool() {
            self.indices.group = self.strings.add(&self.device.group);
            self.indices.group_name = self.indices.group;
            self.indices.name = self.strings.add(name);
            return;
        }
        let group_name = self.group.map(|group| self.text(&group.name)).unwrap_or_default();
        self.indices.order = self.strings.add(&self.device.kind);
        self.indices.group = self.strings.add(&self.device.group);
        if self.options.profile != SiiProfile::RtLabs {
            self.indices.group_name = self.strings.add(group_name);
        }
        self.indices.name = self.strings.add(name);
        self.indices.image = self.strings.add(&self.device.image);
    }

    fn general(&self) -> Vec<u8> {
        let Device { info, mailbox, .. } = self.device;
        let supports = |of: fn(&Mailbox) -> bool| u8::from(mailbox.as_ref().is_some_and(of));
        let profile = self.options.profile;
        let layer = self.options.physical_layer.unwrap_or_else(|| profile.physical_layer(&self.device.physics));
        let is_full = matches!(profile, SiiProfile::TwinCat | SiiProfile::Plain);
        let current = info.ebus_current_ma.unwrap_or(0).clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        General {
            group: self.indices.group,
            image: self.indices.image,
            order: self.indices.order,
            name: self.indices.name,
            reserved_04: layer,
            coe: self.coe(),
            foe: supports(|mailbox| mailbox.foe),
            eoe: supports(|mailbox| mailbox.eoe.is_some()),
            flags: GeneralFlags(if is_full { self.flags() } else { 0 }),
            ebus_current_ma: if self.is_siitool() { 0 } else { current },
            group_again: self.indices.group_name,
            physical_ports: if profile == SiiProfile::RtLabs { 0 } else { ports(&self.device.physics) },
            id_switch_address: if is_full { info.identification_address.unwrap_or(0) } else { 0 },
            ..General::default()
        }
        .encode()
        .to_vec()
    }

    fn flags(&self) -> u8 {
        let Device { info, mailbox, .. } = self.device;
        [
            (info.safeop_without_sync, GeneralFlags::ENABLE_SAFEOP),
            (self.device.use_lrd_lwr, GeneralFlags::NOT_LRW),
            (mailbox.as_ref().is_some_and(|it| it.data_link_layer), GeneralFlags::MAILBOX_DATA_LINK_LAYER),
            (info.identification_al_status, GeneralFlags::IDENTIFICATION_AL_STATUS_CODE),
            (info.identification_address.is_some(), GeneralFlags::IDENTIFICATION_MEMORY),
        ]
        .into_iter()
        .filter(|(is_set, _)| *is_set)
        .fold(0, |all, (_, bit)| all | bit)
    }

    fn coe(&self) -> CoeDetails {
        let Some(coe) = self.device.mailbox.as_ref().and_then(|mailbox| mailbox.coe.as_ref()) else {
            return CoeDetails(0);
        };
        let bits = [
            (true, CoeDetails::SDO),
            (coe.sdo_info, CoeDetails::SDO_INFORMATION),
            (coe.pdo_assign, CoeDetails::PDO_ASSIGN),
            (coe.pdo_config, CoeDetails::PDO_CONFIGURATION),
            (coe.pdo_upload, CoeDetails::UPLOAD_AT_STARTUP),
            (coe.complete_access && !self.is_siitool(), CoeDetails::COMPLETE_ACCESS),
        ];
        CoeDetails(bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |all, (_, bit)| all | bit))
    }

    fn fmmus(&self) -> Vec<u8> {
        let code = |role| match role {
            FmmuRole::Outputs => 1,
            FmmuRole::Inputs => 2,
            FmmuRole::MailboxState => 3,
            FmmuRole::Unused => 0,
        };
        self.device.fmmus.iter().map(|fmmu| code(fmmu.role)).collect()
    }

    fn sync_managers(&self) -> Vec<u8> {
        let with_op_only = !self.is_siitool();
        self.device.sync_managers.iter().flat_map(|sm| sync_manager(sm, with_op_only).encode()).collect()
    }

    /// Present exactly where a sync unit tolerates repeated frames (protocol ES-78).
    fn sync_units(&self) -> Vec<u8> {
        let units = &self.device.sync_units;
        if self.options.profile == SiiProfile::RtLabs || !units.iter().any(|unit| unit.frame_repeat) {
            return Vec::new();
        }
        units.iter().map(|unit| if unit.frame_repeat { FRAME_REPEAT } else { 0 }).collect()
    }

    /// PDOs of one direction, each with its entries; their strings follow each other.
    fn pdos(&mut self, pdos: &'a [Pdo]) -> Vec<Vec<u8>> {
        pdos.iter().map(|pdo| self.pdo(pdo)).collect()
    }

    fn pdo(&mut self, pdo: &'a Pdo) -> Vec<u8> {
        let name = self.strings.add(self.text(&pdo.name));
        let unassigned = if self.is_siitool() { 0 } else { NOT_ASSIGNED };
        let flags = if self.options.profile == SiiProfile::RtLabs { 0 } else { pdo_flags(pdo) };
        let index = pdo.index.index.to_le_bytes();
        let [low, high] = flags.to_le_bytes();
        let count = pdo.entries.len() as u8;
        let mut data = vec![index[0], index[1], count, pdo.sync_manager.unwrap_or(unassigned), 0, name, low, high];
        for entry in &pdo.entries {
            let code = code_of(&entry.data_type).and_then(|code| u8::try_from(code).ok());
            let entry = SiiEntry {
                index: entry.index.index,
                sub_index: entry.sub_index,
                name: self.strings.add(self.text(&entry.name)),
                data_type: if self.options.profile == SiiProfile::RtLabs { 0 } else { code.unwrap_or(0) },
                bit_length: entry.bit_length as u8,
                flags: 0,
            };
            data.extend_from_slice(&entry.encode());
        }
        data
    }

    fn modes(&mut self) -> Vec<Vec<u8>> {
        let modes = self.device.clock.as_ref().map_or(&[][..], |clock| &clock.modes);
        modes.iter().map(|mode| self.mode(mode)).collect()
    }

    fn mode(&mut self, mode: &OpMode) -> Vec<u8> {
        let factor = |time: ScaledTime| time.factor.unwrap_or(0) as i16;
        let name = self.strings.add(&mode.name);
        let describes = matches!(self.options.profile, SiiProfile::Siitool | SiiProfile::Plain);
        let mode = DcMode {
            sync0_cycle_ns: mode.cycle_0.ns as u32,
            sync0_shift_ns: mode.shift_0.ns as u32,
            sync1_shift_ns: mode.shift_1.ns as u32,
            sync1_cycle_factor: if self.options.sync1_factor { factor(mode.cycle_1) } else { 0 },
            assign_activate: mode.assign_activate,
            sync0_cycle_factor: factor(mode.cycle_0),
            name,
            description: if describes { self.strings.add(&mode.description) } else { 0 },
            reserved: [0; 4],
        };
        mode.encode().to_vec()
    }
}

/// A nibble per port, port A lowest (protocol ES-79).
fn ports(physics: &str) -> u16 {
    let nibble = |letter| match letter {
        'Y' => PhysicalPort::Mii.code(),
        'K' => PhysicalPort::Ebus.code(),
        'H' => PhysicalPort::FastHotConnect.code(),
        _ => 0,
    };
    physics.chars().take(4).enumerate().fold(0, |word, (port, letter)| word | u16::from(nibble(letter)) << (4 * port))
}

fn sync_manager(sm: &SyncManager, with_op_only: bool) -> SiiSyncManager {
    let bits = [
        (sm.enable, SiiSyncManager::ENABLE),
        (sm.fixed_assignment, SiiSyncManager::FIXED_CONTENT),
        (sm.is_virtual, SiiSyncManager::VIRTUAL),
        (sm.op_only && with_op_only, SiiSyncManager::OP_ONLY),
    ];
    SiiSyncManager {
        start: sm.start.unwrap_or(0),
        length: sm.default_size.unwrap_or(0),
        control: sm.control.unwrap_or(0),
        status: 0,
        enable: bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |all, (_, bit)| all | bit),
        kind: match sm.role {
            SyncManagerRole::MailboxOut => SiiKind::MailboxOut,
            SyncManagerRole::MailboxIn => SiiKind::MailboxIn,
            SyncManagerRole::Outputs => SiiKind::Outputs,
            SyncManagerRole::Inputs => SiiKind::Inputs,
            SyncManagerRole::Unused => SiiKind::Unused,
        },
    }
}

fn pdo_flags(pdo: &Pdo) -> u16 {
    [
        (pdo.is_mandatory, SiiPdo::MANDATORY),
        (pdo.oversampling.is_some(), SiiPdo::OVERSAMPLING),
        (pdo.is_fixed, SiiPdo::FIXED),
        (pdo.is_virtual, SiiPdo::VIRTUAL),
        (pdo.index.by_slot, SiiPdo::BY_SLOT),
        (pdo.index.by_group, SiiPdo::BY_SLOT_GROUP),
        (pdo.overwritten_by_module, SiiPdo::OVERWRITTEN_BY_MODULE),
    ]
    .into_iter()
    .filter(|(is_set, _)| *is_set)
    .fold(0, |all, (_, bit)| all | bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-38, ES-79, ES-172
    #[test]
    fn physics_is_a_nibble_per_port() {
        for (physics, word) in [
            ("YY", 0x0011),
            ("KK", 0x0033),
            ("YKY", 0x0131),
            ("K KY", 0x1303),
            ("Y YY", 0x1101),
            ("KYKY", 0x1313),
            (" Y", 0x0010),
            ("H", 0x0004),
            ("", 0),
        ] {
            assert_eq!(ports(physics), word, "{physics:?}");
        }
    }
}
