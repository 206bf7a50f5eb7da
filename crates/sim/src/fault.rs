//! Faults that a test or a demonstration can inject, at once or at a scheduled time.
//!
//! Faults on a cable affect the frames that reach its far end from then on, faults on a device its power, its
//! application, its EEPROM and its state machine.

use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatusCode};

use crate::application::mailbox::faults::MailFault;
pub use crate::controller::SpoiltWrite;

use crate::cable::{CableId, DeviceIndex, Direction, Host};

/// A fault, or its repair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The cable is cut; both ends detect it after their detection delay.
    Cut(CableId),
    /// The cable is repaired; both ends detect it after their detection delay.
    Heal(CableId),
    /// The cable is repaired; the receiving end of one direction detects it later than the other.
    HealUnevenly {
        /// The cable.
        cable: CableId,
        /// Direction towards the later end.
        direction: Direction,
        /// Additional delay.
        by: Duration,
    },
    /// The next frames on the cable are lost.
    Drop {
        /// The cable.
        cable: CableId,
        /// The direction; `None`: both, counted separately.
        direction: Option<Direction>,
        /// Number of frames.
        count: u32,
    },
    /// The next frames on the cable arrive twice, the second directly after the first.
    Duplicate {
        /// The cable.
        cable: CableId,
        /// The direction; `None`: both, counted separately.
        direction: Option<Direction>,
        /// Number of frames.
        count: u32,
    },
    /// One bit of the next frames on the cable is inverted, so that their FCS is wrong.
    Corrupt {
        /// The cable.
        cable: CableId,
        /// The direction; `None`: both, counted separately.
        direction: Option<Direction>,
        /// Number of frames.
        count: u32,
    },
    /// The next frames on the cable contain an invalid symbol (RX_ER): they are damaged, and the receiving port also
    /// counts the symbol.
    SymbolErrors {
        /// The cable.
        cable: CableId,
        /// The direction; `None`: both, counted separately.
        direction: Option<Direction>,
        /// Number of frames.
        count: u32,
    },
    /// Invalid symbols between frames: ports with a link count them, and no frame is damaged.
    IdleSymbolErrors {
        /// The cable.
        cable: CableId,
        /// Direction; `None`: both.
        direction: Option<Direction>,
        /// Number of symbols.
        count: u32,
    },
    /// The next frames on the cable are delayed; later frames may overtake them.
    Delay {
        /// The cable.
        cable: CableId,
        /// The direction; `None`: both, counted separately.
        direction: Option<Direction>,
        /// Number of frames.
        count: u32,
        /// Delay.
        by: Duration,
    },
    /// One direction of the cable is blocked while both ends still have a link (as with a media converter), or works
    /// again.
    OneWay {
        /// The cable.
        cable: CableId,
        /// The direction.
        direction: Direction,
        /// Whether it is blocked.
        blocked: bool,
    },
    /// The device loses its power; its neighbours detect the lost link after their detection delay.
    PowerOff(DeviceIndex),
    /// The device gets power: it loads its EEPROM, starts in INIT, and its links come up after their detection delay.
    PowerOn(DeviceIndex),
    /// The application behind the controller hangs, or continues; the controller itself works.
    Hang(DeviceIndex, bool),
    /// Bits of the EEPROM are inverted.
    CorruptSii {
        /// The device.
        device: DeviceIndex,
        /// Byte in the EEPROM.
        offset: usize,
        /// Mask of the bits to invert.
        mask: u8,
    },
    /// The next commands to the EEPROM have another duration.
    SlowSii {
        /// The device.
        device: DeviceIndex,
        /// Duration of each.
        busy: Duration,
        /// Number of commands.
        times: u32,
    },
    /// The next writes of a word to the EEPROM fail.
    SpoilSiiWrites {
        /// The device.
        device: DeviceIndex,
        /// How they fail.
        how: SpoiltWrite,
        /// Number of writes.
        times: u32,
    },
    /// The device refuses a state.
    RefuseTransition {
        /// The device.
        device: DeviceIndex,
        /// The refused state.
        to: AlState,
        /// The AL status code of the refusal.
        code: AlStatusCode,
        /// Number of refusals; 0 ends those that are left.
        times: u32,
    },
    /// Accesses of the application to its controller are disturbed, as on a faulty bus: they are counted, and succeed
    /// nevertheless.
    PdiErrors {
        /// The device.
        device: DeviceIndex,
        /// Content of PDI_ERROR_CODE for the last one.
        code: u8,
        /// Number of accesses.
        count: u32,
    },
    /// The program of a host hangs or is stopped, or goes on: the interfaces of the host stay up, and keep what they
    /// receive as far as their queues go.
    StopHost(Host, bool),
    /// A host loses its power: its interfaces have no signal.
    PowerHostOff(Host),
    /// A host gets power, and its program begins anew.
    PowerHostOn(Host),
    /// A fault of a device's mail.
    Mail(DeviceIndex, MailFault),
}
