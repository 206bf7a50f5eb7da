//! Configuration files of EtherCAT networks: text goes in, what the engine needs comes out. No bus, no files, no clock.
//!
//! [`eni`] reads an ENI (EtherCAT Network Information, ETG.2100; protocol 8) into a typed model that keeps what the
//! file says; [`follow`] makes a [`Configuration`] of it. In such a file the network is configured already: it counts
//! before the SII, and what of it is not followed is said.
#![forbid(unsafe_code)]

mod configuration;
pub mod eni;
mod follow;

pub use configuration::{Configuration, ImageArea, ImageCopy, Notice, ProcessImage, SubDeviceFacts, Variable};
pub use follow::follow;
