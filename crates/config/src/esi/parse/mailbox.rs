//! Mailboxes and their start-up commands (protocol ES-51, ES-55).

use super::pdo::slot_index;
use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{CoeCommand, CoeSettings, EoeSettings, Mailbox, RawCommand, SoeCommand, Transition};

pub(super) fn mailbox(element: Element<'_>) -> Result<Mailbox, EsiError> {
    element.knows(&["AoE", "EoE", "CoE", "FoE", "SoE", "VoE", "VendorSpecific"]);
    let aoe = element.child("AoE").map(|aoe| aoe.children("InitCmd").map(raw).collect()).transpose()?;
    let soe = |soe: Element<'_>| -> Result<_, EsiError> {
        let commands = soe.children("InitCmd").map(soe_command).collect::<Result<_, _>>()?;
        Ok((soe.number_in("ChannelCount")?.unwrap_or(1), commands))
    };
    Ok(Mailbox {
        line: element.line(),
        data_link_layer: element.is("DataLinkLayer")?,
        aoe,
        eoe: element.child("EoE").map(eoe).transpose()?,
        coe: element.child("CoE").map(coe).transpose()?,
        foe: element.child("FoE").is_some(),
        soe: element.child("SoE").map(soe).transpose()?,
        voe: element.child("VoE").is_some(),
    })
}

fn eoe(element: Element<'_>) -> Result<EoeSettings, EsiError> {
    Ok(EoeSettings {
        takes_ip: element.is("IP")?,
        takes_mac: element.is("MAC")?,
        time_stamps: element.is("TimeStamp")?,
        commands: element.children("InitCmd").map(raw).collect::<Result<_, _>>()?,
    })
}

/// `CoE` of a device or module.
pub(super) fn coe(element: Element<'_>) -> Result<CoeSettings, EsiError> {
    element.knows(&["InitCmd", "Object", "VendorSpecific"]);
    Ok(CoeSettings {
        sdo_info: element.is("SdoInfo")?,
        pdo_assign: element.is("PdoAssign")?,
        pdo_config: element.is("PdoConfig")?,
        pdo_upload: element.is("PdoUpload")?,
        complete_access: element.is("CompleteAccess")?,
        segmented: element.flag_in("SegmentedSdo")?,
        diagnosis_history: element.is("DiagHistory")?,
        commands: element.children("InitCmd").map(coe_command).collect::<Result<_, _>>()?,
    })
}

fn coe_command(element: Element<'_>) -> Result<CoeCommand, EsiError> {
    Ok(CoeCommand {
        line: element.line(),
        transitions: transitions(element)?,
        index: slot_index(element.required("Index")?)?,
        sub_index: element.number_of("SubIndex")?.unwrap_or(0),
        data: element.hex_of("Data")?.unwrap_or_default(),
        complete_access: element.is("CompleteAccess")?,
        overwritten_by_module: element.is("OverwrittenByModule")?,
        comment: element.text_of("Comment"),
    })
}

fn soe_command(element: Element<'_>) -> Result<SoeCommand, EsiError> {
    Ok(SoeCommand {
        line: element.line(),
        transitions: transitions(element)?,
        channel: element.number_in("Chn")?.unwrap_or(0),
        idn: element.required_number("IDN")?,
        data: element.hex_of("Data")?.unwrap_or_default(),
        comment: element.text_of("Comment"),
    })
}

fn raw(element: Element<'_>) -> Result<RawCommand, EsiError> {
    Ok(RawCommand {
        line: element.line(),
        transitions: transitions(element)?,
        data: element.hex_of("Data")?.unwrap_or_default(),
        comment: element.text_of("Comment"),
    })
}

fn transitions(element: Element<'_>) -> Result<Vec<Transition>, EsiError> {
    let one = |element: Element<'_>| match element.raw().trim() {
        "IP" => Ok(Transition::Ip),
        "PS" => Ok(Transition::Ps),
        "SO" => Ok(Transition::So),
        "SP" => Ok(Transition::Sp),
        "OP" => Ok(Transition::Op),
        "OS" => Ok(Transition::Os),
        _ => Err(element.wrong("a transition IP, PS, SO, SP, OP or OS")),
    };
    let found: Vec<Transition> = element.children("Transition").map(one).collect::<Result<_, _>>()?;
    if found.is_empty() {
        return Err(element.required("Transition").err().unwrap_or_else(|| element.wrong("a transition")));
    }
    Ok(found)
}
