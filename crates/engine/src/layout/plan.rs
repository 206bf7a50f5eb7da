//! Parts of a layout: domains, their frames, and the datagrams in these.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{LogicalAddress, Wkc};
use ringcat_wire::command::Command;

use super::spec::{AreaSpec, Delivers};

/// Place of an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacedArea {
    /// The area.
    pub area: AreaSpec,
    /// First byte in the domain's image.
    pub image_offset: u32,
    /// Logical address of that byte.
    pub logical: LogicalAddress,
}

/// A datagram of a cyclic frame.
#[derive(Clone, Debug)]
pub struct PlannedDatagram {
    /// LRW, LWR, LRD, or BRD for supervision.
    pub command: Command,
    /// Logical address.
    pub logical: LogicalAddress,
    /// Bytes of outputs, at the beginning of the data.
    pub outputs: u16,
    /// Bytes of inputs, behind the outputs.
    pub inputs: u16,
    /// Increment of the working counter by each SubDevice.
    pub contributions: Vec<(usize, Wkc)>,
    /// Areas at the beginning of the data, without gaps.
    pub output_areas: Vec<PlacedArea>,
    /// Areas behind them, to deliver them one by one.
    pub input_areas: Vec<PlacedArea>,
}

/// A presence datagram: an LRD of one byte per SubDevice, its AL status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedPresence {
    /// Logical address of the first byte.
    pub logical: LogicalAddress,
    /// Index of the SubDevice of each byte, and when it gives its inputs.
    pub members: Vec<(usize, Delivers)>,
}

/// A frame of a domain.
#[derive(Clone, Debug, Default)]
pub struct PlannedFrame {
    /// Process data datagrams.
    pub datagrams: Vec<PlannedDatagram>,
    /// The presence datagram behind them, where a working counter of inputs has several SubDevices.
    pub presence: Option<PlannedPresence>,
    /// Whether this frame contains the supervision datagram.
    pub supervision: bool,
    /// Whether this frame contains the datagrams of distributed clocks.
    pub clocks: bool,
}

/// A domain that was laid out.
#[derive(Clone, Debug)]
pub struct PlannedDomain {
    /// From the specification; zero for a domain without one.
    pub period: Duration,
    /// From the specification: how often each frame may be on the wire at once.
    pub under_way: u8,
    /// Bytes of the image.
    pub image_len: u32,
    /// Logical addresses, one per byte on the wire.
    pub logical_len: u32,
    /// All areas with their places.
    pub areas: Vec<PlacedArea>,
    /// The frames.
    pub frames: Vec<PlannedFrame>,
}
