//! What `ringcat sii --json` prints.

use serde::Serialize;

/// An image from a device description.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiiBuilt {
    /// File of the description
    pub esi: String,
    /// Type of the device
    pub device: String,
    /// Revision of the description
    pub revision: u32,
    /// Habits of a tool: twincat, siitool, rtlabs or plain
    pub profile: String,
    /// Bytes of the image
    pub bytes: usize,
    /// Bytes up to the end marker
    pub used_bytes: usize,
    /// Parts of the description that the image does not have
    pub notices: Vec<String>,
}

/// Images compared with device descriptions.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiiCompared {
    /// The images, in the order of the command line
    pub images: Vec<ComparedImage>,
}

/// An image, and what a description gives.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ComparedImage {
    /// File of the image
    pub file: String,
    /// identical, individual, different, without-description or invalid
    pub outcome: String,
    /// File of the description; null without one
    pub esi: Option<String>,
    /// Type of the device; null without a description
    pub device: Option<String>,
    /// Revision of the description; null without one
    pub revision: Option<u32>,
    /// Habits of the tool with the fewest differences; null without a description
    pub profile: Option<String>,
    /// Language of the strings as LcId; null without a description
    pub language: Option<u32>,
    /// Fields that differ
    pub differences: Vec<Difference>,
    /// Why it is not compared; null where it is
    pub reason: Option<String>,
}

/// A field that differs.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Difference {
    /// The field
    pub field: String,
    /// Its value in the image
    pub image: String,
    /// Its value in what the description gives
    pub built: String,
    /// Whether it is written in production or at commissioning, such as alias and serial number
    pub is_individual: bool,
}

/// A description from an image.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SiiSkeleton {
    /// Bytes of the description
    pub bytes: usize,
    /// What a description cannot express about the mailboxes of the image
    pub notices: Vec<String>,
}
