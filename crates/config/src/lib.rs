//! Configuration files of EtherCAT networks: input is text, output the engine's configuration. No bus access, no files,
//! no clock.
//!
//! [`eni`] reads an ENI (EtherCAT Network Information, ETG.2100; protocol 8) into a typed model that keeps the content
//! of the file; [`follow`] converts it into a [`Configuration`]. The network configuration in the file takes precedence
//! over the SII. Notices list the settings that are not followed.
#![forbid(unsafe_code)]

mod configuration;
pub mod eni;
pub mod esi;
mod follow;
mod xml;

pub use configuration::{Configuration, ImageArea, ImageCopy, Notice, ProcessImage, SubDeviceFacts, Variable};
pub use follow::follow;
