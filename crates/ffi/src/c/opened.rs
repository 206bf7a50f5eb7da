//! Masters that are open in this process: what is released at its end, and what a panic makes unusable.

use std::sync::Mutex;

use crate::locks::OfProcess;

/// A master that is open.
pub trait Opened: Send {
    /// Its handle.
    fn address(&self) -> usize;
    /// Whether this handle is its own, or came from it.
    fn has(&self, address: usize) -> bool;
    /// From now on all these handles are refused.
    fn fail(&self);
}

static OPENED: OfProcess<Mutex<Vec<Box<dyn Opened>>>> = OfProcess::new();

/// A master was opened.
pub fn add(opened: impl Opened + 'static) {
    OPENED.lock().push(Box::new(opened));
}

/// A master is released.
pub fn remove(address: usize) {
    OPENED.lock().retain(|opened| opened.address() != address);
}

/// The handles of all masters that are open. None while another thread opens or releases one: the end of a process
/// does not wait.
pub fn addresses() -> Vec<usize> {
    let opened = OPENED.of(Mutex::default).try_lock();
    opened.map(|opened| opened.iter().map(|opened| opened.address()).collect()).unwrap_or_default()
}

/// The master that this handle belongs to has failed; `false` if there is none.
pub fn fail(address: usize) -> bool {
    let opened = OPENED.lock();
    let master = opened.iter().find(|opened| opened.has(address));
    master.iter().for_each(|master| master.fail());
    master.is_some()
}
