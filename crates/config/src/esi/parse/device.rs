//! One device (protocol ES-26, ES-30, ES-39 to ES-44).

use super::clock::clock;
use super::eeprom::eeprom;
use super::info::info;
use super::mailbox::mailbox;
use super::pdo::pdos;
use super::profile::profiles;
use super::slots::slots;
use crate::esi::element::Element;
use crate::esi::error::{EsiError, EsiProblem};
use crate::esi::model::{
    Check, Controller, Device, Fmmu, FmmuRole, OtherIdentity, RevisionCheck, SubDeviceOf, SyncManager, SyncManagerRole,
    SyncUnit,
};
use crate::xml::shown;

pub(super) fn device(element: Element<'_>) -> Result<Device, EsiError> {
    let kind = element.required("Type")?;
    let name = element.names("Name")?;
    for missing in ["Name", "GroupType"].into_iter().filter(|name| element.child(name).is_none()) {
        element.note(format!("Device without {missing}"));
    }
    let mut device = Device {
        line: element.line(),
        physics: physics(element)?,
        is_invisible: element.is("Invisible")?,
        hides: element.children("HideType").map(other_identity).collect::<Result<_, _>>()?,
        alternatives: element.children("AlternativeType").map(other_identity).collect::<Result<_, _>>()?,
        subdevices: element.children("SubDevice").map(subdevice).collect::<Result<_, _>>()?,
        name,
        group: element.text_of("GroupType"),
        info: element.child("Info").map(info).transpose()?.unwrap_or_default(),
        profiles: profiles(element)?,
        fmmus: element.children("Fmmu").map(fmmu).collect::<Result<_, _>>()?,
        sync_managers: element.children("Sm").map(sync_manager).collect::<Result<_, _>>()?,
        sync_units: element.children("Su").map(sync_unit).collect::<Result<_, _>>()?,
        rx_pdos: pdos(element, "RxPdo")?,
        tx_pdos: pdos(element, "TxPdo")?,
        mailbox: element.child("Mailbox").map(mailbox).transpose()?,
        clock: element.child("Dc").map(clock).transpose()?,
        slots: element.child("Slots").map(slots).transpose()?,
        controller: element.child("ESC").map(controller).transpose()?.unwrap_or_default(),
        eeprom: element.child("Eeprom").map(eeprom).transpose()?,
        image: element.text_of("Image16x14").trim().to_owned(),
        ..Device::default()
    };
    identity(kind, &mut device)?;
    Ok(device)
}

fn identity(kind: Element<'_>, device: &mut Device) -> Result<(), EsiError> {
    device.kind = kind.text();
    device.product_code = kind.number_in("ProductCode")?.unwrap_or(0);
    device.revision = kind.number_in("RevisionNo")?.unwrap_or(0);
    device.serial = kind.number_in("SerialNo")?;
    device.use_lrd_lwr = kind.is("UseLrdLwr")?;
    let check = |attribute: &str| match kind.attribute(attribute).map(str::trim) {
        None => Ok(Check::Unstated),
        Some("NONE") => Ok(Check::None),
        Some("EQ") => Ok(Check::Equal),
        Some(other) => Err(value(kind, "NONE or EQ", attribute, other)),
    };
    device.check_product = check("CheckProductCode")?;
    device.check_serial = check("CheckSerialNo")?;
    device.check_revision = match kind.attribute("CheckRevisionNo").map(str::trim) {
        None => RevisionCheck::Unstated,
        Some("NONE") => RevisionCheck::None,
        Some("EQ") => RevisionCheck::Equal,
        Some("EQ_OR_G") => RevisionCheck::EqualOrGreater,
        Some("LW_EQ") => RevisionCheck::LowEqual,
        Some("LW_EQ_HW_EQ_OR_G") => RevisionCheck::LowEqualHighEqualOrGreater,
        Some("HW_EQ") => RevisionCheck::HighEqual,
        Some("HW_EQ_LW_EQ_OR_G") => RevisionCheck::HighEqualLowEqualOrGreater,
        Some(other) => return Err(value(kind, "a rule such as EQ, EQ_OR_G or LW_EQ", "CheckRevisionNo", other)),
    };
    Ok(())
}

fn value(element: Element<'_>, expected: &str, attribute: &str, got: &str) -> EsiError {
    let expected = format!("{expected} in the attribute {attribute}");
    element.error(EsiProblem::Value { expected, got: shown(got) })
}

/// A letter per port; blanks inside and at the beginning count (protocol ES-38).
fn physics(element: Element<'_>) -> Result<String, EsiError> {
    let Some(text) = element.attribute("Physics") else {
        element.note("Device without Physics: ports are not known");
        return Ok(String::new());
    };
    let is_valid = text.len() <= 4 && text.chars().all(|letter| matches!(letter, 'Y' | 'K' | 'H' | ' '));
    if is_valid { Ok(text.to_owned()) } else { Err(value(element, "up to 4 of Y, K, H and blank", "Physics", text)) }
}

fn other_identity(element: Element<'_>) -> Result<OtherIdentity, EsiError> {
    let product_code = element.number_in("ProductCode")?;
    Ok(OtherIdentity { text: element.text(), product_code, revision: element.number_in("RevisionNo")? })
}

fn subdevice(element: Element<'_>) -> Result<SubDeviceOf, EsiError> {
    Ok(SubDeviceOf {
        identity: other_identity(element)?,
        previous_device: element.number_in("PreviousDevice")?,
        previous_port: element.number_in("PreviousPortNo")?,
    })
}

fn fmmu(element: Element<'_>) -> Result<Fmmu, EsiError> {
    let text = element.raw();
    let role = match text.trim() {
        "Outputs" => FmmuRole::Outputs,
        "Inputs" => FmmuRole::Inputs,
        "MBoxState" => FmmuRole::MailboxState,
        other => {
            element.note(format!("Fmmu {}: not used", shown(other)));
            FmmuRole::Unused
        }
    };
    Ok(Fmmu { role, sync_manager: element.number_in("Sm")?, sync_unit: element.number_in("Su")? })
}

fn sync_manager(element: Element<'_>) -> Result<SyncManager, EsiError> {
    let text = element.raw();
    let role = match text.trim() {
        "MBoxOut" => SyncManagerRole::MailboxOut,
        "MBoxIn" => SyncManagerRole::MailboxIn,
        "Outputs" => SyncManagerRole::Outputs,
        "Inputs" => SyncManagerRole::Inputs,
        other => {
            element.note(format!("Sm {}: not used", shown(other)));
            SyncManagerRole::Unused
        }
    };
    // `Enable` is a number in the schema and a boolean in some files.
    let enable = match element.attribute("Enable").map(str::trim) {
        Some(text) if text.eq_ignore_ascii_case("true") => true,
        Some(text) if text.eq_ignore_ascii_case("false") => false,
        _ => element.number_in::<u32>("Enable")?.is_some_and(|number| number & 1 != 0),
    };
    Ok(SyncManager {
        line: element.line(),
        role,
        min_size: element.number_in("MinSize")?,
        max_size: element.number_in("MaxSize")?,
        default_size: element.number_in("DefaultSize")?,
        start: element.number_in("StartAddress")?,
        control: element.number_in("ControlByte")?,
        enable,
        is_virtual: element.is("Virtual")?,
        op_only: element.is("OpOnly")?,
        fixed_assignment: element.is("FixedAssignment")?,
    })
}

fn sync_unit(element: Element<'_>) -> Result<SyncUnit, EsiError> {
    Ok(SyncUnit {
        name: element.text(),
        separate: element.is("SeparateSu")?,
        separate_frame: element.is("SeparateFrame")?,
        frame_repeat: element.is("FrameRepeatSupport")?,
    })
}

fn controller(element: Element<'_>) -> Result<Controller, EsiError> {
    Ok(Controller {
        reg_0400: element.number_of("Reg0400")?,
        reg_0410: element.number_of("Reg0410")?,
        reg_0420: element.number_of("Reg0420")?,
    })
}
