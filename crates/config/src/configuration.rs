//! What follows from a configuration file: a declaration for the engine, the process image as the file lays it out, and
//! what of the file is not followed.
//!
//! The image is the application's view. On the wire process data lies as the engine lays it out, byte-aligned and at
//! its own logical addresses; [`ImageArea`] says which bits of which SyncManager are which bits of the image.

use std::fmt;
use std::time::Duration;

use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::Declaration;

use crate::eni::{Place, Port};

/// What follows from a file.
#[derive(Clone, Debug, Default)]
pub struct Configuration {
    /// What the engine is told. Its SubDevices stand in document order; [`Configuration::subdevices`] has as many.
    pub declaration: Declaration,
    /// What else the file says of each SubDevice.
    pub subdevices: Vec<SubDeviceFacts>,
    /// Hot connect groups, by the number in [`SubDeviceConfig::group`].
    pub groups: Vec<String>,
    /// The process image.
    pub image: ProcessImage,
    /// Cycle time of the fastest task; `None` where the file has none.
    pub cycle: Option<Duration>,
    /// What of the file is not followed, and why.
    pub notices: Vec<Notice>,
}

impl Configuration {
    /// The declaration of a SubDevice with what else the file says of it.
    pub fn subdevice(&self, index: usize) -> Option<(&SubDeviceConfig, &SubDeviceFacts)> {
        Some((self.declaration.subdevices.get(index)?, self.subdevices.get(index)?))
    }

    /// Index of the SubDevice to which the file gives this station address (`PhysAddr`).
    pub fn at_station(&self, station: u16) -> Option<usize> {
        self.subdevices.iter().position(|facts| facts.station == Some(station))
    }
}

/// What the file says of a SubDevice besides its declaration.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubDeviceFacts {
    /// Its name.
    pub name: String,
    /// `PhysAddr`: what its users call it. On the wire the engine gives it a station address of its own choice.
    pub station: Option<u16>,
    /// What it is plugged into, where the file says so: index of the SubDevice, its port.
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
    /// Where process data of SubDevices lies in them.
    pub areas: Vec<ImageArea>,
    /// Variables in document order.
    pub variables: Vec<Variable>,
    /// Inputs that are copied to outputs in every cycle, cut at the borders of areas.
    pub copies: Vec<ImageCopy>,
}

/// Process data of a SubDevice and its place in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageArea {
    /// Index of the SubDevice in the declaration.
    pub subdevice: usize,
    /// In which image.
    pub direction: Direction,
    /// The SyncManager; `None` where the file names none: then all process data of the SubDevice in this direction is
    /// one row of bits, in the order of its SyncManagers.
    pub sync_manager: Option<u8>,
    /// First bit in that process data.
    pub bit_offset: u32,
    /// First bit in the image.
    pub image_bit: u32,
    /// Bits.
    pub bits: u32,
}

/// A variable of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its type as the file writes it.
    pub data_type: String,
    /// In which image.
    pub direction: Direction,
    /// First bit.
    pub image_bit: u32,
    /// Bits.
    pub bits: u32,
    /// The SubDevice with this process data; `None` where it belongs to none: then it is neither written nor read.
    pub subdevice: Option<usize>,
}

/// Inputs that are copied to outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageCopy {
    /// Number of the area in [`ProcessImage::areas`] where they come from.
    pub source_area: usize,
    /// First bit in that area.
    pub source_bit: u32,
    /// Number of the area where they go.
    pub target_area: usize,
    /// First bit in that area.
    pub target_bit: u32,
    /// Bits.
    pub bits: u32,
}

/// Something of the file that is not followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The element and what it is about.
    pub subject: String,
    /// Why it is not followed, or what happens in its place.
    pub reason: String,
    /// Where it first stands.
    pub place: Option<Place>,
    /// How often.
    pub times: usize,
    /// The SubDevices that it is about.
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
