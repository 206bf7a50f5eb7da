//! An ENI from a file: parsed, evaluated, and ready for activation.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use ringcat_config::eni::{Eni, EniError, MAX_BYTES, Mailbox, MailboxBuffer, read};
use ringcat_config::{Configuration, Difference, StatedProperties, follow};
use ringcat_engine::Topology;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::Declaration;
#[cfg(feature = "sim")]
use ringcat_sim::network::Network;
#[cfg(feature = "sim")]
use ringcat_sim::segment::SegmentError;
use ringcat_wire::sii::MailboxProtocols;

#[cfg(feature = "sim")]
use super::segment::segment;
use crate::regular_file::read_at_most;
use crate::text::Names;

/// An ENI with the configuration derived from it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct EniFile {
    /// Content of the file.
    pub eni: Eni,
    /// The configuration derived from it.
    pub configuration: Configuration,
}

/// Why a file cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub struct LoadError {
    /// The file.
    pub path: PathBuf,
    /// The fault.
    pub cause: LoadFailure,
}

/// A fault of a file.
#[derive(Debug)]
#[non_exhaustive]
pub enum LoadFailure {
    /// It cannot be read.
    Read(io::Error),
    /// It is larger than any ENI.
    TooLarge,
    /// It is not an ENI, or its content cannot be used.
    Eni(Box<EniError>),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.cause)
    }
}

impl fmt::Display for LoadFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadFailure::Read(error) => write!(f, "cannot be read: {error}"),
            LoadFailure::TooLarge => write!(f, "expected at most {MAX_BYTES} bytes, got more"),
            LoadFailure::Eni(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for LoadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl std::error::Error for LoadFailure {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            LoadFailure::Read(error) => Some(error),
            LoadFailure::Eni(error) => Some(&**error),
            _ => None,
        }
    }
}

impl EniFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`LoadError`]: with line, column and element where something in it is wrong.
    pub fn load(path: &Path) -> Result<EniFile, LoadError> {
        let failed = |cause| LoadError { path: path.to_owned(), cause };
        let read = read_at_most(path, MAX_BYTES as u64 + 1);
        let bytes = read.map_err(|error| failed(LoadFailure::Read(error)))?;
        if bytes.len() > MAX_BYTES {
            return Err(failed(LoadFailure::TooLarge));
        }
        EniFile::from_bytes(&bytes).map_err(|error| failed(LoadFailure::Eni(Box::new(error))))
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`EniError`]: with line, column and element.
    pub fn from_bytes(bytes: &[u8]) -> Result<EniFile, EniError> {
        let eni = read(bytes)?;
        let configuration = follow(&eni)?;
        Ok(EniFile { eni, configuration })
    }

    /// The declaration to activate. With `split_lrw` the engine may send LRD and LWR where the file has an LRW over
    /// several SubDevices, which is required with two links (protocol CR-16, 9.2.2).
    pub fn declaration(&self, split_lrw: bool) -> Declaration {
        let mut declaration = self.configuration.declaration.clone();
        if split_lrw {
            declaration.explicit_lrw.clear();
        }
        declaration
    }

    /// Names of the SubDevices for messages: name and station address of the file.
    pub fn names(&self) -> Names {
        Names(self.configuration.names())
    }

    /// Compares the SubDevices of a scan with the file. Returns each SubDevice that is missing, has another identity,
    /// or is not in the file.
    pub fn compare(&self, found: &[SubDeviceInfo]) -> Vec<Difference> {
        self.configuration.compare(found)
    }

    /// What the file states of each SubDevice besides the declaration (`Info`), to compare it with a network.
    pub fn stated(&self) -> Vec<StatedProperties> {
        let stated = |subdevice: &ringcat_config::eni::SubDevice| {
            let mut stated = StatedProperties::default();
            // The elements are required in an ENI: 0 means that the identity is not stated.
            let [vendor, product, revision] = [subdevice.vendor_id, subdevice.product_code, subdevice.revision]
                .map(|number| number.filter(|number| *number != 0));
            stated.device = vendor.zip(product);
            stated.revision = revision;
            stated.ports = ports(&subdevice.physics);
            if let Some(mailbox) = &subdevice.mailbox {
                // A list may be absent: then nothing is stated.
                stated.protocols = Some(protocols(&mailbox.protocols)).filter(|it| it.0 != 0);
                stated.boot_mailbox = boot_mailbox(mailbox);
            }
            stated
        };
        self.eni.subdevices.iter().map(stated).collect()
    }

    /// Cables that differ from `PreviousPort`.
    pub fn compare_cables(&self, found: &[SubDeviceInfo], topology: &Topology) -> Vec<Difference> {
        self.configuration.compare_cables(found, topology)
    }

    /// A simulated segment as in the file; with `ring` its end is connected to the redundant interface.
    ///
    /// # Errors
    /// [`SegmentError`]: the cables do not fit.
    #[cfg(feature = "sim")]
    pub fn simulated(&self, ring: bool) -> Result<Network, SegmentError> {
        Network::from_description(segment(&self.eni, &self.configuration, ring))
    }
}

/// Letters of the ports as in a network file; others are no port. In an ENI fast hot connect is `B`.
fn ports(physics: &str) -> String {
    let letter = |kind: char| match kind {
        'Y' | 'K' => kind,
        'H' | 'B' => 'H',
        _ => ' ',
    };
    physics.chars().take(4).map(letter).collect()
}

fn protocols(names: &[String]) -> MailboxProtocols {
    let bit = |name: &String| match name.trim().to_ascii_uppercase().as_str() {
        "AOE" => MailboxProtocols::AOE,
        "EOE" => MailboxProtocols::EOE,
        "COE" => MailboxProtocols::COE,
        "FOE" => MailboxProtocols::FOE,
        "SOE" => MailboxProtocols::SOE,
        "VOE" => MailboxProtocols::VOE,
        _ => 0,
    };
    MailboxProtocols(names.iter().map(bit).fold(0, |all, bit| all | bit))
}

/// Mailboxes in BOOT. EC-Engineer repeats the others where the device has none of its own: they state nothing.
fn boot_mailbox(of: &Mailbox) -> Option<[(u16, u16); 2]> {
    let place = |buffer: &MailboxBuffer| (buffer.start, buffer.length);
    let boot = of.bootstrap.as_ref().map(|(write, read)| [place(write), place(read)])?;
    let standard = of.send.as_ref().zip(of.receive.as_ref()).map(|(write, read)| [place(write), place(read)]);
    (standard != Some(boot)).then_some(boot)
}
