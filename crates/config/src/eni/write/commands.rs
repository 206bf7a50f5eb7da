//! Commands with a datagram.

use crate::eni::model::{Datagram, EcatCommand, Requires, Target};
use crate::xml::Elements;

/// Zeros of this length and more are a number.
const LONG: usize = 24;

/// The element with a list of commands.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Owner {
    WholeBus,
    SubDevice,
}

/// `InitCmds`.
pub(super) fn list(out: &mut Elements, commands: &[EcatCommand], owner: Owner) {
    if commands.is_empty() {
        return;
    }
    out.within("InitCmds", |out| {
        for of in commands {
            out.within("InitCmd", |out| {
                of.transitions.iter().for_each(|transition| out.leaf("Transition", transition.name()));
                if owner == Owner::WholeBus || of.before_subdevices {
                    out.leaf("BeforeSlave", u8::from(of.before_subdevices));
                }
                command(out, of);
            });
        }
    });
}

/// What follows the transitions.
pub(super) fn command(out: &mut Elements, of: &EcatCommand) {
    out.text("Comment", &of.comment);
    match of.requires {
        Some(Requires::Frame) => out.leaf("Requires", "frame"),
        Some(Requires::Cycle) => out.leaf("Requires", "cycle"),
        None => {}
    }
    datagram(out, &of.datagram);
    out.leaf("Retries", of.retries);
    if let Some(validate) = &of.validate {
        out.within("Validate", |out| {
            out.hex("Data", &validate.data);
            if let Some(mask) = &validate.mask {
                out.hex("DataMask", mask);
            }
            out.leaf("Timeout", validate.timeout_ms);
        });
    }
    out.some("Timeout", of.timeout_ms);
}

/// Command, address, data, working counter.
pub(super) fn datagram(out: &mut Elements, of: &Datagram) {
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
