//! Cycles and process image of an ENI (protocol 8.1).

use std::fmt;

use super::command::Datagram;
use crate::eni::Place;

/// A state in which a cyclic command is sent (protocol 8.2: ordinal numbers, not AL state codes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CyclicState {
    /// 1, INIT.
    Init,
    /// 2, PREOP.
    PreOp,
    /// 3, SAFEOP.
    SafeOp,
    /// 4, OP.
    Op,
}

impl fmt::Display for CyclicState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CyclicState::Init => "INIT",
            CyclicState::PreOp => "PREOP",
            CyclicState::SafeOp => "SAFEOP",
            CyclicState::Op => "OP",
        })
    }
}

/// `Cyclic`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CyclicTask {
    /// Its position in the file.
    pub place: Place,
    /// `Comment`.
    pub comment: String,
    /// `CycleTime` in microseconds.
    pub cycle_us: Option<u32>,
    /// `Frame`.
    pub frames: Vec<Frame>,
}

/// `Cyclic/Frame`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its commands.
    pub commands: Vec<CyclicCommand>,
}

/// `Cyclic/Frame/Cmd`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CyclicCommand {
    /// Its position in the file.
    pub place: Place,
    /// States in which it is sent.
    pub states: Vec<CyclicState>,
    /// `Comment`.
    pub comment: String,
    /// The datagram.
    pub datagram: Datagram,
    /// `InputOffs`: byte offset in the input image.
    pub input_offset: Option<u32>,
    /// `OutputOffs`: byte offset in the output image.
    pub output_offset: Option<u32>,
    /// `CopyInfos`.
    pub copies: Vec<CopyInfo>,
}

/// `CopyInfo`: bits of the input image that are copied to the output image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CopyInfo {
    /// Its position in the file.
    pub place: Place,
    /// `SrcBitOffs`.
    pub source: u32,
    /// `DstBitOffs`.
    pub target: u32,
    /// `BitSize`.
    pub bits: u32,
}

/// `ProcessImage`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessImage {
    /// `Inputs`.
    pub inputs: ImageSide,
    /// `Outputs`.
    pub outputs: ImageSide,
}

/// `Inputs` or `Outputs`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImageSide {
    /// `ByteSize`; `None` if the file has no image.
    pub bytes: Option<u32>,
    /// `Variable`.
    pub variables: Vec<Variable>,
}

/// `Variable`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its position in the file.
    pub place: Place,
    /// `Name`.
    pub name: String,
    /// `DataType`.
    pub data_type: String,
    /// `BitSize`.
    pub bits: u32,
    /// `BitOffs`.
    pub bit_offset: u32,
}
