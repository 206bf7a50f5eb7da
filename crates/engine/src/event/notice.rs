//! Notices: the only events that procedures report themselves. They have the progress of one procedure, or what it was
//! asked, and nothing of the model follows from them. All other events are effects of observations (`segment`).

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, Position, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;

use crate::declared::{Address, SubDeviceId};
use crate::domain::DomainId;
use crate::event::{Event, StartupSource};
use crate::link::Link;

/// An event that a procedure reports itself; the reason why it is no fact of the model.
#[derive(Clone, Debug)]
pub(crate) enum Notice {
    /// A scan has counted: nothing is known until it ends.
    Counted {
        /// SubDevices on MAIN.
        main: u16,
        /// SubDevices on REDUNDANT.
        redundant: u16,
    },
    /// Progress of a scan.
    ScanProgress {
        /// SubDevices read.
        done: usize,
        /// SubDevices found.
        total: usize,
    },
    /// What was read of an SII or a dictionary was odd: its reader has worked around it.
    SiiWarning {
        /// Position.
        position: Position,
        /// The fault.
        what: String,
    },
    /// The process goes on with the knowledge of another one: said once.
    Resumed {
        /// SubDevices now.
        subdevices: usize,
        /// SubDevices that go on as they are.
        in_state: usize,
        /// The segment was not as known.
        differs: bool,
    },
    /// The hand-over has cut a conversation of the former owner: said once.
    ConversationCut {
        /// Position.
        position: Position,
        /// Its protocol.
        protocol: Protocol,
    },
    /// The link layer has refused an order.
    CannotDisconnect {
        /// The link.
        link: Link,
    },
    /// A start-up command has read a value for the application.
    StartupRead {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Number of the command.
        number: usize,
        /// What was read.
        source: StartupSource,
        /// Purpose of the command.
        comment: Option<String>,
        /// The value.
        data: Vec<u8>,
    },
    /// A mail of a SubDevice to the application.
    Emergency {
        /// The SubDevice.
        subdevice: Address,
        /// Its content.
        emergency: Emergency,
    },
    /// Counts of the exchange, passed on while they are wanted.
    CyclicCommand {
        /// Number of the domain.
        domain: DomainId,
        /// The command.
        command: Command,
        /// Its logical address.
        logical: LogicalAddress,
        /// Bytes of its data.
        length: u16,
        /// Expected in the last such cycle.
        expected: Wkc,
        /// Received then.
        got: Wkc,
        /// Cycles since the last report.
        cycles: u32,
        /// SubDevices that did not process it as expected.
        subdevices: Vec<SubDeviceId>,
    },
}

impl From<Notice> for Event {
    fn from(notice: Notice) -> Event {
        match notice {
            Notice::Counted { main, redundant } => Event::Counted { main, redundant },
            Notice::ScanProgress { done, total } => Event::ScanProgress { done, total },
            Notice::SiiWarning { position, what } => Event::SiiWarning { position, what },
            Notice::Resumed { subdevices, in_state, differs } => Event::Resumed { subdevices, in_state, differs },
            Notice::ConversationCut { position, protocol } => Event::ConversationCut { position, protocol },
            Notice::CannotDisconnect { link } => Event::CannotDisconnect { link },
            Notice::StartupRead { subdevice, number, source, comment, data } => {
                Event::StartupRead { subdevice, number, source, comment, data }
            }
            Notice::Emergency { subdevice, emergency } => Event::Emergency { subdevice, emergency },
            Notice::CyclicCommand { domain, command, logical, length, expected, got, cycles, subdevices } => {
                Event::CyclicCommand { domain, command, logical, length, expected, got, cycles, subdevices }
            }
        }
    }
}
