//! `ProcessData` of a SubDevice and `ProcessImage`.

use crate::eni::model::{BitRange, ImageSide, Pdo, ProcessData, ProcessImage, SyncManagerKind};
use crate::xml::Writer;

pub(super) fn of_subdevice(out: &mut Writer, of: &ProcessData) {
    out.open("ProcessData");
    of.send.iter().for_each(|of| range(out, "Send", *of));
    of.receive.iter().for_each(|of| range(out, "Recv", *of));
    for sm in &of.sync_managers {
        let name = format!("Sm{}", sm.index);
        out.open(&name);
        out.some("Type", sm.kind.map(kind));
        out.some("DefaultSize", sm.default_size);
        out.some("StartAddress", sm.start);
        out.some("ControlByte", sm.control);
        out.some("Enable", sm.enable.map(u8::from));
        sm.pdos.iter().for_each(|pdo| out.leaf("Pdo", pdo));
        out.close(&name);
    }
    of.pdos.iter().for_each(|of| pdo(out, of));
    out.close("ProcessData");
}

const fn kind(of: SyncManagerKind) -> &'static str {
    match of {
        SyncManagerKind::Outputs => "Outputs",
        SyncManagerKind::Inputs => "Inputs",
        SyncManagerKind::MailboxOut => "MBoxOut",
        SyncManagerKind::MailboxIn => "MBoxIn",
    }
}

fn range(out: &mut Writer, name: &str, of: BitRange) {
    out.within(name, |out| {
        out.leaf("BitStart", of.start);
        out.leaf("BitLength", of.length);
    });
}

fn pdo(out: &mut Writer, of: &Pdo) {
    let name = if of.outputs { "RxPdo" } else { "TxPdo" };
    match of.sync_manager {
        Some(number) => out.open(format_args!("{name} Fixed=\"1\" Sm=\"{number}\"")),
        None => out.open(format_args!("{name} Fixed=\"1\"")),
    }
    out.leaf("Index", format_args!("#x{:04x}", of.index));
    out.leaf("Name", &of.name);
    for entry in &of.entries {
        out.open("Entry");
        out.leaf("Index", format_args!("#x{:04x}", entry.index));
        if entry.index != 0 {
            out.leaf("SubIndex", entry.sub_index);
        }
        out.leaf("BitLen", entry.bit_length);
        if !entry.name.is_empty() {
            out.leaf("Name", &entry.name);
        }
        if !entry.data_type.is_empty() {
            out.leaf("DataType", &entry.data_type);
        }
        out.close("Entry");
    }
    out.close(name);
}

pub(super) fn image(out: &mut Writer, of: &ProcessImage) {
    out.open("ProcessImage");
    side(out, "Inputs", &of.inputs);
    side(out, "Outputs", &of.outputs);
    out.close("ProcessImage");
}

fn side(out: &mut Writer, name: &str, of: &ImageSide) {
    if of.bytes.is_none() && of.variables.is_empty() {
        return;
    }
    out.open(name);
    out.leaf("ByteSize", of.bytes.unwrap_or(0));
    for variable in &of.variables {
        out.within("Variable", |out| {
            out.leaf("Name", &variable.name);
            if !variable.data_type.is_empty() {
                out.leaf("DataType", &variable.data_type);
            }
            out.leaf("BitSize", variable.bits);
            out.leaf("BitOffs", variable.bit_offset);
        });
    }
    out.close(name);
}
