//! Device descriptions (ESI, ETG.2000) from files: `ringcat-config` parses them, this module opens files and creates
//! simulated devices from them. See `docs/esi.md`.

#[cfg(feature = "sim")]
mod device;
mod file;
mod folder;
#[cfg(feature = "sim")]
mod objects;
#[cfg(feature = "sim")]
mod segment;
mod walk;

pub use file::{EsiFailure, load};
pub use folder::EsiFolder;
#[cfg(feature = "sim")]
pub use segment::{EsiDevices, load_segment};
pub use walk::MAX_FILES;
