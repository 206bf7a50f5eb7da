//! Which datagrams of distributed clocks take effect in a cycle: all of them in each, or those that the application
//! called for since the last one.

/// When the datagrams of distributed clocks take effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClockDatagrams {
    /// In each cycle: time is distributed, the reference follows the host where that is declared, differences are read.
    #[default]
    Automatic,
    /// Only what the application called for since the last [`send`](crate::exchange::Exchange::send), as with IgH's
    /// interface: [`sync_clocks`](crate::exchange::Exchange::sync_clocks),
    /// [`sync_reference`](crate::exchange::Exchange::sync_reference),
    /// [`sync_reference_to`](crate::exchange::Exchange::sync_reference_to),
    /// [`monitor_clocks`](crate::exchange::Exchange::monitor_clocks).
    Called,
}

/// Calls since the last cycle.
#[derive(Debug, Default)]
pub(super) struct Calls {
    pub policy: ClockDatagrams,
    pub distribute: bool,
    pub monitor: bool,
}

impl Calls {
    pub fn is_automatic(&self) -> bool {
        self.policy == ClockDatagrams::Automatic
    }

    /// Whether this cycle distributes time, and whether it reads the differences. The calls are used up.
    pub fn take(&mut self) -> (bool, bool) {
        let called = (core::mem::take(&mut self.distribute), core::mem::take(&mut self.monitor));
        if self.is_automatic() { (true, true) } else { called }
    }
}
