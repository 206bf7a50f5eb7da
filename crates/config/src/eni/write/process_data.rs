//! `ProcessData` of a SubDevice and `ProcessImage`.

use crate::eni::model::{BitRange, ImageSide, Pdo, ProcessData, ProcessImage, SyncManagerKind, SyncManagerSettings};
use crate::xml::Elements;

pub(super) fn of_subdevice(out: &mut Elements, of: &ProcessData) {
    out.within("ProcessData", |out| {
        of.send.iter().for_each(|of| range(out, "Send", *of));
        of.receive.iter().for_each(|of| range(out, "Recv", *of));
        of.sync_managers.iter().for_each(|of| sync_manager(out, of));
        of.pdos.iter().for_each(|of| pdo(out, of));
    });
}

fn range(out: &mut Elements, name: &str, of: BitRange) {
    out.within(name, |out| {
        out.leaf("BitStart", of.start);
        out.leaf("BitLength", of.length);
    });
}

fn sync_manager(out: &mut Elements, of: &SyncManagerSettings) {
    out.within(&format!("Sm{}", of.index), |out| {
        out.some("Type", of.kind.map(kind));
        out.some("DefaultSize", of.default_size);
        out.some("StartAddress", of.start);
        out.some("ControlByte", of.control);
        out.some("Enable", of.enable.map(u8::from));
        of.pdos.iter().for_each(|pdo| out.leaf("Pdo", pdo));
    });
}

const fn kind(of: SyncManagerKind) -> &'static str {
    match of {
        SyncManagerKind::Outputs => "Outputs",
        SyncManagerKind::Inputs => "Inputs",
        SyncManagerKind::MailboxOut => "MBoxOut",
        SyncManagerKind::MailboxIn => "MBoxIn",
    }
}

fn pdo(out: &mut Elements, of: &Pdo) {
    let number = of.sync_manager.map(|number| number.to_string());
    let mut attributes = vec![("Fixed", "1")];
    attributes.extend(number.as_deref().map(|number| ("Sm", number)));
    out.with(if of.outputs { "RxPdo" } else { "TxPdo" }, &attributes, |out| {
        out.leaf("Index", format_args!("#x{:04x}", of.index));
        out.leaf("Name", &of.name);
        for entry in &of.entries {
            out.within("Entry", |out| {
                out.leaf("Index", format_args!("#x{:04x}", entry.index));
                if entry.index != 0 || entry.sub_index != 0 {
                    out.leaf("SubIndex", entry.sub_index);
                }
                out.leaf("BitLen", entry.bit_length);
                out.text("Name", &entry.name);
                out.text("DataType", &entry.data_type);
            });
        }
    });
}

pub(super) fn image(out: &mut Elements, of: &ProcessImage) {
    out.within("ProcessImage", |out| {
        side(out, "Inputs", &of.inputs);
        side(out, "Outputs", &of.outputs);
    });
}

fn side(out: &mut Elements, name: &str, of: &ImageSide) {
    if of.bytes.is_none() && of.variables.is_empty() {
        return;
    }
    out.within(name, |out| {
        out.some("ByteSize", of.bytes);
        for variable in &of.variables {
            out.within("Variable", |out| {
                out.leaf("Name", &variable.name);
                out.text("DataType", &variable.data_type);
                out.leaf("BitSize", variable.bits);
                out.leaf("BitOffs", variable.bit_offset);
            });
        }
    });
}
