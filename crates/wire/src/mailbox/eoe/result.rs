//! Results of EoE requests (protocol 6.5).

use core::fmt;

/// Result of a request. Unknown codes are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EoeResult(pub u16);

impl EoeResult {
    /// Success.
    pub const OK: EoeResult = EoeResult(0x0000);
    /// Unspecified error.
    pub const UNSPECIFIED: EoeResult = EoeResult(0x0001);
    /// The frame type is not supported.
    pub const UNSUPPORTED_FRAME_TYPE: EoeResult = EoeResult(0x0002);
    /// The SubDevice has no IP stack.
    pub const NO_IP_SUPPORT: EoeResult = EoeResult(0x0201);
    /// The SubDevice has no DHCP.
    pub const NO_DHCP_SUPPORT: EoeResult = EoeResult(0x0202);
    /// The SubDevice has no address filter.
    pub const NO_FILTER_SUPPORT: EoeResult = EoeResult(0x0401);

    /// The meaning of the code; `None` for a code that is not in the table.
    pub const fn name(self) -> Option<&'static str> {
        Some(match self {
            EoeResult::OK => "No error",
            EoeResult::UNSPECIFIED => "Unspecified error",
            EoeResult::UNSUPPORTED_FRAME_TYPE => "Unsupported frame type",
            EoeResult::NO_IP_SUPPORT => "No IP support",
            EoeResult::NO_DHCP_SUPPORT => "No DHCP support",
            EoeResult::NO_FILTER_SUPPORT => "No filter support",
            EoeResult(_) => return None,
        })
    }
}

impl fmt::Display for EoeResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} {}", self.0, self.name().unwrap_or("unknown EoE result"))
    }
}
