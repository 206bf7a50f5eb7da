//! ENI files (ETG.2100; facts 8): bytes go in, [`Eni`] or an error with line, column and element comes out.
//!
//! The reader is lenient where files of different tools differ (order of elements, `#x` and `0x` numbers, encodings,
//! elements that it does not know) and strict where a wrong guess would make a wrong network: a number that is none, data
//! with half a byte, an element that must be there. What it did not know is listed in [`Eni::unknown`].

mod element;
mod error;
mod guard;
mod kind;
mod model;
mod parse;
mod text;

pub(crate) use error::shown as quoted;
pub use error::{Contradiction, EniError, Place, Problem};
pub use kind::FileKind;
pub use model::{
    BitRange, CoeCommand, CopyInfo, CyclicCommand, CyclicState, CyclicTask, Datagram, DistributedClock, EcatCommand,
    Eni, EoeCommand, Frame, HotConnect, ImageSide, Mailbox, MailboxBuffer, MailboxStates, MainDevice, Pdo, PdoEntry,
    Poll, Port, PreviousPort, ProcessData, ProcessImage, RawMailCommand, Requires, SoeCommand, SubDevice,
    SyncManagerKind, SyncManagerSettings, Target, Transition, Unknown, Validate, Variable,
};

/// Bytes that a file may have. An ENI takes about 40 KiB per servo drive: this is room for more than a thousand.
pub const MAX_BYTES: usize = 64 << 20;
/// XML nodes (elements and texts) that a file may have.
pub const MAX_NODES: u32 = 6_000_000;
/// Levels of elements within each other; an ENI has about ten.
pub const MAX_DEPTH: usize = 64;
/// Attributes of one element, and namespaces of a whole file.
pub const MAX_ATTRIBUTES: usize = 64;
/// SubDevices of a segment: there are 65,535 station addresses.
pub const MAX_SUBDEVICES: usize = 65_535;
/// Unknown elements that are listed; the others are counted.
pub const MAX_UNKNOWN: usize = 100;

/// Reads an ENI.
pub fn read(bytes: &[u8]) -> Result<Eni, EniError> {
    let text = text::decode(bytes)?;
    guard::check(&text)?;
    parse::parse(&text)
}
