//! Reports of single datagrams with wrong working counters.

use crate::main_device::MainDevice;
use crate::procedures::command_watch::watch_commands;

impl MainDevice {
    /// Begins or ends reports of single datagrams, cyclic and acyclic, whose working counters differ from the expected
    /// ones: [`Event::CyclicCommand`](crate::event::Event) and `AcyclicCommand`, at most one a second per command and
    /// address. They are off at first, and stay over activations and stops. The cyclic half counts in incomplete cycles
    /// only, whether they are on or off.
    pub fn set_command_reports(&mut self, is_on: bool) {
        if is_on != self.supervisor.bus().are_commands_reported() {
            self.supervisor.set_command_reports(is_on);
            self.begin_command_reports();
        }
    }

    /// Starts the procedure, if it is wanted.
    pub(in crate::main_device) fn begin_command_reports(&mut self) {
        let bus = self.supervisor.bus();
        if bus.are_commands_reported() {
            self.supervisor.spawn(watch_commands(bus, self.segment.clone()));
        }
    }
}
