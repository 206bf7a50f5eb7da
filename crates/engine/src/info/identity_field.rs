//! The fields of a SubDevice's identity that are compared with a declaration.

use core::fmt;

/// A field of a SubDevice's identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum IdentityField {
    /// Vendor id.
    VendorId,
    /// Product code.
    ProductCode,
    /// Revision.
    Revision,
    /// Lowest revision.
    MinimumRevision,
    /// The compared bits of the revision.
    RevisionBits,
    /// Serial number.
    Serial,
    /// Explicit device identification (protocol 5.3); 0 for a SubDevice without one.
    Identification,
}

impl fmt::Display for IdentityField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            IdentityField::VendorId => "vendor id",
            IdentityField::ProductCode => "product code",
            IdentityField::Revision => "revision",
            IdentityField::MinimumRevision => "a revision not below",
            IdentityField::RevisionBits => "compared bits of the revision",
            IdentityField::Serial => "serial number",
            IdentityField::Identification => "identification",
        })
    }
}
