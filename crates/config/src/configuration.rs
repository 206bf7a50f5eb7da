//! The result of a configuration file: a declaration for the engine, the process image with the layout of the file, and
//! the settings of the file that are not followed.
//!
//! The image is the application's view. On the wire the engine lays out process data byte-aligned and at its own
//! logical addresses; [`ImageArea`] maps bits of a SyncManager to bits of the image.

use std::fmt;
use std::time::Duration;

use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::Declaration;
use ringcat_engine::{JunctionConnection, JunctionMode};
use ringcat_wire::address::StationAddress;

use crate::eni::{Place, Port};

/// The configuration that results from a file.
#[derive(Clone, Debug, Default)]
pub struct Configuration {
    /// The declaration for the engine. Its SubDevices are in document order, as in [`Configuration::subdevices`].
    pub declaration: Declaration,
    /// Other properties of each SubDevice in the file.
    pub subdevices: Vec<SubDeviceFacts>,
    /// Hot connect groups, by the number in [`SubDeviceConfig::group`].
    pub groups: Vec<String>,
    /// The process image.
    pub image: ProcessImage,
    /// Cycle time of the fastest task; `None` if the file has none.
    pub cycle: Option<Duration>,
    /// Settings of the file that are not followed, with the reason.
    pub notices: Vec<Notice>,
    /// Rings that the file declares.
    pub rings: DeclaredRings,
}

/// Rings that a file declares.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeclaredRings {
    /// The segment is a ring: it needs a redundant interface.
    pub is_ring: bool,
    /// Handling of rings behind junctions.
    pub junctions: JunctionMode,
    /// The closing cables of these rings.
    pub connections: Vec<JunctionConnection>,
}

impl Configuration {
    /// The declaration of a SubDevice with its other properties in the file.
    pub fn subdevice(&self, subdevice: SubDeviceId) -> Option<(&SubDeviceConfig, &SubDeviceFacts)> {
        Some((self.declaration.subdevices.get(subdevice.0)?, self.subdevices.get(subdevice.0)?))
    }

    /// The SubDevice to which the file gives this station address (`PhysAddr`).
    pub fn at_station(&self, station: StationAddress) -> Option<SubDeviceId> {
        self.subdevices.iter().position(|facts| facts.station == Some(station.0)).map(SubDeviceId)
    }
}

/// Properties of a SubDevice in the file besides its declaration.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubDeviceFacts {
    /// Its name.
    pub name: String,
    /// `PhysAddr`: the station address in the file. On the wire the engine assigns a station address of its own choice.
    pub station: Option<u16>,
    /// The upstream connection, if the file states it: index of the SubDevice, its port.
    pub plugged_into: Option<(usize, Port)>,
    /// Address for AoE.
    pub net_id: Option<[u8; 6]>,
}

/// The process image of the application.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessImage {
    /// Bytes of the input image.
    pub inputs_len: usize,
    /// Bytes of the output image.
    pub outputs_len: usize,
    /// Positions of process data in the two images.
    pub areas: Vec<ImageArea>,
    /// Variables in document order.
    pub variables: Vec<Variable>,
    /// Inputs that are copied to outputs in every cycle, split at the borders of areas.
    pub copies: Vec<ImageCopy>,
}

/// Process data of a SubDevice and its position in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageArea {
    /// Index of the SubDevice in the declaration.
    pub subdevice: usize,
    /// The image: inputs or outputs.
    pub direction: Direction,
    /// The SyncManager. `None` if the file names none: then all process data of the SubDevice in this direction is one
    /// sequence of bits, in the order of its SyncManagers.
    pub sync_manager: Option<u8>,
    /// First bit in the process data.
    pub bit_offset: u32,
    /// First bit in the image.
    pub image_bit: u32,
    /// Number of bits.
    pub bits: u32,
}

/// A variable of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its type as the file writes it.
    pub data_type: String,
    /// The image: inputs or outputs.
    pub direction: Direction,
    /// First bit.
    pub image_bit: u32,
    /// Number of bits.
    pub bits: u32,
    /// The SubDevice with this process data; `None` if no SubDevice has it: then it is neither written nor read.
    pub subdevice: Option<usize>,
}

/// Inputs that are copied to outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageCopy {
    /// Source area: index in [`ProcessImage::areas`].
    pub source_area: usize,
    /// First bit in the source area.
    pub source_bit: u32,
    /// Target area: index in [`ProcessImage::areas`].
    pub target_area: usize,
    /// First bit in the target area.
    pub target_bit: u32,
    /// Number of bits.
    pub bits: u32,
}

/// A setting of the file that is not followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The element and its subject.
    pub subject: String,
    /// Why it is not followed, or what replaces it.
    pub reason: String,
    /// First occurrence in the file.
    pub place: Option<Place>,
    /// Number of occurrences.
    pub times: usize,
    /// The SubDevices concerned.
    pub subdevices: Vec<usize>,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subject, self.reason)?;
        match (self.place, self.times) {
            (Some(place), 1) => write!(f, " ({place})"),
            (Some(place), times) => write!(f, " ({times} times, first in {place})"),
            (None, _) => Ok(()),
        }
    }
}
