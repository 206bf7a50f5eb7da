//! The power state machine of CiA 402: converts the controlword into a state and its bits of the statusword.
//!
//! [`next`] contains the numbered transitions of the standard. The [`Servo`](super::Servo) makes the transitions that
//! wait for standstill (out of quick stop, fault reaction, and out of operation with a ramp).

/// State of the power state machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// The drive runs its self-test after power-on.
    #[default]
    NotReadyToSwitchOn,
    /// Power cannot be switched on yet.
    SwitchOnDisabled,
    /// Waits for switch on.
    ReadyToSwitchOn,
    /// Power is on, no torque, brake closed.
    SwitchedOn,
    /// The drive follows its targets.
    OperationEnabled,
    /// Stopping or at standstill after a quick stop.
    QuickStopActive,
    /// Stopping because of a fault.
    FaultReactionActive,
    /// Waits for a fault reset.
    Fault,
}

impl DriveState {
    /// The state bits of the statusword, mask 0x006F.
    pub const fn status_bits(self) -> u16 {
        match self {
            DriveState::NotReadyToSwitchOn => 0x0000,
            DriveState::SwitchOnDisabled => 0x0040,
            DriveState::ReadyToSwitchOn => 0x0021,
            DriveState::SwitchedOn => 0x0023,
            DriveState::OperationEnabled => 0x0027,
            DriveState::QuickStopActive => 0x0007,
            DriveState::FaultReactionActive => 0x000F,
            DriveState::Fault => 0x0008,
        }
    }

    /// Whether the power stage produces torque and the brake is open.
    pub const fn has_torque(self) -> bool {
        matches!(self, DriveState::OperationEnabled | DriveState::QuickStopActive | DriveState::FaultReactionActive)
    }
}

/// Command in a controlword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveCommand {
    /// Power off at once.
    #[default]
    DisableVoltage,
    /// Stop, then off.
    QuickStop,
    /// Ready to switch on.
    Shutdown,
    /// Switched on; from operation: disable operation.
    SwitchOn,
    /// Follow the targets.
    EnableOperation,
}

impl DriveCommand {
    /// The command in bits 0 to 3 of a controlword.
    pub const fn from_controlword(word: u16) -> DriveCommand {
        match word & 0x0F {
            bits if bits & 0x02 == 0 => DriveCommand::DisableVoltage,
            bits if bits & 0x04 == 0 => DriveCommand::QuickStop,
            bits if bits & 0x01 == 0 => DriveCommand::Shutdown,
            bits if bits & 0x08 == 0 => DriveCommand::SwitchOn,
            _ => DriveCommand::EnableOperation,
        }
    }
}

/// The state after a command. One controlword causes one transition: enable operation changes from ready to switch on
/// to switched on, and the next controlword to operation.
pub const fn next(state: DriveState, command: DriveCommand) -> DriveState {
    use DriveCommand as C;
    use DriveState as S;
    match (state, command) {
        // Transitions 0, 1, 13, 14 are internal, 15 is the fault reset.
        (S::NotReadyToSwitchOn | S::FaultReactionActive | S::Fault, _) => state,
        (S::SwitchOnDisabled, C::Shutdown) => S::ReadyToSwitchOn, // 2
        (S::SwitchOnDisabled, _) => S::SwitchOnDisabled,
        (S::ReadyToSwitchOn, C::SwitchOn | C::EnableOperation) => S::SwitchedOn, // 3
        (S::ReadyToSwitchOn, C::Shutdown) => S::ReadyToSwitchOn,
        (S::SwitchedOn, C::EnableOperation) => S::OperationEnabled, // 4
        (S::SwitchedOn, C::SwitchOn) => S::SwitchedOn,
        (S::SwitchedOn, C::Shutdown) => S::ReadyToSwitchOn, // 6
        (S::ReadyToSwitchOn | S::SwitchedOn, C::QuickStop | C::DisableVoltage) => S::SwitchOnDisabled, // 7, 10
        // 5 and 8 are due as soon as the motor has stopped according to option codes 0x605C and 0x605B.
        (S::OperationEnabled, C::EnableOperation | C::SwitchOn | C::Shutdown) => S::OperationEnabled,
        (S::OperationEnabled | S::QuickStopActive, C::DisableVoltage) => S::SwitchOnDisabled, // 9, 12
        (S::OperationEnabled, C::QuickStop) => S::QuickStopActive,                            // 11
        (S::QuickStopActive, C::EnableOperation) => S::OperationEnabled,                      // 16
        (S::QuickStopActive, C::QuickStop | C::Shutdown | C::SwitchOn) => S::QuickStopActive,
    }
}
