//! Servo drives of the demonstrated segment: enabled as CiA 402 says, then moved back and forth.

use ringcat::{AcyclicHalf, Application, Entry, Links, ProcessData, SubDeviceId};

/// CONTROLWORD, STATUSWORD, MODES_OF_OPERATION, TARGET_POSITION, POSITION_ACTUAL_VALUE (CiA 402).
const CONTROLWORD: u16 = 0x6040;
const STATUSWORD: u16 = 0x6041;
const MODES_OF_OPERATION: u16 = 0x6060;
const TARGET_POSITION: u16 = 0x607A;
const POSITION_ACTUAL: u16 = 0x6064;
/// Cyclic synchronous position.
const CSP: u64 = 8;
/// Increments per cycle.
const STEP: i32 = 50;
/// Cycles until the drive turns round.
const TURN: i32 = 500;

/// State of a drive as its statusword codes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    NotReady,
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    Fault,
}

impl State {
    fn decode(statusword: u64) -> State {
        match (statusword & 0x4F, statusword & 0x6F) {
            (0x40, _) => State::SwitchOnDisabled,
            (0x08 | 0x0F, _) => State::Fault,
            (_, 0x21) => State::ReadyToSwitchOn,
            (_, 0x23) => State::SwitchedOn,
            (_, 0x27) => State::OperationEnabled,
            _ => State::NotReady,
        }
    }

    /// The controlword for the next step to operation enabled.
    fn controlword(self) -> u64 {
        match self {
            State::NotReady => 0x00,
            State::SwitchOnDisabled => 0x06,
            State::ReadyToSwitchOn => 0x07,
            State::SwitchedOn | State::OperationEnabled => 0x0F,
            State::Fault => 0x80,
        }
    }
}

/// A drive and where its process data lies.
#[derive(Debug)]
pub struct Drive {
    /// Index in the declaration.
    pub subdevice: usize,
    controlword: Entry,
    statusword: Entry,
    mode: Option<Entry>,
    target: Entry,
    actual: Entry,
    state: State,
    wanted: i32,
    moves: i32,
    /// The actual position, as last read.
    pub position: i32,
    /// Cycles in which it was enabled and moved.
    pub enabled_cycles: u64,
    /// The largest distance from its target while enabled.
    pub lag: i32,
}

impl Drive {
    /// The drive that a SubDevice is, if its process data has what a drive needs.
    pub fn find<L: Links, H: AcyclicHalf>(application: &Application<L, H>, subdevice: usize) -> Option<Drive> {
        let entry = |index| application.entry(SubDeviceId(subdevice), index, 0);
        Some(Drive {
            subdevice,
            controlword: entry(CONTROLWORD)?,
            statusword: entry(STATUSWORD)?,
            mode: entry(MODES_OF_OPERATION),
            target: entry(TARGET_POSITION)?,
            actual: entry(POSITION_ACTUAL)?,
            state: State::NotReady,
            wanted: 0,
            moves: 0,
            position: 0,
            enabled_cycles: 0,
            lag: 0,
        })
    }

    /// One cycle: reads the state, commands the next one, moves when enabled.
    pub fn cycle(&mut self, data: &mut ProcessData<'_>) {
        self.state = State::decode(data.read(&self.statusword));
        self.position = data.read_signed(&self.actual) as i32;
        if self.state == State::OperationEnabled {
            self.lag = self.lag.max((self.wanted - self.position).abs());
            self.enabled_cycles += 1;
            self.moves += 1;
            self.wanted += if (self.moves / TURN) % 2 == 0 { STEP } else { -STEP };
        } else {
            self.wanted = self.position;
        }
        self.command(data);
    }

    /// One cycle of one of two controllers. The target is the last target of the ACTIVE plus a step, so a takeover
    /// continues the movement.
    #[cfg(feature = "standby")]
    pub fn go_on(&mut self, data: &mut ProcessData<'_>) {
        self.state = State::decode(data.read(&self.statusword));
        self.position = data.read_signed(&self.actual) as i32;
        self.wanted = match self.state {
            State::OperationEnabled => (data.read_signed(&self.target) as i32).wrapping_add(STEP),
            _ => self.position,
        };
        self.command(data);
    }

    /// Bytes of the image in which the target position and the statusword begin.
    #[cfg(feature = "standby")]
    pub fn watched(&self) -> [usize; 2] {
        [self.target.byte_offset(), self.statusword.byte_offset()]
    }

    /// Whether a statusword says that a drive is enabled.
    #[cfg(feature = "standby")]
    pub fn is_enabled(statusword: u16) -> bool {
        State::decode(statusword.into()) == State::OperationEnabled
    }

    fn command(&self, data: &mut ProcessData<'_>) {
        // The entries are outputs of these widths: they were looked up as such.
        let _ = data.write(&self.controlword, self.state.controlword());
        let _ = data.write_signed(&self.target, self.wanted.into());
        if let Some(mode) = &self.mode {
            let _ = data.write(mode, CSP);
        }
    }

    /// Its inputs are old: the drive was absent, and its lag until now means nothing.
    pub fn note_absence(&mut self) {
        self.state = State::NotReady;
        self.lag = 0;
    }

    /// Enabled, and never farther behind its target than the cycles on the way allow.
    pub fn follows(&self) -> bool {
        // Target out, position latched one cycle later, read back another cycle later; a lost cycle adds one each.
        self.state == State::OperationEnabled && self.lag <= 8 * STEP
    }
}
