//! What was configured since the reservation: SubDevices, domains, clocks.

use ringcat::{ClockConfig, Declaration, Required, SubDeviceConfig, SubDeviceId};

/// Address and identity of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Alias, 0 for a ring position.
    pub alias: u16,
    /// Position, or places behind the alias.
    pub position: u16,
    /// Vendor and product.
    pub identity: (u32, u32),
}

/// What is configured.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// The declaration so far.
    pub declaration: Declaration,
    /// Keys by configuration.
    pub keys: Vec<Key>,
    /// Clocks are set up.
    pub clocks: bool,
    /// The application's time and the host's, once given.
    pub application_time: Option<(u64, u64)>,
    /// The first time that is not 0.
    pub first_application_time: Option<(u64, u64)>,
    /// The selected reference clock.
    pub reference: Option<SubDeviceId>,
}

impl Plan {
    /// Changes a configuration.
    pub fn change(&mut self, config: SubDeviceId, change: impl FnOnce(SubDeviceConfig) -> SubDeviceConfig) {
        let place = &mut self.declaration.subdevices[config.0];
        *place = change(std::mem::take(place));
    }

    /// The declaration to activate: absent and wrong SubDevices are no error.
    pub fn complete(&self) -> Declaration {
        let declaration = self.declaration.clone().with_required(Required::Nothing);
        let reference = self.reference.map(ringcat::ReferenceClock::Declared).unwrap_or_default();
        let clocks = ClockConfig::default().as_igh().with_reference(reference);
        declaration.with_clocks(self.clocks.then_some(clocks))
    }
}
