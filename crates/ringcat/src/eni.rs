//! Networks from an ENI (EtherCAT Network Information, ETG.2100): the file gives the configuration, the engine carries
//! it out.
//!
//! `ringcat-config` reads the file; [`EniImage`] is its process image at run time; [`segment`] makes a simulated
//! segment of it, to test it without hardware. See `docs/eni.md`.

mod file;
mod image;
#[cfg(feature = "sim")]
mod segment;
mod value;

pub use file::{EniFile, LoadError, LoadFailure};
pub use image::{EniImage, EniVariable, ImageError};
pub use ringcat_config::{Difference, DifferenceKind};
#[cfg(feature = "sim")]
pub use segment::segment;
pub use value::{Value, VariableType};
