//! Commands with a datagram.

use crate::eni::model::{Datagram, EcatCommand, Requires, Target};
use crate::xml::Writer;

/// Where a command is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    WholeBus,
    SubDevice,
}

/// `InitCmds`.
pub(super) fn list(out: &mut Writer, commands: &[EcatCommand], place: Place) {
    if commands.is_empty() {
        return;
    }
    out.open("InitCmds");
    for of in commands {
        out.open("InitCmd");
        command(out, of, place);
        out.close("InitCmd");
    }
    out.close("InitCmds");
}

/// `IdentifyCmd`.
pub(super) fn identify(out: &mut Writer, of: &EcatCommand) {
    out.open("IdentifyCmd");
    command(out, of, Place::SubDevice);
    out.close("IdentifyCmd");
}

fn command(out: &mut Writer, of: &EcatCommand, place: Place) {
    of.transitions.iter().for_each(|transition| out.leaf("Transition", transition.name()));
    if place == Place::WholeBus || of.before_subdevices {
        out.leaf("BeforeSlave", u8::from(of.before_subdevices));
    }
    if !of.comment.is_empty() {
        out.leaf("Comment", &of.comment);
    }
    match of.requires {
        Some(Requires::Frame) => out.leaf("Requires", "frame"),
        Some(Requires::Cycle) => out.leaf("Requires", "cycle"),
        None => {}
    }
    datagram(out, &of.datagram);
    out.leaf("Retries", of.retries);
    if let Some(validate) = &of.validate {
        out.open("Validate");
        out.hex("Data", &validate.data);
        if let Some(mask) = &validate.mask {
            out.hex("DataMask", mask);
        }
        out.leaf("Timeout", validate.timeout_ms);
        out.close("Validate");
    }
    out.some("Timeout", of.timeout_ms);
}

/// Command, address, data, working counter.
pub(super) fn datagram(out: &mut Writer, of: &Datagram) {
    /// Zeros of this length and more are a number.
    const LONG: usize = 24;
    out.leaf("Cmd", of.command.code());
    match of.target {
        Target::Register { adp, ado } => {
            out.leaf("Adp", adp);
            out.leaf("Ado", ado.0);
        }
        Target::Logical(address) => out.leaf("Addr", address.0),
    }
    if of.data.len() >= LONG && of.data.iter().all(|byte| *byte == 0) {
        out.leaf("DataLength", of.data.len());
    } else {
        out.hex("Data", &of.data);
    }
    out.some("Cnt", of.count);
}
