//! SII images (EEPROM content) from device descriptions, comparison of images, and descriptions from images (protocol
//! ES-78 to ES-105).

mod build;
mod categories;
mod compare;
mod data_type;
mod fields;
mod profile;
mod skeleton;
mod strings;

pub use build::{SiiImage, build};
pub use compare::{Comparison, FieldDifference, Likeness, compare, most_alike};
pub use data_type::{code_of, name_of};
pub use profile::{SiiOptions, SiiProfile};
pub use skeleton::{Skeleton, skeleton};
