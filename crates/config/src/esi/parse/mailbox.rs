//! Mailboxes and their start-up commands (protocol ES-51, ES-55).

use super::pdo::slot_index;
use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{
    AoeSettings, CoeCommand, CoeSettings, EoeSettings, Mailbox, RawCommand, SoeCommand, Transition,
};

pub(super) fn mailbox(element: Element<'_>) -> Result<Mailbox, EsiError> {
    let soe = |soe: Element<'_>| -> Result<_, EsiError> {
        let commands = soe.children("InitCmd").map(soe_command).collect::<Result<_, _>>()?;
        Ok((soe.number_in("ChannelCount")?.unwrap_or(1), commands))
    };
    Ok(Mailbox {
        line: element.line(),
        data_link_layer: element.is("DataLinkLayer")?,
        aoe: element.child("AoE").map(aoe).transpose()?,
        eoe: element.child("EoE").map(eoe).transpose()?,
        coe: element.child("CoE").map(coe).transpose()?,
        foe: element.child("FoE").is_some(),
        soe: element.child("SoE").map(soe).transpose()?,
        voe: element.child("VoE").is_some(),
    })
}

fn aoe(element: Element<'_>) -> Result<AoeSettings, EsiError> {
    Ok(AoeSettings {
        is_router: element.is("AdsRouter")?,
        generate_net_id: element.is("GenerateOwnNetId")?,
        initialize_net_id: element.is("InitializeOwnNetId")?,
        commands: element.children("InitCmd").map(raw).collect::<Result<_, _>>()?,
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
    Ok(CoeSettings {
        sdo_info: element.is("SdoInfo")?,
        pdo_assign: element.is("PdoAssign")?,
        pdo_config: element.is("PdoConfig")?,
        pdo_upload: element.is("PdoUpload")?,
        complete_access: element.is("CompleteAccess")?,
        segmented: element.flag_in("SegmentedSdo")?,
        diagnosis_history: element.is("DiagHistory")?,
        upload_with_max_length: element.is("SdoUploadWithMaxLength")?,
        time_distribution: element.is("TimeDistribution")?,
        eds_file: element.attribute("EdsFile").map(str::to_owned),
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

/// A transition by its name.
pub(super) fn transition(name: &str) -> Option<Transition> {
    Some(match name.trim() {
        "IP" => Transition::Ip,
        "PS" => Transition::Ps,
        "SO" => Transition::So,
        "SP" => Transition::Sp,
        "OP" => Transition::Op,
        "OS" => Transition::Os,
        _ => return None,
    })
}

fn transitions(element: Element<'_>) -> Result<Vec<Transition>, EsiError> {
    let one = |element: Element<'_>| {
        transition(&element.raw()).ok_or_else(|| element.wrong("a transition IP, PS, SO, SP, OP or OS"))
    };
    let found: Vec<Transition> = element.children("Transition").map(one).collect::<Result<_, _>>()?;
    if found.is_empty() {
        return Err(element.required("Transition").err().unwrap_or_else(|| element.wrong("a transition")));
    }
    Ok(found)
}
