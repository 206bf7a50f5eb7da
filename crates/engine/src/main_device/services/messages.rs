//! Messages of the acyclic half: which are reported, and the last ones.

use crate::event::{LogFilter, Message, MessagesSince};
use crate::main_device::MainDevice;

impl MainDevice {
    /// Sets which messages are reported from now on. It stays over activations and stops.
    pub fn set_log_filter(&mut self, filter: LogFilter) {
        self.supervisor.with_events(|events| events.messages().set_filter(filter));
    }

    /// Which messages are reported.
    pub fn log_filter(&self) -> LogFilter {
        self.supervisor.with_events(|events| events.messages().filter())
    }

    /// The messages from a number on, as far as they are kept: the last 4,096, up to 1 MiB.
    pub fn messages_since(&self, number: u64) -> MessagesSince {
        self.supervisor.with_events(|events| events.messages().since(number))
    }

    /// The oldest message that this method has not returned. [`MainDevice::messages_since`] still returns it.
    pub fn pop_message(&mut self) -> Option<Message> {
        self.supervisor.with_events(|events| events.messages().pop())
    }
}
