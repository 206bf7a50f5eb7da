//! Networks from a network file of RingCAT (TOML): the file gives the declaration, the process image and its variables.
//!
//! `ringcat-config` reads the file; [`EniImage`](crate::eni::EniImage) is its process image at run time, as for an ENI.
//! The format is described in `docs/network-file.md`.
//!
//! ```
//! use std::time::Duration;
//! use ringcat::eni::EniImage;
//! use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
//! use ringcat::simulated::SimulatedSegment;
//! use ringcat::{MainDevice, Options};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let links = SimulatedSegment::from_toml("[segment]\n[[device]]\ntype = \"digital-output-8\"\n")?;
//! let mut main_device = MainDevice::request(links, &Options::default());
//! let scan = main_device.scan()?;
//! let options = ScanOptions::new("lamps", Duration::from_millis(1));
//! let text = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options).to_text();
//!
//! let network = LoadedNetwork::from_bytes("lamps.toml", text.as_bytes())?;
//! let mut application = main_device.activate(network.declaration())?;
//! let mut image = EniImage::new(&network.configuration, application.directory())?;
//! let lamp = image.variable("digital-output-8.Channel 3.Output").cloned().ok_or("no such variable")?;
//! application.wait_until_op(Duration::from_secs(10))?;
//! image.write(&lamp, 1);
//! for _ in 0..10 {
//!     application.cycle(|data| image.give_outputs(data));
//! }
//! # Ok(())
//! # }
//! ```

#[cfg(feature = "sim")]
mod simulated;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ringcat_config::network::{MAX_NETWORK_BYTES, NetworkError};
use ringcat_config::{Configuration, Export, ExportOptions, StatedProperties};
use ringcat_engine::main_device::Declaration;

use crate::regular_file::read_at_most;

pub use ringcat_config::network::{Digest, NetworkFile, ScanOptions};
#[cfg(feature = "sim")]
pub use simulated::SimulatedNetworkError;

/// A network file with the configuration derived from it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LoadedNetwork {
    /// Content of the file.
    pub file: NetworkFile,
    /// The configuration derived from it.
    pub configuration: Configuration,
    /// The name and the text of the file, for messages.
    source: Option<(String, Arc<str>)>,
}

/// Why a network file cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum NetworkFailure {
    /// The file cannot be read.
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// Its content is not valid.
    Content(Box<NetworkError>),
}

impl fmt::Display for NetworkFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NetworkFailure::Read { path, error } => write!(f, "{}: cannot be read: {error}", path.display()),
            NetworkFailure::Content(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for NetworkFailure {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            NetworkFailure::Read { error, .. } => Some(error),
            NetworkFailure::Content(error) => Some(&**error),
        }
    }
}

impl LoadedNetwork {
    /// Reads a file.
    ///
    /// # Errors
    /// [`NetworkFailure`]: with file, line and key where something in it is wrong.
    pub fn load(path: &Path) -> Result<LoadedNetwork, NetworkFailure> {
        let failed = |error| NetworkFailure::Read { path: path.to_owned(), error };
        let bytes = read_at_most(path, MAX_NETWORK_BYTES as u64 + 1).map_err(failed)?;
        let length = std::fs::metadata(path).map_err(failed)?.len();
        let name = path.display().to_string();
        if bytes.len() > MAX_NETWORK_BYTES && length > MAX_NETWORK_BYTES as u64 {
            return Err(NetworkFailure::Content(Box::new(NetworkError::too_long(&name, length))));
        }
        LoadedNetwork::from_bytes(&name, &bytes)
    }

    /// Reads the bytes of a file; `name` is the file in messages.
    ///
    /// # Errors
    /// [`NetworkFailure::Content`]: with file, line and key.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<LoadedNetwork, NetworkFailure> {
        let file = NetworkFile::read(name, bytes).map_err(|error| NetworkFailure::Content(Box::new(error)))?;
        let source = std::str::from_utf8(bytes).ok().map(|text| (name.to_owned(), Arc::from(text)));
        Ok(LoadedNetwork { source, ..LoadedNetwork::new(file) })
    }

    /// A network file that the application has made.
    pub fn new(file: NetworkFile) -> LoadedNetwork {
        let configuration = file.configuration();
        LoadedNetwork { file, configuration, source: None }
    }

    /// The ENI of the network, as [`NetworkFile::to_eni`].
    ///
    /// # Errors
    /// [`NetworkFailure::Content`]: what an ENI cannot express, with file, line and key; without a line for a network
    /// that the application has made.
    pub fn to_eni(&self, options: &ExportOptions) -> Result<Export, NetworkFailure> {
        let (name, text) = self.source.as_ref().map_or(("network file", ""), |(name, text)| (name, text));
        let failed = |error| NetworkFailure::Content(Box::new(NetworkError::of_export(name, text, &error)));
        self.file.to_eni(options).map_err(failed)
    }

    /// The declaration to activate.
    pub fn declaration(&self) -> Declaration {
        self.configuration.declaration.clone()
    }

    /// What the file states of each SubDevice besides the declaration, to compare it with a network.
    pub fn stated(&self) -> Vec<StatedProperties> {
        self.file.stated()
    }
}
