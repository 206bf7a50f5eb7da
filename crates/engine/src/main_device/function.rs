//! The one point at which functions are checked where they start ([`crate::role`]).

use super::MainDevice;
use crate::role::{Function, NotPermitted, Permission};

impl MainDevice {
    /// Whether a function can be called now.
    pub fn permission(&self, function: Function) -> Permission {
        function.permission(self.role(), self.phase())
    }

    /// Checks a function that begins.
    pub(super) fn permit(&self, function: Function) -> Result<(), NotPermitted> {
        function.check(self.role(), self.phase())
    }
}
