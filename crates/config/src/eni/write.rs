//! From the model to the text of a file, in the sequence of the schema of edition 1.3 (protocol ES-112, ES-113): numbers
//! are decimal, bytes hexadecimal, indices of PDOs `#x`.
//!
//! [`super::read`] gives the same model back, places aside.

mod commands;
mod mailbox;
mod process_data;

use super::model::{CyclicCommand, CyclicTask, Eni, MainDevice, Port, SubDevice};
use crate::xml::Writer;
use commands::Place;

/// The text of a file.
pub fn write(eni: &Eni) -> String {
    let mut out = Writer::new();
    if let Some(made_by) = &eni.made_by {
        out.comment(made_by);
    }
    let version = eni.version.as_deref().unwrap_or("1.3");
    let schema = "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
                  xsi:noNamespaceSchemaLocation=\"EtherCATConfig.xsd\"";
    out.open(format_args!("EtherCATConfig {schema} Version=\"{}\"", crate::xml::escaped(version)));
    out.open("Config");
    main_device(&mut out, &eni.main_device);
    eni.subdevices.iter().for_each(|of| subdevice(&mut out, of));
    eni.tasks.iter().for_each(|of| task(&mut out, of));
    process_data::image(&mut out, &eni.image);
    out.close("Config");
    out.close("EtherCATConfig");
    out.into_text()
}

fn main_device(out: &mut Writer, of: &MainDevice) {
    /// EtherCAT, low byte first.
    const ETHER_TYPE: [u8; 2] = [0xA4, 0x88];
    out.open("Master");
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
    commands::list(out, &of.init_commands, Place::WholeBus);
    out.close("Master");
}

fn subdevice(out: &mut Writer, of: &SubDevice) {
    out.open("Slave");
    out.within("Info", |out| {
        out.leaf("Name", &of.name);
        out.some("PhysAddr", of.station);
        out.some("AutoIncAddr", of.auto_increment);
        out.leaf("Physics", &of.physics);
        out.leaf("VendorId", of.vendor_id.unwrap_or(0));
        out.leaf("ProductCode", of.product_code.unwrap_or(0));
        out.leaf("RevisionNo", of.revision.unwrap_or(0));
        out.leaf("SerialNo", of.serial.unwrap_or(0));
    });
    if let Some(of) = &of.process_data {
        process_data::of_subdevice(out, of);
    }
    if let Some(of) = &of.mailbox {
        mailbox::mailbox(out, of);
    }
    commands::list(out, &of.init_commands, Place::SubDevice);
    for port in &of.previous_ports {
        out.open(format_args!("PreviousPort Selected=\"{}\"", u8::from(port.selected)));
        let letter = match port.port {
            Port::A => 'A',
            Port::B => 'B',
            Port::C => 'C',
            Port::D => 'D',
        };
        out.leaf("Port", letter);
        out.some("PhysAddr", port.station);
        out.close("PreviousPort");
    }
    if let Some(group) = &of.hot_connect {
        out.open("HotConnect");
        if !group.name.is_empty() {
            out.leaf("GroupName", &group.name);
        }
        out.leaf("GroupMemberCnt", group.members);
        group.identify.iter().for_each(|command| commands::identify(out, command));
        out.close("HotConnect");
    }
    if let Some(clock) = &of.clock {
        out.within("DC", |out| {
            out.leaf("ReferenceClock", u8::from(clock.reference));
            out.leaf("CycleTime0", clock.cycle_0_ns);
            out.leaf("CycleTime1", clock.cycle_1_ns);
            out.leaf("ShiftTime", clock.shift_ns);
        });
    }
    out.close("Slave");
}

fn task(out: &mut Writer, of: &CyclicTask) {
    out.open("Cyclic");
    if !of.comment.is_empty() {
        out.leaf("Comment", &of.comment);
    }
    out.some("CycleTime", of.cycle_us);
    for frame in &of.frames {
        out.open("Frame");
        frame.commands.iter().for_each(|of| command(out, of));
        out.close("Frame");
    }
    out.close("Cyclic");
}

fn command(out: &mut Writer, of: &CyclicCommand) {
    out.open("Cmd");
    of.states.iter().for_each(|state| out.leaf("State", state));
    if !of.comment.is_empty() {
        out.leaf("Comment", &of.comment);
    }
    commands::datagram(out, &of.datagram);
    out.some("InputOffs", of.input_offset);
    out.some("OutputOffs", of.output_offset);
    if !of.copies.is_empty() {
        out.open("CopyInfos");
        for copy in &of.copies {
            out.within("CopyInfo", |out| {
                out.leaf("SrcBitOffs", copy.source);
                out.leaf("DstBitOffs", copy.target);
                out.leaf("BitSize", copy.bits);
            });
        }
        out.close("CopyInfos");
    }
    out.close("Cmd");
}
