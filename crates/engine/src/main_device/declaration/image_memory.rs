//! Memory of the application for the image of a domain, or for process data of the other MainDevice.

use alloc::sync::Arc;
use core::fmt;

/// Memory of the application. Copies of a declaration share it; one of them can be activated, after the others
/// are dropped.
#[derive(Clone)]
pub struct ImageMemory(Arc<Memory>);

/// The application's memory.
struct Memory(&'static mut [u8]);

impl fmt::Debug for ImageMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ImageMemory({} bytes)", self.0.0.len())
    }
}

impl ImageMemory {
    /// Memory that is at least as long as what it is for.
    pub fn new(memory: &'static mut [u8]) -> ImageMemory {
        ImageMemory(Arc::new(Memory(memory)))
    }

    /// Whether no copy of the declaration has the memory, too.
    pub(in crate::main_device) fn is_only(&mut self) -> bool {
        Arc::get_mut(&mut self.0).is_some()
    }

    /// The memory; `None` if a copy of the declaration has it.
    pub(in crate::main_device) fn into_inner(self) -> Option<&'static mut [u8]> {
        Arc::into_inner(self.0).map(|given| given.0)
    }
}
