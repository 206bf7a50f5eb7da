//! A MainDevice without another one in its ring: nothing is forwarded.

use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_engine::time::Instant;

use crate::links::Links;

/// Data of MainDevice redundancy: none without the feature `standby`.
#[derive(Debug, Default)]
pub(crate) struct OfTwo {}

impl OfTwo {
    /// Takes the frames that have arrived, for an acyclic half; true if there were any.
    pub fn take_in(&mut self, links: &mut impl Links, engine: &mut Engine, now: Instant) -> bool {
        let mut any = false;
        while links.receive(&mut |link, frame| {
            engine.receive(link, frame, now);
        }) {
            any = true;
        }
        any
    }
}
