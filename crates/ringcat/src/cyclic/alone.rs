//! Cycles of a MainDevice without another one in its ring.

use ringcat_engine::time::Instant;

use super::Cyclic;
use crate::acyclic::AcyclicHalf;
use crate::links::Links;

impl Cyclic {
    pub const fn set_up_of_two(&mut self, _links: &impl Links) {}

    /// Begins the cycle as one of two MainDevices; false if there is no other one.
    #[inline(always)]
    pub const fn begin_of_two(&mut self, _now: Instant) -> bool {
        false
    }

    pub fn pass_on(&mut self, _links: &mut impl Links, _acyclic: &mut impl AcyclicHalf) {}
}
