//! A device description from an image: everything that an SII contains (protocol ES-105). Exclude, start-up commands,
//! dictionaries, modules and further languages are not in an SII.

mod lost;

use std::fmt::{self, Write};

use ringcat_wire::sii::{
    FmmuUsage, General, MailboxLayout, MailboxProtocols, Pdo, PdoDirection, PhysicalPort, Sii, SiiError, SiiHeader,
    SiiSyncManager, Strings, SyncManagerKind,
};

use super::data_type::name_of;
use lost::GENERATED;

/// A sync unit that tolerates repeated frames.
const FRAME_REPEAT: u8 = 0xF0;
/// Protocols that have an element.
const PROTOCOLS: u16 = MailboxProtocols::AOE
    | MailboxProtocols::EOE
    | MailboxProtocols::COE
    | MailboxProtocols::FOE
    | MailboxProtocols::SOE
    | MailboxProtocols::VOE;

/// A description made of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skeleton {
    /// Its text.
    pub text: String,
    /// What a description cannot express of the image, its individual fields (alias, serial number, production data)
    /// aside.
    pub notices: Vec<String>,
}

/// The description of the device with this image.
///
/// # Errors
/// [`SiiError`]: bytes that are not an SII image.
pub fn skeleton(image: &[u8]) -> Result<Skeleton, SiiError> {
    let sii = Sii::parse(image)?;
    let mut out = Xml { text: String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"), depth: 0 };
    // Writing to a string cannot fail.
    let _ = document(&mut out, &sii, image);
    let mut notices = not_expressible(&sii);
    notices.extend(lost::notices(image, &sii, &out.text));
    Ok(Skeleton { text: out.text, notices })
}

/// Elements with their indentation.
struct Xml {
    text: String,
    depth: usize,
}

impl Xml {
    fn line(&mut self, text: fmt::Arguments<'_>) -> fmt::Result {
        writeln!(self.text, "{:width$}{text}", "", width = 2 * self.depth)
    }

    fn open(&mut self, tag: fmt::Arguments<'_>) -> fmt::Result {
        self.line(format_args!("<{tag}>"))?;
        self.depth += 1;
        Ok(())
    }

    fn close(&mut self, name: &str) -> fmt::Result {
        self.depth = self.depth.saturating_sub(1);
        self.line(format_args!("</{name}>"))
    }

    fn leaf(&mut self, name: &str, text: impl fmt::Display) -> fmt::Result {
        let text = escaped(&text.to_string());
        self.line(format_args!("<{name}>{text}</{name}>"))
    }
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            control if control.is_control() => out.push(' '),
            other => out.push(other),
        }
    }
    out
}

fn text(strings: &Strings<'_>, index: u8) -> String {
    strings.string(index).unwrap_or_default().iter().map(|byte| char::from(*byte)).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn document(out: &mut Xml, sii: &Sii<'_>, image: &[u8]) -> fmt::Result {
    let strings = sii.strings();
    let general = sii.general().unwrap_or_default();
    let header = sii.header();
    let group = text(&strings, general.group);
    let group_name = text(&strings, general.group_again);
    let vendor = format!("Vendor {:#010x}", header.identity.vendor_id);
    out.open(format_args!("EtherCATInfo Version=\"1.2\""))?;
    out.open(format_args!("Vendor"))?;
    out.leaf("Id", format_args!("#x{:08X}", header.identity.vendor_id))?;
    out.leaf("Name", vendor)?;
    out.close("Vendor")?;
    out.open(format_args!("Descriptions"))?;
    out.open(format_args!("Groups"))?;
    out.open(format_args!("Group"))?;
    out.leaf("Type", &group)?;
    out.leaf("Name", if group_name.is_empty() { &group } else { &group_name })?;
    out.close("Group")?;
    out.close("Groups")?;
    out.open(format_args!("Devices"))?;
    device(out, sii, &general, image)?;
    out.close("Devices")?;
    out.close("Descriptions")?;
    out.close("EtherCATInfo")
}

fn device(out: &mut Xml, sii: &Sii<'_>, general: &General, image: &[u8]) -> fmt::Result {
    let strings = sii.strings();
    let identity = sii.header().identity;
    let [order, name, group] = [general.order, general.name, general.group].map(|index| text(&strings, index));
    let kind = [&order, &name].into_iter().find(|text| !text.is_empty()).map_or("Device", |text| text.as_str());
    out.open(format_args!("Device Physics=\"{}\"", physics(general)))?;
    let lrw = if general.flags.not_lrw() { " UseLrdLwr=\"1\"" } else { "" };
    out.line(format_args!(
        "<Type ProductCode=\"#x{:08X}\" RevisionNo=\"#x{:08X}\"{lrw}>{}</Type>",
        identity.product_code,
        identity.revision,
        escaped(kind)
    ))?;
    out.leaf("Name", if name.is_empty() { kind } else { &name })?;
    info(out, general)?;
    out.leaf("GroupType", group)?;
    fmmus_and_sync_managers(out, sii)?;
    for direction in [PdoDirection::Rx, PdoDirection::Tx] {
        pdos(out, sii, direction)?;
    }
    mailbox(out, sii, general)?;
    clock(out, sii)?;
    if !text(&strings, general.image).is_empty() {
        out.leaf("Image16x14", text(&strings, general.image))?;
    }
    eeprom(out, sii, image)?;
    out.close("Device")
}

fn physics(general: &General) -> String {
    let letters = general.ports().map(|port| match port {
        PhysicalPort::Mii => 'Y',
        PhysicalPort::Ebus => 'K',
        PhysicalPort::FastHotConnect => 'H',
        PhysicalPort::Unused | PhysicalPort::Other(_) => ' ',
    });
    letters.iter().collect::<String>().trim_end().to_owned()
}

fn info(out: &mut Xml, general: &General) -> fmt::Result {
    out.open(format_args!("Info"))?;
    if general.ebus_current_ma != 0 {
        let current = general.ebus_current_ma;
        out.line(format_args!("<Electrical><EBusCurrent>{current}</EBusCurrent></Electrical>"))?;
    }
    if general.flags.enable_safeop() {
        out.line(format_args!("<StateMachine><Behavior StartToSafeopNoSync=\"1\"/></StateMachine>"))?;
    }
    if general.flags.identification_memory() {
        out.leaf("IdentificationAdo", format_args!("#x{:04X}", general.id_switch_address))?;
    }
    if general.flags.identification_al_status_code() {
        out.leaf("IdentificationReg134", 1)?;
    }
    out.close("Info")
}

fn fmmus_and_sync_managers(out: &mut Xml, sii: &Sii<'_>) -> fmt::Result {
    let fmmus: Vec<FmmuUsage> = sii.fmmu_usages().collect();
    // A padding byte is no FMMU.
    let count = fmmus.iter().rposition(|usage| *usage != FmmuUsage::Unused).map_or(0, |last| last + 1);
    for usage in &fmmus[..count] {
        let role = match usage {
            FmmuUsage::Outputs => "Outputs",
            FmmuUsage::Inputs => "Inputs",
            FmmuUsage::MailboxStatus => "MBoxState",
            FmmuUsage::Unused | FmmuUsage::Other(_) => "",
        };
        out.leaf("Fmmu", role)?;
    }
    for sm in sii.sync_managers() {
        let role = match sm.kind {
            SyncManagerKind::MailboxOut => "MBoxOut",
            SyncManagerKind::MailboxIn => "MBoxIn",
            SyncManagerKind::Outputs => "Outputs",
            SyncManagerKind::Inputs => "Inputs",
            SyncManagerKind::Unused | SyncManagerKind::Other(_) => "",
        };
        let bit = |mask: u8, name: &str| match sm.enable & mask {
            0 => String::new(),
            _ => format!(" {name}=\"1\""),
        };
        out.line(format_args!(
            "<Sm DefaultSize=\"{}\" StartAddress=\"#x{:04X}\" ControlByte=\"#x{:02X}\" Enable=\"{}\"{}{}{}>{role}</Sm>",
            sm.length,
            sm.start,
            sm.control,
            u8::from(sm.is_enabled()),
            bit(SiiSyncManager::FIXED_CONTENT, "FixedAssignment"),
            bit(SiiSyncManager::VIRTUAL, "Virtual"),
            bit(SiiSyncManager::OP_ONLY, "OpOnly"),
        ))?;
    }
    let units: Vec<u8> = sii.categories().filter(|it| it.kind.code() == 43).flat_map(|it| it.data).copied().collect();
    // Bytes after the last such unit may be padding.
    let count = units.iter().rposition(|unit| *unit == FRAME_REPEAT).map_or(0, |last| last + 1);
    for unit in &units[..count] {
        out.line(format_args!("<Su{}/>", if *unit == FRAME_REPEAT { " FrameRepeatSupport=\"1\"" } else { "" }))?;
    }
    Ok(())
}

fn pdos(out: &mut Xml, sii: &Sii<'_>, direction: PdoDirection) -> fmt::Result {
    let strings = sii.strings();
    let name = match direction {
        PdoDirection::Rx => "RxPdo",
        PdoDirection::Tx => "TxPdo",
    };
    for pdo in sii.pdos(direction) {
        let flag = |mask: u16, name: &str| if pdo.flags & mask == 0 { String::new() } else { format!(" {name}=\"1\"") };
        let sm = pdo.sync_manager.map(|number| format!(" Sm=\"{number}\"")).unwrap_or_default();
        let flags = [
            flag(Pdo::FIXED, "Fixed"),
            flag(Pdo::MANDATORY, "Mandatory"),
            flag(Pdo::VIRTUAL, "Virtual"),
            // The image does not have the factor.
            flag(Pdo::OVERSAMPLING, "OSFac"),
            flag(Pdo::OVERWRITTEN_BY_MODULE, "OverwrittenByModule"),
        ];
        let slot = [flag(Pdo::BY_SLOT, "DependOnSlot"), flag(Pdo::BY_SLOT_GROUP, "DependOnSlotGroup")].concat();
        out.open(format_args!("{name}{}{sm}", flags.concat()))?;
        out.line(format_args!("<Index{slot}>#x{:04X}</Index>", pdo.index))?;
        out.leaf("Name", text(&strings, pdo.name))?;
        for entry in pdo.entries() {
            out.open(format_args!("Entry"))?;
            out.leaf("Index", format_args!("#x{:04X}", entry.index))?;
            if !entry.is_gap() || entry.sub_index != 0 {
                out.leaf("SubIndex", entry.sub_index)?;
            }
            out.leaf("BitLen", entry.bit_length)?;
            if entry.name != 0 {
                out.leaf("Name", text(&strings, entry.name))?;
            }
            let data_type = name_of(entry.data_type.into());
            if !data_type.is_empty() {
                out.leaf("DataType", data_type)?;
            }
            out.close("Entry")?;
        }
        out.close(name)?;
    }
    Ok(())
}

/// Whether the fixed area has mailboxes or protocols: a device may have mailboxes without any protocol.
fn has_mailbox(sii: &Sii<'_>) -> bool {
    let header = sii.header();
    header.protocols.0 != 0 || header.standard_mailbox != MailboxLayout::default()
}

/// What a description cannot express: it has only the mailboxes of its SyncManagers, and protocols with an element.
fn not_expressible(sii: &Sii<'_>) -> Vec<String> {
    if !has_mailbox(sii) {
        return Vec::new();
    }
    let SiiHeader { standard_mailbox: own, protocols, .. } = sii.header();
    let of = |kind: SyncManagerKind| {
        sii.sync_managers().find(|sm| sm.kind == kind).map_or((0, 0), |sm| (sm.start, sm.length))
    };
    let (write, read) = (of(SyncManagerKind::MailboxOut), of(SyncManagerKind::MailboxIn));
    let mut notices = Vec::new();
    if (own.receive_offset, own.receive_size) != write || (own.send_offset, own.send_size) != read {
        let word = |(start, length): (u16, u16)| format!("{start:#06x} ({length} bytes)");
        let own = [word((own.receive_offset, own.receive_size)), word((own.send_offset, own.send_size))];
        notices.push(format!(
            "the mailboxes of the fixed area, {}, are not those of the SyncManagers, {} and {}, which the description \
             has",
            own.join(" and "),
            word(write),
            word(read)
        ));
    }
    let without_element = protocols.0 & !PROTOCOLS;
    if without_element != 0 {
        notices.push(format!("the protocols {without_element:#06x} have no element in a description"));
    }
    notices
}

fn mailbox(out: &mut Xml, sii: &Sii<'_>, general: &General) -> fmt::Result {
    if !has_mailbox(sii) {
        return Ok(());
    }
    let protocols = sii.header().protocols;
    let link = if general.flags.mailbox_data_link_layer() { " DataLinkLayer=\"true\"" } else { "" };
    out.open(format_args!("Mailbox{link}"))?;
    let mut protocol = |is_there: bool, name: &str| if is_there { out.line(format_args!("<{name}/>")) } else { Ok(()) };
    protocol(protocols.aoe(), "AoE")?;
    protocol(protocols.eoe(), "EoE")?;
    if protocols.coe() {
        let coe = general.coe;
        let flag = |is_set: bool, name: &str| if is_set { format!(" {name}=\"1\"") } else { String::new() };
        let features = [
            flag(coe.sdo_information(), "SdoInfo"),
            flag(coe.pdo_assign(), "PdoAssign"),
            flag(coe.pdo_configuration(), "PdoConfig"),
            flag(coe.upload_at_startup(), "PdoUpload"),
            flag(coe.complete_access(), "CompleteAccess"),
        ];
        out.line(format_args!("<CoE{}/>", features.concat()))?;
    }
    let mut protocol = |is_there: bool, name: &str| if is_there { out.line(format_args!("<{name}/>")) } else { Ok(()) };
    protocol(protocols.foe(), "FoE")?;
    protocol(protocols.soe(), "SoE")?;
    protocol(protocols.voe(), "VoE")?;
    out.close("Mailbox")
}

fn clock(out: &mut Xml, sii: &Sii<'_>) -> fmt::Result {
    let strings = sii.strings();
    let modes: Vec<_> = sii.dc_modes().collect();
    if modes.is_empty() {
        return Ok(());
    }
    out.open(format_args!("Dc"))?;
    for mode in modes {
        out.open(format_args!("OpMode"))?;
        out.leaf("Name", text(&strings, mode.name))?;
        if mode.description != 0 {
            out.leaf("Desc", text(&strings, mode.description))?;
        }
        out.leaf("AssignActivate", format_args!("#x{:04X}", mode.assign_activate))?;
        let time = |name: &str, ns: i64, factor: i16| format!("<{name} Factor=\"{factor}\">{ns}</{name}>");
        out.line(format_args!("{}", time("CycleTimeSync0", mode.sync0_cycle_ns.into(), mode.sync0_cycle_factor)))?;
        out.leaf("ShiftTimeSync0", mode.sync0_shift_ns as i32)?;
        out.line(format_args!("{}", time("CycleTimeSync1", 0, mode.sync1_cycle_factor)))?;
        out.leaf("ShiftTimeSync1", mode.sync1_shift_ns as i32)?;
        out.close("OpMode")?;
    }
    out.close("Dc")
}

fn eeprom(out: &mut Xml, sii: &Sii<'_>, image: &[u8]) -> fmt::Result {
    let header = sii.header();
    out.open(format_args!("Eeprom"))?;
    out.leaf("ByteSize", header.size_bytes())?;
    out.leaf("ConfigData", hex(&image[..14]))?;
    let bootstrap = header.bootstrap_mailbox.encode();
    if bootstrap != [0; 8] {
        out.leaf("BootStrap", hex(&bootstrap))?;
    }
    for category in sii.categories() {
        let code = category.kind.code();
        if !GENERATED.contains(&code) {
            let data = hex(category.data);
            out.line(format_args!("<Category><CatNo>{code}</CatNo><Data>{data}</Data></Category>"))?;
        }
    }
    out.close("Eeprom")
}
