//! `Mailbox` with the commands of each protocol.

use crate::eni::Place;
use crate::eni::model::{CoeCommand, EoeCommand, Mailbox, MailboxBuffer, Poll, RawMailCommand, SoeCommand, Transition};
use crate::xml::Elements;

pub(super) fn mailbox(out: &mut Elements, of: &Mailbox) {
    out.within("Mailbox", |out| {
        if let Some(send) = of.send {
            out.within("Send", |out| buffer(out, send));
        }
        if of.receive.is_some() || of.poll.is_some() {
            out.within("Recv", |out| {
                of.receive.into_iter().for_each(|receive| buffer(out, receive));
                match of.poll {
                    Some(Poll::Every(ms)) => out.leaf("PollTime", ms),
                    Some(Poll::StatusBit(bit)) => out.leaf("StatusBitAddr", bit),
                    None => {}
                }
            });
        }
        if let Some((send, receive)) = of.bootstrap {
            out.within("BootStrap", |out| {
                out.within("Send", |out| buffer(out, send));
                out.within("Recv", |out| buffer(out, receive));
            });
        }
        of.protocols.iter().for_each(|protocol| out.leaf("Protocol", protocol));
        protocols(out, of);
    });
}

/// The first command in the file.
pub(super) fn first(of: &Mailbox) -> Option<Place> {
    let coe = of.coe.iter().map(|it| it.place);
    let soe = of.soe.iter().map(|it| it.place);
    let eoe = of.eoe.iter().map(|it| it.place);
    coe.chain(soe).chain(eoe).chain(of.others.iter().map(|it| it.place)).min()
}

/// The protocols in the order of the schema; where their commands are in another order, in that of their first
/// commands.
fn protocols(out: &mut Elements, of: &Mailbox) {
    let raw = |name: &str| of.others.iter().filter(|it| it.protocol == name).collect::<Vec<&RawMailCommand>>();
    let mut order = [
        ("CoE", of.coe.first().map(|it| it.place)),
        ("SoE", of.soe.first().map(|it| it.place)),
        ("AoE", raw("AoE").first().map(|it| it.place)),
        ("EoE", of.eoe.first().map(|it| it.place)),
        ("FoE", raw("FoE").first().map(|it| it.place)),
        ("VoE", raw("VoE").first().map(|it| it.place)),
    ];
    if !order.iter().filter_map(|(_, place)| *place).is_sorted() {
        order.sort_by_key(|(_, place)| place.unwrap_or_default());
    }
    for (name, _) in order {
        match name {
            "CoE" => protocol(out, name, &of.coe, None, coe),
            "SoE" => protocol(out, name, &of.soe, None, soe),
            "EoE" => protocol(out, name, &of.eoe, None, eoe),
            "AoE" => protocol(out, name, &raw(name), of.net_id, |out, it| other(out, it)),
            _ => protocol(out, name, &raw(name), None, |out, it| other(out, it)),
        }
    }
}

fn buffer(out: &mut Elements, of: MailboxBuffer) {
    out.leaf("Start", of.start);
    out.leaf("Length", of.length);
}

fn protocol<T>(
    out: &mut Elements,
    name: &str,
    commands: &[T],
    net_id: Option<[u8; 6]>,
    write: impl Fn(&mut Elements, &T),
) {
    if commands.is_empty() && net_id.is_none() {
        return;
    }
    out.within(name, |out| {
        if !commands.is_empty() {
            out.within("InitCmds", |out| commands.iter().for_each(|command| write(out, command)));
        }
        out.some("NetId", net_id.map(|id| id.map(|number| number.to_string()).join(".")));
    });
}

/// What the commands of all protocols begin with.
fn head(out: &mut Elements, transitions: &[Transition], comment: &str, timeout_ms: u32) {
    transitions.iter().for_each(|transition| out.leaf("Transition", transition.name()));
    out.text("Comment", comment);
    out.leaf("Timeout", timeout_ms);
}

fn tail(out: &mut Elements, data: &[u8], disabled: bool) {
    if !data.is_empty() {
        out.hex("Data", data);
    }
    if disabled {
        out.leaf("Disabled", 1);
    }
}

fn coe(out: &mut Elements, of: &CoeCommand) {
    let attributes: &[(&str, &str)] = if of.complete_access { &[("CompleteAccess", "1")] } else { &[] };
    out.with("InitCmd", attributes, |out| {
        head(out, &of.transitions, &of.comment, of.timeout_ms);
        out.leaf("Ccs", of.ccs);
        out.leaf("Index", of.index);
        out.leaf("SubIndex", of.sub_index);
        tail(out, &of.data, of.disabled);
    });
}

fn soe(out: &mut Elements, of: &SoeCommand) {
    out.within("InitCmd", |out| {
        head(out, &of.transitions, &of.comment, of.timeout_ms);
        out.leaf("OpCode", of.op_code);
        out.leaf("DriveNo", of.drive);
        out.leaf("IDN", of.idn);
        out.leaf("Elements", of.elements);
        out.leaf("Attribute", of.attribute);
        tail(out, &of.data, of.disabled);
    });
}

fn eoe(out: &mut Elements, of: &EoeCommand) {
    out.within("InitCmd", |out| {
        head(out, &of.transitions, &of.comment, of.timeout_ms);
        out.some("Type", of.kind);
        let addresses = [
            ("MAC", &of.mac),
            ("IP", &of.ip),
            ("Subnet", &of.subnet),
            ("DefGateway", &of.gateway),
            ("ServerIP", &of.server),
        ];
        for (name, bytes) in addresses {
            if let Some(bytes) = bytes {
                out.hex(name, bytes);
            }
        }
        out.some("DNSName", of.name.as_deref());
        tail(out, &of.data, of.disabled);
    });
}

fn other(out: &mut Elements, of: &RawMailCommand) {
    out.within("InitCmd", |out| {
        head(out, &of.transitions, &of.comment, of.timeout_ms);
        out.hex("Data", &of.data);
        tail(out, &[], of.disabled);
    });
}
