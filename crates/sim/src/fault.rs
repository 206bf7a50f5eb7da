//! Faults that a test or a demonstration can bring about, at once or at a time (issue 2, part 3).
//!
//! Faults on a cable concern the frames that reach its far end from then on, faults on a device its power, its
//! application, its EEPROM and its state machine.

use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatusCode};

use crate::application::mailbox::faults::MailFault;
pub use crate::controller::SpoiltWrite;

use crate::cable::{CableId, DeviceIndex, Direction};

/// Something that goes wrong, or is put right again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The cable carries nothing any more; both ends notice after their detection delay.
    Cut(CableId),
    /// The cable is whole again; both ends notice after their detection delay.
    Heal(CableId),
    /// The cable is whole again; the end that receives in one direction notices later than the other by so much.
    HealUnevenly {
        /// Which cable.
        cable: CableId,
        /// Towards the end that is later.
        direction: Direction,
        /// How much later.
        by: Duration,
    },
    /// The next frames on the cable disappear.
    Drop {
        /// Which cable.
        cable: CableId,
        /// Which direction; `None`: both, counted apart.
        direction: Option<Direction>,
        /// How many frames.
        count: u32,
    },
    /// The next frames on the cable arrive twice, the second right behind the first.
    Duplicate {
        /// Which cable.
        cable: CableId,
        /// Which direction; `None`: both, counted apart.
        direction: Option<Direction>,
        /// How many frames.
        count: u32,
    },
    /// One bit of the next frames on the cable is turned over, so that their check sequence is wrong.
    Corrupt {
        /// Which cable.
        cable: CableId,
        /// Which direction; `None`: both, counted apart.
        direction: Option<Direction>,
        /// How many frames.
        count: u32,
    },
    /// The next frames on the cable have something within them that is no symbol (RX_ER): they are damaged, and the
    /// port that receives them counts that, too.
    SymbolErrors {
        /// Which cable.
        cable: CableId,
        /// Which direction; `None`: both, counted apart.
        direction: Option<Direction>,
        /// How many frames.
        count: u32,
    },
    /// Between frames comes what is no symbol: ports that have link count it, and no frame is hurt.
    IdleSymbolErrors {
        /// Which cable.
        cable: CableId,
        /// Towards which end; `None`: both.
        direction: Option<Direction>,
        /// How many symbols.
        count: u32,
    },
    /// The next frames on the cable arrive later than they should; frames behind them may overtake them.
    Delay {
        /// Which cable.
        cable: CableId,
        /// Which direction; `None`: both, counted apart.
        direction: Option<Direction>,
        /// How many frames.
        count: u32,
        /// How much later.
        by: Duration,
    },
    /// One direction of the cable is dead while both ends still see link (as behind a media converter), or alive again.
    OneWay {
        /// Which cable.
        cable: CableId,
        /// Which direction.
        direction: Direction,
        /// Dead or alive.
        blocked: bool,
    },
    /// The device loses its power; its neighbours notice the lost link after their detection delay.
    PowerOff(DeviceIndex),
    /// The device gets power: it loads its EEPROM, starts in INIT, and its links come up after their detection delay.
    PowerOn(DeviceIndex),
    /// The application behind the controller hangs, or goes on; the controller itself works.
    Hang(DeviceIndex, bool),
    /// Bits of the EEPROM turn over.
    CorruptSii {
        /// Which device.
        device: DeviceIndex,
        /// Byte in the EEPROM.
        offset: usize,
        /// Bits to turn over.
        mask: u8,
    },
    /// The next commands to the EEPROM take another time than usual.
    SlowSii {
        /// Which device.
        device: DeviceIndex,
        /// How long each of them takes.
        busy: Duration,
        /// How many commands.
        times: u32,
    },
    /// The next writes of a word to the EEPROM go wrong.
    SpoilSiiWrites {
        /// Which device.
        device: DeviceIndex,
        /// How.
        how: SpoiltWrite,
        /// How many.
        times: u32,
    },
    /// The device refuses to go to a state.
    RefuseTransition {
        /// Which device.
        device: DeviceIndex,
        /// The state it refuses.
        to: AlState,
        /// The AL status code it refuses it with.
        code: AlStatusCode,
        /// How often it refuses.
        times: u32,
    },
    /// Accesses of the application to its controller go wrong, as on a disturbed bus between both: they are counted,
    /// and done all the same.
    PdiErrors {
        /// Which device.
        device: DeviceIndex,
        /// What PDI_ERROR_CODE shows of the last one.
        code: u8,
        /// How many.
        count: u32,
    },
    /// Something goes wrong with the mail of a device.
    Mail(DeviceIndex, MailFault),
}
