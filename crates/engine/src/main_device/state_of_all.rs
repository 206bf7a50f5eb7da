//! A state for the whole MainDevice.

use core::time::Duration;

use ringcat_wire::al::AlState;

use super::MainDevice;
use super::pending::Pending;
use crate::procedures::request_states::{StateScope, StatesError, request_states};
use crate::role::Function;

impl MainDevice {
    /// Starts to bring all SubDevices to INIT, PREOP, SAFEOP or OP: while active the declared ones, each at most to its
    /// declared state; otherwise those of the scan, with the defaults of their SIIs. The state is kept, as one that was
    /// requested of a single SubDevice ([`MainDevice::start_state_request`]).
    ///
    /// The result is there when all that count by `scope` have followed or refused, at the latest at `limit`. Those
    /// that lose frames or power meanwhile have time until the limit. Requests that are late then continue.
    pub fn start_state_of_all(
        &mut self,
        state: AlState,
        scope: StateScope,
        limit: Duration,
    ) -> Pending<Result<(), StatesError>> {
        if let Err(denied) = self.permit(Function::StateOfAll) {
            return self.start(async move { Err(denied.into()) });
        }
        let work = request_states(&self.bus(), &self.segment, state, scope, limit);
        self.start(work)
    }
}
