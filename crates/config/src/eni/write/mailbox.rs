//! `Mailbox` with the commands of each protocol.

use std::fmt::Display;

use crate::eni::model::{CoeCommand, EoeCommand, Mailbox, MailboxBuffer, Poll, RawMailCommand, SoeCommand, Transition};
use crate::xml::Writer;

pub(super) fn mailbox(out: &mut Writer, of: &Mailbox) {
    out.open("Mailbox");
    if let Some(send) = of.send {
        out.within("Send", |out| buffer(out, send));
    }
    if let Some(receive) = of.receive {
        out.open("Recv");
        buffer(out, receive);
        match of.poll {
            Some(Poll::Every(ms)) => out.leaf("PollTime", ms),
            Some(Poll::StatusBit(bit)) => out.leaf("StatusBitAddr", bit),
            None => {}
        }
        out.close("Recv");
    }
    if let Some((send, receive)) = of.bootstrap {
        out.within("BootStrap", |out| {
            out.within("Send", |out| buffer(out, send));
            out.within("Recv", |out| buffer(out, receive));
        });
    }
    of.protocols.iter().for_each(|protocol| out.leaf("Protocol", protocol));
    protocol(out, "CoE", &of.coe, "", coe);
    protocol(out, "SoE", &of.soe, "", soe);
    let raw_of = |name: &str| -> Vec<&RawMailCommand> { of.others.iter().filter(|it| it.protocol == name).collect() };
    let net_id = of.net_id.map(|id| id.map(|number| number.to_string()).join(".")).unwrap_or_default();
    protocol(out, "AoE", &raw_of("AoE"), &net_id, |out, of| raw(out, of));
    protocol(out, "EoE", &of.eoe, "", eoe);
    protocol(out, "FoE", &raw_of("FoE"), "", |out, of| raw(out, of));
    protocol(out, "VoE", &raw_of("VoE"), "", |out, of| raw(out, of));
    out.close("Mailbox");
}

fn buffer(out: &mut Writer, of: MailboxBuffer) {
    out.leaf("Start", of.start);
    out.leaf("Length", of.length);
}

fn protocol<T>(out: &mut Writer, name: &str, commands: &[T], net_id: &str, write: impl Fn(&mut Writer, &T)) {
    if commands.is_empty() && net_id.is_empty() {
        return;
    }
    out.open(name);
    if !commands.is_empty() {
        out.open("InitCmds");
        commands.iter().for_each(|command| write(out, command));
        out.close("InitCmds");
    }
    if !net_id.is_empty() {
        out.leaf("NetId", net_id);
    }
    out.close(name);
}

/// What a command of each protocol begins with.
fn begin(out: &mut Writer, tag: impl Display, transitions: &[Transition], comment: &str, timeout_ms: u32) {
    out.open(tag);
    transitions.iter().for_each(|transition| out.leaf("Transition", transition.name()));
    if !comment.is_empty() {
        out.leaf("Comment", comment);
    }
    out.leaf("Timeout", timeout_ms);
}

fn end(out: &mut Writer, disabled: bool) {
    if disabled {
        out.leaf("Disabled", 1);
    }
    out.close("InitCmd");
}

fn coe(out: &mut Writer, of: &CoeCommand) {
    let complete = if of.complete_access { " CompleteAccess=\"1\"" } else { "" };
    begin(out, format_args!("InitCmd{complete}"), &of.transitions, &of.comment, of.timeout_ms);
    out.leaf("Ccs", of.ccs);
    out.leaf("Index", of.index);
    out.leaf("SubIndex", of.sub_index);
    if !of.data.is_empty() {
        out.hex("Data", &of.data);
    }
    end(out, of.disabled);
}

fn soe(out: &mut Writer, of: &SoeCommand) {
    begin(out, "InitCmd", &of.transitions, &of.comment, of.timeout_ms);
    out.leaf("OpCode", of.op_code);
    out.leaf("DriveNo", of.drive);
    out.leaf("IDN", of.idn);
    out.leaf("Elements", of.elements);
    out.leaf("Attribute", of.attribute);
    if !of.data.is_empty() {
        out.hex("Data", &of.data);
    }
    end(out, of.disabled);
}

fn eoe(out: &mut Writer, of: &EoeCommand) {
    begin(out, "InitCmd", &of.transitions, &of.comment, of.timeout_ms);
    out.some("Type", of.kind);
    let address = |out: &mut Writer, name: &str, bytes: &Option<Vec<u8>>| {
        if let Some(bytes) = bytes {
            out.hex(name, bytes);
        }
    };
    address(out, "MAC", &of.mac);
    address(out, "IP", &of.ip);
    address(out, "Subnet", &of.subnet);
    address(out, "DefGateway", &of.gateway);
    address(out, "ServerIP", &of.server);
    out.some("DNSName", of.name.as_deref());
    if !of.data.is_empty() {
        out.hex("Data", &of.data);
    }
    end(out, of.disabled);
}

fn raw(out: &mut Writer, of: &RawMailCommand) {
    begin(out, "InitCmd", &of.transitions, &of.comment, 0);
    out.hex("Data", &of.data);
    end(out, of.disabled);
}
