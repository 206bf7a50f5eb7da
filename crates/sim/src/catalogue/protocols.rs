//! Devices for mailbox tests: one with every protocol, an Ethernet terminal, a SERCOS drive.

use core::time::Duration;

use ringcat_wire::mailbox::coe::{AccessRights, DataType};
use ringcat_wire::mailbox::soe::{Idn, IdnAttribute};
use ringcat_wire::sii::{
    CoeDetails, FmmuUsage, Identity, MailboxLayout, MailboxProtocols, PdoDirection, SyncManagerKind,
};

use super::parts::VENDOR_ID;
use super::parts::{FIXED_MANDATORY, entry, pdo, sync_manager};
use crate::application::dictionary::{Access, Entry, Object, history};
use crate::application::soe::idn::IdnObject;
use crate::application::{Behaviour, InputSource};
use crate::description::{DeviceDescription, MailboxDescription, data_type};

const MAILBOX_SIZE: u16 = 1024;
const BOOT_MAILBOX_SIZE: u16 = 512;
const RECEIVE_START: u16 = 0x1000;
const SEND_START: u16 = RECEIVE_START + MAILBOX_SIZE;
const OUTPUTS_START: u16 = SEND_START + MAILBOX_SIZE;
const INPUTS_START: u16 = OUTPUTS_START + 0x100;
/// Bytes of the large object.
pub const LARGE_OBJECT_BYTES: usize = 100_000;
/// Capacity of the diagnosis history.
const DIAGNOSIS_MESSAGES: u8 = 20;

const fn layout(size: u16) -> MailboxLayout {
    MailboxLayout { receive_offset: RECEIVE_START, receive_size: size, send_offset: SEND_START, send_size: size }
}

/// A device with a mailbox of 1,024 bytes, a BOOT mailbox of 512 bytes, and four bytes of inputs and outputs.
fn device(name: &str, product_code: u32, protocols: u16) -> DeviceDescription {
    let identity = Identity { vendor_id: VENDOR_ID, product_code, revision: 0x0010_0000, serial: 0 };
    let mut description = DeviceDescription::plain(name, identity);
    description.group = "Mailbox".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus];
    let boots = protocols & MailboxProtocols::FOE != 0;
    description.mailbox = Some(MailboxDescription {
        standard: layout(MAILBOX_SIZE),
        bootstrap: if boots { layout(BOOT_MAILBOX_SIZE) } else { MailboxLayout::default() },
        protocols: MailboxProtocols(protocols),
        coe_details: CoeDetails(0),
        response_time: Duration::from_micros(200),
    });
    description.sync_managers = vec![
        sync_manager(RECEIVE_START, MAILBOX_SIZE, 0x26, SyncManagerKind::MailboxOut),
        sync_manager(SEND_START, MAILBOX_SIZE, 0x22, SyncManagerKind::MailboxIn),
        sync_manager(OUTPUTS_START, 4, 0x64, SyncManagerKind::Outputs),
        sync_manager(INPUTS_START, 4, 0x20, SyncManagerKind::Inputs),
    ];
    description.pdos = vec![
        pdo(
            PdoDirection::Rx,
            0x1600,
            "Outputs",
            Some(2),
            FIXED_MANDATORY,
            vec![entry(0x7000, 1, "Out", data_type::U32, 32)],
        ),
        pdo(
            PdoDirection::Tx,
            0x1A00,
            "Inputs",
            Some(3),
            FIXED_MANDATORY,
            vec![entry(0x6000, 1, "In", data_type::U32, 32)],
        ),
    ];
    description.behaviour = Behaviour::Terminal(InputSource::Outputs);
    description.sii_size_bytes = 1024;
    description
}

/// All protocols in one mailbox; a dictionary with all data types, arrays, records and a large object.
pub fn all_protocols(name: &str) -> DeviceDescription {
    let every = MailboxProtocols::AOE
        | MailboxProtocols::EOE
        | MailboxProtocols::COE
        | MailboxProtocols::FOE
        | MailboxProtocols::SOE
        | MailboxProtocols::VOE;
    let mut description = device(name, 0x0000_0A11, every);
    if let Some(mailbox) = &mut description.mailbox {
        let details = CoeDetails::SDO | CoeDetails::SDO_INFORMATION | CoeDetails::PDO_ASSIGN;
        mailbox.coe_details = CoeDetails(details | CoeDetails::COMPLETE_ACCESS);
    }
    description.objects = objects();
    description.services.foe.files = vec![("log.txt".into(), b"nothing happened\n".repeat(100))];
    description.services.soe.drives = vec![drive(), drive()];
    description
}

/// Ethernet over EtherCAT with an IP stack, and a dictionary.
pub fn ethernet_terminal(name: &str) -> DeviceDescription {
    let mut description = device(name, 0x19C9_3052, MailboxProtocols::EOE | MailboxProtocols::COE);
    let Some(mailbox) = &mut description.mailbox else {
        return description;
    };
    mailbox.coe_details = CoeDetails(CoeDetails::SDO | CoeDetails::SDO_INFORMATION);
    description
}

/// A drive with the SERCOS profile: two axes, files, no CoE.
pub fn soe_drive(name: &str) -> DeviceDescription {
    let mut description = device(name, 0x0000_50E1, MailboxProtocols::SOE | MailboxProtocols::FOE);
    description.group = "Drives".into();
    description.services.soe.drives = vec![drive(), drive()];
    description
}

/// The IDNs of one axis.
fn drive() -> Vec<IdnObject> {
    let signed = 2 << 20;
    let at_work = IdnAttribute::PROTECTED_SAFEOP | IdnAttribute::PROTECTED_OP;
    let number = |idn, name, bytes, value| IdnObject::number(Idn::standard(0, idn), name, bytes, value);
    let large: Vec<u8> = (0..5000u16).map(|place| (place % 251) as u8).collect();
    vec![
        number(1, "Control unit cycle time", 2, 1000).unit("us").within(250, 65_000).with_attribute(at_work),
        number(2, "Communication cycle time", 2, 1000).unit("us").within(250, 65_000).with_attribute(at_work),
        number(11, "Class 1 diagnostic", 2, 0).read_only(),
        number(15, "Telegram type", 2, 7).with_attribute(at_work),
        IdnObject::list(Idn::standard(0, 16), "Configuration list AT", 2, &[51, 0], 64).with_attribute(at_work),
        IdnObject::list(Idn::standard(0, 24), "Configuration list MDT", 2, &[47, 0], 64).with_attribute(at_work),
        IdnObject::list(Idn::standard(0, 30), "Manufacturer version", 1, b"1.0", 40).read_only(),
        number(36, "Velocity command value", 4, 0).unit("rpm").with_attribute(signed).within(-6000, 6000),
        number(47, "Position command value", 4, 0).unit("inc").with_attribute(signed),
        number(51, "Position feedback value", 4, 0).unit("inc").with_attribute(signed).read_only(),
        IdnObject::command(Idn::standard(0, 99), "Reset class 1 diagnostic", Duration::from_millis(5)),
        number(134, "Master control word", 2, 0),
        number(135, "Drive status word", 2, 0).read_only(),
        IdnObject::list(Idn::product(0, 1), "Characteristic", 1, &large, 20_000),
    ]
}

/// Objects of every kind.
fn objects() -> Vec<Object> {
    let numbered = (1..=u8::MAX).zip(DataType::ALL);
    let every_type = numbered.map(|(sub_index, data_type)| {
        let value = data_type.bits().map_or(&b"text"[..], |bits| &[0; 16][..usize::from(bits).div_ceil(8)]);
        Entry::new(sub_index, data_type.0 as u8, Access::ReadWrite, value).named(data_type.name().unwrap_or_default())
    });
    let element = |sub_index: u8| {
        let value = u16::from(sub_index).to_le_bytes();
        Entry::new(sub_index, data_type::U16, Access::ReadWrite, &value).named("Element")
    };
    let domain = DataType::DOMAIN.0 as u8;
    let large: Vec<u8> = (0..LARGE_OBJECT_BYTES).map(|place| (place % 251) as u8).collect();
    let settings = vec![
        Entry::new(1, data_type::I16, Access::ReadWrite, &[0, 0]).named("Offset").within(-100, 100),
        Entry::new(2, data_type::U32, Access::ReadWritePreOp, &50_000u32.to_le_bytes())
            .named("Ramp")
            .within(1, 1_000_000)
            .allow(AccessRights::BACKUP | AccessRights::SETTING),
        Entry::new(3, data_type::U32, Access::WriteOnly, &[0; 4]).named("Password"),
    ];
    vec![
        history(DIAGNOSIS_MESSAGES),
        Object::record(0x2000, "Every data type", every_type.collect()),
        Object::record(0x2001, "Array", (1..=200).map(element).collect()),
        Object::variable(0x2002, "Large object", domain, Access::ReadWrite, &large),
        Object::record(0x2003, "Settings", settings),
        Object::variable(0x2004, &"long name ".repeat(30), data_type::VISIBLE_STRING, Access::ReadWrite, &[b'-'; 64]),
    ]
}
