//! Options of MainDevice redundancy.

use crate::layout::MasterSizes;

/// Options of MainDevice redundancy. Both MainDevices of a ring have the same (protocol REQ010).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct StandbyOptions {
    /// Sizes of the areas in master frames.
    pub sizes: MasterSizes,
    /// Whether the ACTIVE becomes INACTIVE when both links have lost their carriers (protocol MR-25). On by default:
    /// the other MainDevice has taken over when the links are back.
    pub yields_without_links: bool,
    /// Whether all SubDevices are configured again from INIT on after a takeover (warm standby, protocol MR-18). Off by
    /// default: they go on as they are.
    pub goes_through_init: bool,
    /// Most acyclic master frames per cycle, with Ethernet frames between both MainDevices
    /// ([`partner_endpoint`](super::super::MainDevice::partner_endpoint)); at most 16 (protocol AC-03). 0 by default:
    /// no Ethernet. The ACTIVE sends as many as its own options allow; the INACTIVE answers only if its own value is
    /// not 0.
    pub max_acyclic: u8,
    /// Whether a guard is needed that switches the interfaces off when this program fails (protocol MR-21). On by
    /// default: `NotReady::GUARD` is a reason against readiness until a guard protects this MainDevice. Off for links
    /// that go down with the program, such as simulated ones.
    pub needs_guard: bool,
}

impl Default for StandbyOptions {
    fn default() -> StandbyOptions {
        StandbyOptions {
            sizes: MasterSizes::default(),
            yields_without_links: true,
            goes_through_init: false,
            max_acyclic: 0,
            needs_guard: true,
        }
    }
}

impl StandbyOptions {
    /// Sets [`StandbyOptions::sizes`].
    #[must_use]
    pub const fn with_sizes(mut self, sizes: MasterSizes) -> StandbyOptions {
        self.sizes = sizes;
        self
    }

    /// Sets [`StandbyOptions::goes_through_init`].
    #[must_use]
    pub const fn with_goes_through_init(mut self, goes: bool) -> StandbyOptions {
        self.goes_through_init = goes;
        self
    }

    /// Sets [`StandbyOptions::max_acyclic`].
    #[must_use]
    pub const fn with_max_acyclic(mut self, frames: u8) -> StandbyOptions {
        self.max_acyclic = frames;
        self
    }

    /// Sets [`StandbyOptions::needs_guard`].
    #[must_use]
    pub const fn with_needs_guard(mut self, needs: bool) -> StandbyOptions {
        self.needs_guard = needs;
        self
    }

    /// Sets [`StandbyOptions::yields_without_links`].
    #[must_use]
    pub const fn with_yields_without_links(mut self, yields: bool) -> StandbyOptions {
        self.yields_without_links = yields;
        self
    }
}
