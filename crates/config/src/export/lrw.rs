//! The SubDevices whose process data is in LRW commands.

use std::collections::BTreeSet;

use ringcat_engine::layout::LrwPolicy;
use ringcat_engine::main_device::Declaration;

use super::options::LrwUse;

/// Indices of SubDevices.
pub(super) type Lrw = BTreeSet<usize>;

pub(super) fn subdevices(declaration: &Declaration, lrw: LrwUse) -> Lrw {
    let all = || (0..declaration.subdevices.len()).collect();
    match lrw {
        LrwUse::Never => Lrw::new(),
        LrwUse::Always => all(),
        LrwUse::AsDeclared if declaration.lrw == LrwPolicy::Explicit => all(),
        LrwUse::AsDeclared => {
            declaration.explicit_lrw.iter().flat_map(|it| &it.subdevices).map(|subdevice| subdevice.0).collect()
        }
    }
}
