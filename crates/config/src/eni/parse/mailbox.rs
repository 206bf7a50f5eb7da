//! `Mailbox` of a SubDevice: buffers, protocols, commands of each protocol.

use super::commands::transitions;
use crate::eni::element::Element;
use crate::eni::error::EniError;
use crate::eni::model::{CoeCommand, EoeCommand, Mailbox, MailboxBuffer, Poll, RawMailCommand, SoeCommand};

/// `Mailbox`.
pub(super) fn mailbox(element: Element<'_>) -> Result<Mailbox, EniError> {
    element.expects(&["Send", "Recv", "Receive", "BootStrap", "Protocol", "CoE", "SoE", "EoE", "AoE", "FoE", "VoE"]);
    let receive = receiving(element);
    let poll = match receive {
        None => None,
        Some(receive) => match (receive.number_of("StatusBitAddr")?, receive.number_of("PollTime")?) {
            (Some(bit), _) => Some(Poll::StatusBit(bit)),
            (None, Some(time)) => Some(Poll::Every(time)),
            (None, None) => None,
        },
    };
    let bootstrap = match element.child("BootStrap") {
        None => None,
        Some(bootstrap) => buffer(bootstrap.child("Send"))?.zip(buffer(receiving(bootstrap))?),
    };
    let mut others = Vec::new();
    for protocol in ["AoE", "FoE", "VoE"] {
        others.extend(in_protocol(element, protocol, |command| raw(command, protocol))?);
    }
    Ok(Mailbox {
        send: buffer(element.child("Send"))?,
        receive: buffer(receive)?,
        poll,
        bootstrap,
        protocols: element.children("Protocol").map(|protocol| protocol.text()).collect(),
        coe: in_protocol(element, "CoE", coe)?,
        soe: in_protocol(element, "SoE", soe)?,
        eoe: in_protocol(element, "EoE", eoe)?,
        others,
        net_id: element.child("AoE").and_then(|aoe| aoe.child("NetId")).map(net_id).transpose()?,
    })
}

/// `Recv`; some files write `Receive`.
fn receiving(element: Element<'_>) -> Option<Element<'_>> {
    element.child("Recv").or_else(|| element.child("Receive"))
}

/// A buffer; `None` if it has no address or no length.
fn buffer(element: Option<Element<'_>>) -> Result<Option<MailboxBuffer>, EniError> {
    let Some(element) = element else { return Ok(None) };
    element.expects(&["Start", "Length", "ShortSend", "PollTime", "StatusBitAddr"]);
    let (start, length) = (element.number_of("Start")?, element.number_of("Length")?.filter(|length| *length != 0));
    Ok(start.zip(length).map(|(start, length)| MailboxBuffer { place: element.place(), start, length }))
}

/// The commands of a protocol.
fn in_protocol<'a, T>(
    mailbox: Element<'a>,
    protocol: &str,
    read: impl Fn(Element<'a>) -> Result<T, EniError>,
) -> Result<Vec<T>, EniError> {
    let Some(protocol) = mailbox.child(protocol) else { return Ok(Vec::new()) };
    // A profile describes what the SubDevice is, and configures nothing.
    protocol.expects(&["InitCmds", "NetId", "Profile"]);
    let Some(commands) = protocol.child("InitCmds") else { return Ok(Vec::new()) };
    commands.expects(&["InitCmd"]);
    commands.children("InitCmd").map(read).collect()
}

fn coe(element: Element<'_>) -> Result<CoeCommand, EniError> {
    element.expects(&[
        "Transition",
        "Comment",
        "Timeout",
        "Ccs",
        "Index",
        "SubIndex",
        "Data",
        "Disabled",
        "CompleteAccess",
    ]);
    let ccs = match element.child("Ccs") {
        None => 1,
        Some(ccs) => match ccs.number()? {
            code @ 1..=2 => code,
            _ => return Err(ccs.wrong("1 (download) or 2 (upload)")),
        },
    };
    Ok(CoeCommand {
        place: element.place(),
        transitions: transitions(element)?,
        comment: element.text_of("Comment"),
        timeout_ms: element.number_of("Timeout")?.unwrap_or_default(),
        ccs,
        complete_access: element.flag_in("CompleteAccess")? || element.flag_of("CompleteAccess")?,
        index: element.required_number("Index")?,
        sub_index: element.number_of("SubIndex")?.unwrap_or_default(),
        data: element.hex_of("Data")?.unwrap_or_default(),
        disabled: element.flag_of("Disabled")?,
    })
}

fn soe(element: Element<'_>) -> Result<SoeCommand, EniError> {
    element.expects(&[
        "Transition",
        "Comment",
        "Timeout",
        "OpCode",
        "DriveNo",
        "IDN",
        "Elements",
        "Attribute",
        "Data",
        "Disabled",
    ]);
    Ok(SoeCommand {
        place: element.place(),
        transitions: transitions(element)?,
        comment: element.text_of("Comment"),
        timeout_ms: element.number_of("Timeout")?.unwrap_or_default(),
        op_code: element.number_of("OpCode")?.unwrap_or(3),
        drive: element.number_of("DriveNo")?.unwrap_or_default(),
        idn: element.required_number("IDN")?,
        elements: element.number_of("Elements")?.unwrap_or(0x40),
        attribute: element.number_of("Attribute")?.unwrap_or_default(),
        data: element.hex_of("Data")?.unwrap_or_default(),
        disabled: element.flag_of("Disabled")?,
    })
}

fn eoe(element: Element<'_>) -> Result<EoeCommand, EniError> {
    element.expects(&[
        "Transition",
        "Comment",
        "Timeout",
        "Type",
        "MAC",
        "IP",
        "Subnet",
        "DefGateway",
        "ServerIP",
        "DNSName",
        "Data",
        "Disabled",
    ]);
    Ok(EoeCommand {
        place: element.place(),
        transitions: transitions(element)?,
        comment: element.text_of("Comment"),
        timeout_ms: element.number_of("Timeout")?.unwrap_or_default(),
        kind: element.number_of("Type")?,
        mac: element.hex_of("MAC")?,
        ip: element.ip_of("IP")?,
        subnet: element.ip_of("Subnet")?,
        gateway: element.ip_of("DefGateway")?,
        server: element.ip_of("ServerIP")?,
        name: element.child("DNSName").map(|name| name.text()),
        data: element.hex_of("Data")?.unwrap_or_default(),
        disabled: element.flag_of("Disabled")?,
    })
}

fn raw(element: Element<'_>, protocol: &'static str) -> Result<RawMailCommand, EniError> {
    element.expects(&["Transition", "Comment", "Timeout", "Data", "Disabled"]);
    Ok(RawMailCommand {
        place: element.place(),
        protocol,
        transitions: transitions(element)?,
        comment: element.text_of("Comment"),
        timeout_ms: element.number_of("Timeout")?.unwrap_or_default(),
        data: element.hex_of("Data")?.unwrap_or_default(),
        disabled: element.flag_of("Disabled")?,
    })
}

/// Six decimal numbers separated by points, or bytes in hexadecimal.
fn net_id(element: Element<'_>) -> Result<[u8; 6], EniError> {
    let text = element.text();
    let numbers: Option<Vec<u8>> = text.split('.').map(|number| number.trim().parse().ok()).collect();
    let bytes = match numbers {
        Some(numbers) if numbers.len() == 6 => numbers,
        _ => element.hex()?,
    };
    bytes.try_into().map_err(|_| element.wrong("six numbers with points between them"))
}
