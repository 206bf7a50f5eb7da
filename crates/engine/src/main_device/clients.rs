//! Clients of events, each with a queue of its own.

use super::MainDevice;
use crate::event::{ClientEvents, ClientId, Subjects};

impl MainDevice {
    /// Registers a client of events with a queue of `size` events, at most 4,096, and with the subjects that it
    /// requests. It stays registered over activations and stops. `None` if there are 64 clients.
    ///
    /// Its queue is separate from the events of the application: if one of the two does not fetch its events, the other
    /// loses none.
    pub fn register_client(&mut self, subjects: Subjects, size: usize) -> Option<ClientId> {
        self.supervisor.with_events(|events| events.add_client(subjects, size))
    }

    /// Sets the subjects of a client's further events; false if there is no such client.
    pub fn set_client_subjects(&mut self, client: ClientId, subjects: Subjects) -> bool {
        self.supervisor.with_events(|events| events.set_client_subjects(client, subjects))
    }

    /// The events of a client since it fetched last, and how many it has missed; `None` if there is no such client.
    pub fn take_client_events(&mut self, client: ClientId) -> Option<ClientEvents> {
        self.number_cyclic_events(self.supervisor.bus().now());
        self.supervisor.with_events(|events| events.take_of_client(client))
    }

    /// Removes a client with its queue; false if there is no such client.
    pub fn unregister_client(&mut self, client: ClientId) -> bool {
        self.supervisor.with_events(|events| events.remove_client(client))
    }
}
