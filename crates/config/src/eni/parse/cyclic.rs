//! `Cyclic`: tasks, their frames and commands.

use super::commands;
use crate::eni::element::Element;
use crate::eni::error::EniError;
use crate::eni::model::{CopyInfo, CyclicCommand, CyclicState, CyclicTask, Frame};

/// A task.
pub(super) fn task(element: Element<'_>) -> Result<CyclicTask, EniError> {
    element.expects(&["Comment", "CycleTime", "Priority", "TaskId", "Frame"]);
    Ok(CyclicTask {
        place: element.place(),
        comment: element.text_of("Comment"),
        cycle_us: element.number_of("CycleTime")?,
        frames: element.children("Frame").map(frame).collect::<Result<_, _>>()?,
    })
}

fn frame(element: Element<'_>) -> Result<Frame, EniError> {
    element.expects(&["Comment", "Cmd"]);
    Ok(Frame { commands: element.children("Cmd").map(command).collect::<Result<_, _>>()? })
}

fn command(element: Element<'_>) -> Result<CyclicCommand, EniError> {
    element.expects(&[
        "State",
        "Comment",
        "Cmd",
        "Adp",
        "Ado",
        "Addr",
        "Data",
        "DataLength",
        "Cnt",
        "InputOffs",
        "OutputOffs",
        "CopyInfos",
    ]);
    let copies = match element.child("CopyInfos") {
        None => Vec::new(),
        Some(copies) => copies.children("CopyInfo").map(copy).collect::<Result<_, _>>()?,
    };
    Ok(CyclicCommand {
        place: element.place(),
        states: element.children("State").map(state).collect::<Result<_, _>>()?,
        comment: element.text_of("Comment"),
        datagram: commands::datagram(element)?,
        input_offset: element.number_of("InputOffs")?,
        output_offset: element.number_of("OutputOffs")?,
        copies,
    })
}

/// Names, or ordinal numbers (protocol 8.2: not AL codes).
fn state(element: Element<'_>) -> Result<CyclicState, EniError> {
    Ok(match element.text().to_uppercase().as_str() {
        "1" | "INIT" => CyclicState::Init,
        "2" | "PREOP" => CyclicState::PreOp,
        "3" | "SAFEOP" => CyclicState::SafeOp,
        "4" | "OP" => CyclicState::Op,
        _ => return Err(element.wrong("a state: INIT, PREOP, SAFEOP, OP, or their numbers 1 to 4")),
    })
}

fn copy(element: Element<'_>) -> Result<CopyInfo, EniError> {
    element.expects(&["SrcBitOffs", "DstBitOffs", "BitSize"]);
    Ok(CopyInfo {
        place: element.place(),
        source: element.required_number("SrcBitOffs")?,
        target: element.required_number("DstBitOffs")?,
        bits: element.required_number("BitSize")?,
    })
}
