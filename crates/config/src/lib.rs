//! Configuration files of EtherCAT networks: input is text, output the engine's configuration. No bus access, no files,
//! no clock.
//!
//! [`eni`] reads an ENI (EtherCAT Network Information, ETG.2100; protocol 8) into a typed model that keeps the content
//! of the file; [`follow`] converts it into a [`Configuration`], [`export()`] writes one as an ENI. The network
//! configuration in the file takes precedence over the SII. Notices list the settings that are not followed. `esi`
//! reads descriptions of devices; with the feature `network`, `network` reads and writes network files of RingCAT.
#![forbid(unsafe_code)]

mod compare;
mod configuration;
mod declared_twice;
pub mod eni;
pub mod esi;
mod export;
mod follow;
mod ip;
#[cfg(feature = "network")]
pub mod network;
mod object_names;
mod pdo_list;
mod xml;

pub use compare::{Difference, DifferenceKind, FoundNetwork, StatedProperties, StatedSyncManager};
pub use configuration::{
    Configuration, DeclaredRings, ImageArea, ImageCopy, Notice, ProcessImage, SubDeviceFacts, Variable,
};
pub use export::{Export, ExportDetails, ExportError, ExportOptions, LeftOut, LrwUse, SubDeviceDetails, export};
pub use follow::follow;
pub use object_names::ObjectNames;
