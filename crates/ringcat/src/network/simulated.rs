//! A simulated segment from a network file, to try it without hardware.

use std::fmt;

use ringcat_config::eni::EniError;
use ringcat_config::network::model::{CheckRevision, Target};
use ringcat_config::{ExportError, ExportOptions};
use ringcat_sim::network::Network;
use ringcat_sim::segment::SegmentError;

use super::{LoadedNetwork, NetworkFile};
use crate::eni::EniFile;

/// Why there is no simulated segment of a network file.
#[derive(Debug)]
#[non_exhaustive]
pub enum SimulatedNetworkError {
    /// The file leaves to the EEPROM what a simulated SubDevice has to be made of.
    Incomplete(Box<ExportError>),
    /// The description of its SubDevices in the file contradicts itself.
    Contradiction(Box<EniError>),
    /// The cables do not fit.
    Segment(SegmentError),
}

impl fmt::Display for SimulatedNetworkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SimulatedNetworkError::Incomplete(error) => error.fmt(f),
            SimulatedNetworkError::Contradiction(error) => error.fmt(f),
            SimulatedNetworkError::Segment(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for SimulatedNetworkError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            SimulatedNetworkError::Incomplete(error) => Some(&**error),
            SimulatedNetworkError::Contradiction(error) => Some(&**error),
            SimulatedNetworkError::Segment(error) => Some(error),
        }
    }
}

impl LoadedNetwork {
    /// A simulated segment of the SubDevices in the file, in their order; with `ring` its end is connected to the
    /// redundant interface. It is made as that of an ENI (`docs/eni.md`).
    ///
    /// # Errors
    /// [`SimulatedNetworkError`]: a SyncManager without address and control byte, or a PDO without entries.
    pub fn simulated(&self, ring: bool) -> Result<Network, SimulatedNetworkError> {
        let export = devices(&self.file).to_eni(&ExportOptions::default());
        let export = export.map_err(|error| SimulatedNetworkError::Incomplete(Box::new(error)))?;
        let mut file = EniFile::from_bytes(export.text.as_bytes())
            .map_err(|error| SimulatedNetworkError::Contradiction(Box::new(error)))?;
        let own = &self.configuration.declaration.subdevices;
        for (made, own) in file.configuration.declaration.subdevices.iter_mut().zip(own) {
            // The SubDevice is found by these: alias, identification, data word.
            made.address = own.address;
            made.expected.identification = own.expected.identification;
        }
        file.simulated(ring).map_err(SimulatedNetworkError::Segment)
    }
}

/// The SubDevices one behind the other, without what a MainDevice decides.
fn devices(file: &NetworkFile) -> NetworkFile {
    let mut devices = file.clone();
    (devices.required, devices.redundancy) = Default::default();
    for (index, subdevice) in (0..).zip(&mut devices.subdevice) {
        subdevice.position = Some(index);
        (subdevice.alias, subdevice.identification, subdevice.offset) = (None, None, None);
        subdevice.identification_word = None;
        (subdevice.group, subdevice.check_identification) = (None, None);
        (subdevice.optional, subdevice.target) = (false, Target::Op);
        subdevice.check_revision = CheckRevision::None;
    }
    let with_signals = devices.subdevice.iter().find(|subdevice| subdevice.sync.is_some());
    let first = with_signals.map(|subdevice| subdevice.name.clone());
    match &mut devices.clocks {
        Some(clocks) if clocks.reference.is_none() && first.is_some() => clocks.reference = first,
        clocks => *clocks = clocks.take().filter(|clocks| clocks.reference.is_some()),
    }
    devices
}
