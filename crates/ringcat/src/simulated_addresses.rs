//! Addresses of the host's interfaces in front of a simulated segment.

use ringcat_wire::frame::MacAddress;

/// Address of the main interface: not locally administered, because controllers set that bit.
pub(crate) const MAIN: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x01]);
/// Address of the redundant interface.
pub(crate) const REDUNDANT: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x02]);
/// Address of the main interface of a second MainDevice.
#[cfg(feature = "sim")]
pub(crate) const SECOND_MAIN: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x11]);
/// Address of the redundant interface of a second MainDevice.
#[cfg(feature = "sim")]
pub(crate) const SECOND_REDUNDANT: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x12]);
