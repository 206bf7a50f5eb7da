//! From a [`Configuration`] to an ENI, the inverse of [`crate::follow`]: the file has every command that a MainDevice
//! needs to bring the network to OP, and the reader gives the same declaration back (docs/decisions/0160).
//!
//! What an ENI cannot express is refused where another network would result, and listed in [`Export::left_out`]
//! otherwise. Each file is read again before it is given out: a difference is an error with its name.

mod checks;
mod clocks;
mod details;
mod error;
mod explicit;
mod init_commands;
mod layout;
mod left_out;
mod lrw;
mod mailbox;
mod mailbox_commands;
mod options;
mod order;
mod process_data;
mod read_back;
mod service;
mod subdevice;
mod transitions;
mod whole_bus;

pub use details::{ExportDetails, SubDeviceDetails};
pub use error::{ExportError, LeftOut};
pub use options::{ExportOptions, LrwUse};
#[cfg(feature = "network")]
pub(crate) use {checks::odd_limit, order::is_expressible};

use crate::configuration::Configuration;
use crate::eni::{self, Eni};
use crate::follow::follow;
use crate::xml::one_line;

/// An ENI.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Export {
    /// The text of the file.
    pub text: String,
    /// What the reader gives for this text.
    pub configuration: Configuration,
    /// What the file does not hold, with the reason.
    pub left_out: Vec<LeftOut>,
}

/// The ENI of a configuration; `details` are the parts of the file that are for people and for other MainDevices.
///
/// # Errors
/// [`ExportError`]: the SubDevice and what an ENI cannot express.
pub fn export(
    configuration: &Configuration,
    details: &ExportDetails,
    options: &ExportOptions,
) -> Result<Export, ExportError> {
    checks::check(configuration)?;
    let mut left_out = left_out::of(configuration);
    let lrw = lrw::subdevices(&configuration.declaration, options.lrw);
    let whole = explicit::explicit(configuration, &lrw, &mut left_out);
    let eni = compose(&whole, details, &lrw)?;
    let text = eni::write(&eni);
    let read = eni::read(text.as_bytes()).and_then(|eni| follow(&eni));
    let read = read.map_err(|error| ExportError::whole("the written file", error.to_string()))?;
    read_back::check(&whole, &read, &lrw)?;
    Ok(Export { text, configuration: read, left_out })
}

/// The model of the file.
fn compose(whole: &Configuration, details: &ExportDetails, lrw: &lrw::Lrw) -> Result<Eni, ExportError> {
    let nothing = SubDeviceDetails::default();
    let layout = layout::Layout::of(whole, lrw)?;
    let count = whole.declaration.subdevices.len();
    let subdevices = (0..count).map(|index| {
        let details = details.subdevices.get(index).unwrap_or(&nothing);
        subdevice::subdevice(whole, index, details, &layout)
    });
    Ok(Eni {
        version: None,
        made_by: Some(format!("Created with RingCAT {}", env!("CARGO_PKG_VERSION"))),
        main_device: whole_bus::main_device(one_line(&details.name)),
        subdevices: subdevices.collect::<Result<_, _>>()?,
        tasks: layout.tasks(whole, &details.tasks)?,
        image: process_data::image(whole)?,
        ..Eni::default()
    })
}
