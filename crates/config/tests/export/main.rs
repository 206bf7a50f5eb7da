//! ENIs that are written (protocol 8): from other ENIs, from network files, with whatever texts they hold.

mod commands;
mod empty_pdos;
mod limits;
mod networks;
mod refusals;
mod revisions;
mod round_trips;
mod schema;

use ringcat_config::eni::{self, Eni};
use ringcat_config::network::NetworkFile;
use ringcat_config::{Configuration, Export, ExportDetails, ExportError, ExportOptions, export, follow};

/// A coupler, two terminals whose outputs share a byte, a drive with mailbox and clock.
pub const SMALL: &str = include_str!("../files/small.xml");
/// A coupler, a drive with mailbox and clock, a group, a terminal that is enabled in OP only; two domains.
pub const CELL: &str = include_str!("../files/cell.network.toml");

/// The model of a readable file.
pub fn model(text: &str) -> Eni {
    eni::read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// The configuration of a valid file.
pub fn configured(text: &str) -> Configuration {
    follow(&model(text)).unwrap_or_else(|error| panic!("{error}"))
}

/// The ENI of an ENI.
pub fn again(text: &str, options: &ExportOptions) -> Result<Export, ExportError> {
    export(&configured(text), &ExportDetails::of(&model(text)), options)
}

/// A valid network file.
pub fn network(text: &str) -> NetworkFile {
    NetworkFile::read("cell.toml", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}
