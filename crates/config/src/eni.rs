//! ENI files (ETG.2100; protocol 8): input is the bytes of a file, output an [`Eni`] or an error with line, column and
//! element, and the text of a file for an [`Eni`].
//!
//! The reader is lenient where the files of tools differ (order of elements, `#x` and `0x` numbers, encodings, unknown
//! elements). It is strict where a wrong guess would result in a wrong network: an invalid number, data with half a
//! byte, a missing element. [`Eni::unknown`] lists unknown elements.

mod element;
mod error;
mod kind;
mod model;
mod parse;
mod write;

pub use crate::xml::Place;
pub(crate) use crate::xml::shown as quoted;
pub use crate::xml::{MAX_ATTRIBUTES, MAX_BYTES, MAX_DEPTH, MAX_NODES, MAX_SUBDEVICES, MAX_UNKNOWN};
pub use error::{Contradiction, EniError, Problem};
pub use kind::FileKind;
pub use model::{
    BitRange, CoeCommand, CopyInfo, CyclicCommand, CyclicState, CyclicTask, Datagram, DistributedClock, EcatCommand,
    Eni, EoeCommand, Frame, HotConnect, ImageSide, Mailbox, MailboxBuffer, MailboxStates, MainDevice, Pdo, PdoEntry,
    Poll, Port, PreviousPort, ProcessData, ProcessImage, RawMailCommand, Requires, SoeCommand, SubDevice,
    SyncManagerKind, SyncManagerSettings, Target, Transition, Unknown, Validate, Variable,
};

pub use write::write;

use crate::xml;

/// Reads an ENI.
pub fn read(bytes: &[u8]) -> Result<Eni, EniError> {
    let text = xml::decode(bytes).map_err(|error| EniError::of_xml(error, bytes))?;
    xml::check(&text).map_err(|error| EniError::of_xml(error, bytes))?;
    parse::parse(&text)
}
