//! The domains of a declaration, and the places of their process data.

use alloc::rc::Rc;
use alloc::vec::Vec;

use super::activate_error::ActivateError;
use super::lrw::{self, check_lrw};
use super::prepare::{domain_specs, witnesses};
use crate::info::SubDeviceInfo;
#[cfg(feature = "standby")]
use crate::layout::LrwPolicy;
use crate::layout::{DomainSpec, Layout, Rules};
use crate::main_device::declaration::Declaration;
use crate::main_device::declaration::areas::Areas;

/// The domains of a declaration on a segment.
pub(in crate::main_device) struct LaidOut {
    /// Where LRW is used.
    #[cfg(feature = "standby")]
    pub lrw: LrwPolicy,
    pub specs: Vec<DomainSpec>,
    pub layout: Layout,
}

/// The domains, and the places of their process data. The declaration replaces the policy of LRW and the witnesses in
/// `rules`.
pub(in crate::main_device) fn lay_out(
    declaration: &Declaration,
    plans: &[Areas],
    found: &[Option<Rc<SubDeviceInfo>>],
    rules: Rules<'_>,
) -> Result<LaidOut, ActivateError> {
    let lrw = lrw::policy(declaration.lrw, &declaration.explicit_lrw, rules.links)?;
    let specs = domain_specs(declaration, plans, lrw, rules.links)?;
    check_lrw(lrw, &specs, rules.links)?;
    let witnesses = witnesses(plans, found, &specs);
    let rules = Rules { lrw, witnesses: &witnesses, ..rules };
    let mut layout = Layout::with(&specs, rules).map_err(ActivateError::Layout)?;
    if declaration.clocks.is_some() {
        layout.add_clocks().map_err(ActivateError::Layout)?;
    }
    Ok(LaidOut {
        #[cfg(feature = "standby")]
        lrw,
        specs,
        layout,
    })
}
