//! From the model to the text of a file, in the sequence of the schema of edition 1.3: numbers are decimal, bytes
//! hexadecimal, indices of PDOs `#x` (protocol 8.2).
//!
//! [`super::read`] gives the same model back, places and unknown elements aside. The order of a SubDevice's mailbox
//! commands and its other commands counts: it is taken from the places.

mod commands;
mod mailbox;
mod process_data;

use super::model::{CyclicCommand, CyclicTask, Eni, HotConnect, MainDevice, Port, SubDevice};
use crate::xml::Elements;

/// EtherCAT, low byte first.
const ETHER_TYPE: [u8; 2] = [0xA4, 0x88];
/// Edition of the schema.
const EDITION: &str = "1.3";

/// The text of a file.
pub fn write(eni: &Eni) -> String {
    let mut out = Elements::new();
    if let Some(made_by) = &eni.made_by {
        out.comment(made_by);
    }
    let root = [
        ("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"),
        ("xsi:noNamespaceSchemaLocation", "EtherCATConfig.xsd"),
        ("Version", eni.version.as_deref().unwrap_or(EDITION)),
    ];
    out.with("EtherCATConfig", &root, |out| {
        out.within("Config", |out| {
            main_device(out, &eni.main_device);
            eni.subdevices.iter().for_each(|of| subdevice(out, of));
            eni.tasks.iter().for_each(|of| task(out, of));
            process_data::image(out, &eni.image);
        });
    });
    out.into_text()
}

fn main_device(out: &mut Elements, of: &MainDevice) {
    out.within("Master", |out| {
        out.within("Info", |out| {
            out.leaf("Name", &of.name);
            out.hex("Destination", &of.destination);
            out.hex("Source", &of.source);
            out.hex("EtherType", &ETHER_TYPE);
        });
        if let Some(states) = of.mailbox_states {
            out.within("MailboxStates", |out| {
                out.leaf("StartAddr", states.start.0);
                out.leaf("Count", states.count);
            });
        }
        if of.eoe {
            out.within("EoE", |_| {});
        }
        commands::list(out, &of.init_commands, commands::Owner::WholeBus);
    });
}

fn subdevice(out: &mut Elements, of: &SubDevice) {
    out.within("Slave", |out| {
        out.within("Info", |out| info(out, of));
        if let Some(of) = &of.process_data {
            process_data::of_subdevice(out, of);
        }
        let mail_first = match (of.mailbox.as_ref().and_then(mailbox::first), of.init_commands.first()) {
            (Some(mail), Some(command)) => mail <= command.place,
            _ => true,
        };
        let mail = |out: &mut Elements| of.mailbox.iter().for_each(|it| mailbox::mailbox(out, it));
        if mail_first {
            mail(out);
        }
        commands::list(out, &of.init_commands, commands::Owner::SubDevice);
        if !mail_first {
            mail(out);
        }
        connections(out, of);
    });
}

fn info(out: &mut Elements, of: &SubDevice) {
    out.leaf("Name", &of.name);
    out.some("PhysAddr", of.station);
    out.some("AutoIncAddr", of.auto_increment);
    out.leaf("Physics", &of.physics);
    out.some("VendorId", of.vendor_id);
    out.some("ProductCode", of.product_code);
    out.some("RevisionNo", of.revision);
    out.some("SerialNo", of.serial);
}

/// Cables, group, clock.
fn connections(out: &mut Elements, of: &SubDevice) {
    for port in &of.previous_ports {
        out.with("PreviousPort", &[("Selected", if port.selected { "1" } else { "0" })], |out| {
            out.leaf("Port", letter(port.port));
            out.some("PhysAddr", port.station);
        });
    }
    if let Some(group) = &of.hot_connect {
        out.within("HotConnect", |out| hot_connect(out, group));
    }
    if let Some(clock) = &of.clock {
        out.within("DC", |out| {
            out.leaf("ReferenceClock", u8::from(clock.reference));
            out.leaf("CycleTime0", clock.cycle_0_ns);
            out.leaf("CycleTime1", clock.cycle_1_ns);
            out.leaf("ShiftTime", clock.shift_ns);
        });
    }
}

fn hot_connect(out: &mut Elements, of: &HotConnect) {
    out.text("GroupName", &of.name);
    out.leaf("GroupMemberCnt", of.members);
    of.identify.iter().for_each(|it| out.within("IdentifyCmd", |out| commands::command(out, it)));
}

const fn letter(port: Port) -> char {
    match port {
        Port::A => 'A',
        Port::B => 'B',
        Port::C => 'C',
        Port::D => 'D',
    }
}

fn task(out: &mut Elements, of: &CyclicTask) {
    out.within("Cyclic", |out| {
        out.text("Comment", &of.comment);
        out.some("CycleTime", of.cycle_us);
        for frame in &of.frames {
            out.within("Frame", |out| frame.commands.iter().for_each(|of| command(out, of)));
        }
    });
}

fn command(out: &mut Elements, of: &CyclicCommand) {
    out.within("Cmd", |out| {
        of.states.iter().for_each(|state| out.leaf("State", state));
        out.text("Comment", &of.comment);
        commands::datagram(out, &of.datagram);
        out.some("InputOffs", of.input_offset);
        out.some("OutputOffs", of.output_offset);
        if of.copies.is_empty() {
            return;
        }
        out.within("CopyInfos", |out| {
            for copy in &of.copies {
                out.within("CopyInfo", |out| {
                    out.leaf("SrcBitOffs", copy.source);
                    out.leaf("DstBitOffs", copy.target);
                    out.leaf("BitSize", copy.bits);
                });
            }
        });
    });
}
