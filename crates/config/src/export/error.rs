//! What an ENI cannot express.

use std::fmt;

use crate::configuration::Configuration;

/// Why a network cannot be written as an ENI.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ExportError {
    /// The SubDevice: its index and its name; `None`: the whole network.
    pub subdevice: Option<(usize, String)>,
    /// The setting.
    pub what: String,
    /// The reason.
    pub reason: String,
    /// The key that has the setting in a network file, within the SubDevice if there is one, as in
    /// `sync_manager[1].start`; empty if no single key has it.
    pub key: String,
}

impl ExportError {
    /// About the whole network.
    pub(crate) fn whole(what: impl Into<String>, reason: impl Into<String>) -> ExportError {
        ExportError { subdevice: None, what: what.into(), reason: reason.into(), key: String::new() }
    }

    /// With the key of a network file.
    pub(crate) fn at(self, key: impl Into<String>) -> ExportError {
        ExportError { key: key.into(), ..self }
    }

    /// About a SubDevice.
    pub(crate) fn of(
        configuration: &Configuration,
        index: usize,
        what: impl Into<String>,
        reason: impl Into<String>,
    ) -> ExportError {
        let name = configuration.subdevices.get(index).map(|facts| facts.name.clone()).unwrap_or_default();
        let subdevice = Some((index, name));
        ExportError { subdevice, what: what.into(), reason: reason.into(), key: String::new() }
    }
}

impl fmt::Display for ExportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((index, name)) = &self.subdevice {
            write!(f, "SubDevice {index} {}: ", crate::xml::shown(name))?;
        }
        write!(f, "{}: {}", self.what, self.reason)
    }
}

impl std::error::Error for ExportError {}

/// A setting that the file does not hold. The network of the file reaches OP without it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeftOut {
    /// The index of the SubDevice; `None`: the whole network.
    pub subdevice: Option<usize>,
    /// The setting.
    pub what: String,
    /// The effect of its absence.
    pub reason: String,
}

impl LeftOut {
    pub(crate) fn new(
        subdevice: impl Into<Option<usize>>,
        what: impl Into<String>,
        reason: impl Into<String>,
    ) -> LeftOut {
        LeftOut { subdevice: subdevice.into(), what: what.into(), reason: reason.into() }
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(index) = self.subdevice {
            write!(f, "SubDevice {index}: ")?;
        }
        write!(f, "{}: {}", self.what, self.reason)
    }
}
