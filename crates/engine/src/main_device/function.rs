//! The role of the MainDevice, and the one point at which functions are checked where they start
//! ([`crate::role`]).

use super::MainDevice;
use crate::role::{Function, NotPermitted, Permission, Role};

impl MainDevice {
    /// Its role on the segment: [`Role::Active`] unless it was set.
    pub fn role(&self) -> Role {
        self.supervisor.role()
    }

    /// Sets the role. It decides which functions are refused from now on; procedures that run go on. A MainDevice with
    /// a standby partner sets it at a takeover; alone on a segment it stays [`Role::Active`].
    pub fn set_role(&mut self, role: Role) {
        self.supervisor.set_role(role);
    }

    /// Whether a function can be called now.
    pub fn permission(&self, function: Function) -> Permission {
        function.permission(self.role(), self.phase())
    }

    /// Checks a function that begins.
    pub(super) fn permit(&self, function: Function) -> Result<(), NotPermitted> {
        function.check(self.role(), self.phase())
    }
}
