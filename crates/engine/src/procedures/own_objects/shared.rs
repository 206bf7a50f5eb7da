//! Data kept between requests.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

use super::detection::Detection;
use super::rates::Rates;
use super::upload::Upload;

/// Data shared by all clients, and their uploads.
#[derive(Debug, Default)]
pub(super) struct Shared {
    /// Uploads by client.
    pub uploads: RefCell<BTreeMap<u64, Upload>>,
    pub detection: Rc<Detection>,
    pub rates: RefCell<Rates>,
    /// Lost frames at the time of the last reset of the diagnosis, cyclic and acyclic.
    pub forgotten: Cell<[u64; 2]>,
    /// Wrong working counters at that time, by SubDevice.
    pub forgotten_wkc: RefCell<Vec<u32>>,
}
