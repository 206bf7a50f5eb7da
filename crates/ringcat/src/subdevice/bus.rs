//! Services without a mailbox: states, registers, ports, the EEPROM, error counters.

use ringcat_engine::BlockedPort;
use ringcat_engine::SiiWritten;
use ringcat_engine::Statistics;
use ringcat_engine::Urgency;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::{Acknowledge, AlRegisters};
use ringcat_engine::{EepromAssignment, EepromOwnership};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::{LoopControl, map};

use super::{SubDevice, SubDeviceError, SubDeviceFailure};
use crate::services::Services;
use crate::value::{Number, ObjectValue};

/// Bytes from AL_STATUS to the end of AL_STATUS_CODE.
const STATUS_BYTES: usize = 6;

impl<S: Services> SubDevice<S> {
    /// Brings the SubDevice to a state while all others continue: INIT, PREOP, BOOT for new firmware, SAFEOP, OP. A
    /// declared SubDevice is configured again on the way up, and is brought back to the state after a loss of power. If
    /// it refuses the state, it goes back to the previous one.
    ///
    /// A SubDevice without a declaration goes to the state with the defaults of its SII, and exchanges no process data:
    /// its outputs are zero. With [`Options::idle_operation`](crate::Options) it is kept there.
    pub fn request_state(self, state: AlState) -> S::Outcome<(), SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_state_request(subdevice, state).ended())
    }

    /// Reads its AL status and AL status code (registers 0x0130 and 0x0134) now. After a refused state, or a change of
    /// state by itself, the error flag is set and the code gives the reason.
    pub fn state(self) -> S::Outcome<AlRegisters, SubDeviceError> {
        self.ask(move |engine, subdevice| {
            let read = engine.start_register_read(subdevice, map::AL_STATUS, STATUS_BYTES);
            async move {
                let bytes = read.ended().await?;
                let word = |at: usize| [bytes.get(at), bytes.get(at + 1)].map(|byte| byte.copied().unwrap_or(0));
                let registers = AlRegisters::new(AlStatus::decode(&word(0)), AlStatusCode::decode(&word(4)));
                Ok::<_, SubDeviceFailure>(registers)
            }
        })
    }

    /// Data of the scan; `None` for a declared SubDevice that the scan did not find.
    pub fn info(self) -> S::Outcome<Option<SubDeviceInfo>, SubDeviceError> {
        self.ask(move |engine, subdevice| {
            let info = engine.info(subdevice);
            async move { Ok::<_, SubDeviceFailure>(info) }
        })
    }

    /// Reads a register, or memory, of the size of the type.
    pub fn register_read<T: Number + ObjectValue>(self, address: RegisterAddress) -> S::Outcome<T, SubDeviceError> {
        self.ask(move |engine, subdevice| {
            let read = engine.start_register_read(subdevice, address, <T as Number>::BYTES);
            async move {
                let bytes = read.ended().await?;
                Ok::<T, SubDeviceFailure>(T::decode(bytes))
            }
        })
    }

    /// Reads `length` bytes of registers or memory.
    pub fn register_read_bytes(self, address: RegisterAddress, length: usize) -> S::Outcome<Vec<u8>, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_register_read(subdevice, address, length).ended())
    }

    /// Writes a register or memory: a number or bytes. If a frame is lost, it may be written twice.
    pub fn register_write<T: ObjectValue>(self, address: RegisterAddress, value: T) -> S::Outcome<(), SubDeviceError> {
        let data = value.encode();
        self.ask(move |engine, subdevice| engine.start_register_write(subdevice, address, data).ended())
    }

    /// Writes a register or memory before all datagrams that wait, those to the same SubDevice included. If a frame is
    /// lost, it may be written twice.
    pub fn register_write_urgently<T: ObjectValue>(
        self,
        address: RegisterAddress,
        value: T,
    ) -> S::Outcome<(), SubDeviceError> {
        let data = value.encode();
        self.ask(move |engine, subdevice| {
            engine.start_register_write_with(subdevice, address, data, Urgency::First).ended()
        })
    }

    /// Writes a state to AL control once, without the steps between and without configuration, and reads what the
    /// SubDevice shows right after. A SubDevice without a declaration is left as it is then, until another state is
    /// requested; a declared one is brought back to its target state.
    ///
    /// # Danger
    /// Outputs may switch, and the SubDevice may reach OP with a configuration that nothing has checked: for tests and
    /// maintenance of a machine that is secured.
    pub fn force_state(self, state: AlState, acknowledge: Acknowledge) -> S::Outcome<AlRegisters, SubDeviceError> {
        let subdevice = self.address;
        self.ask(move |engine, _| engine.start_forced_state(subdevice, state, acknowledge).ended())
    }

    /// Reads the loop control of a port.
    pub fn port(self, port: u8) -> S::Outcome<LoopControl, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_port_read(subdevice, port).ended())
    }

    /// Opens or closes a port. SubDevices behind a closed port get no frames.
    pub fn set_port(self, port: u8, control: LoopControl) -> S::Outcome<(), SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_port_set(subdevice, port, control).ended())
    }

    /// Isolates the SubDevice by closing the ports of its neighbours; [`Services::open_blocked`] opens them again.
    pub fn block(self) -> S::Outcome<Vec<BlockedPort>, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_block(subdevice).ended())
    }

    /// Resets its controller. A declared SubDevice is lost, found again and configured again.
    pub fn reset_controller(self) -> S::Outcome<(), SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_reset(subdevice).ended())
    }

    /// Reads its EEPROM, with the size that its header gives.
    pub fn sii_read(self) -> S::Outcome<Vec<u8>, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_sii_read(subdevice).ended())
    }

    /// The whole EEPROM: the image of an earlier read if the EEPROM is proved to be unchanged, otherwise a new read.
    /// The proof is a number that only that read has left in the registers of the EEPROM interface, and the first
    /// words.
    pub fn sii_image(self) -> S::Outcome<Vec<u8>, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_sii_image(subdevice).ended())
    }

    /// Writes its EEPROM: each word that differs is written and read back. Without `force` only an SII image is
    /// accepted. The SubDevice uses it after its next start.
    pub fn sii_write(self, image: Vec<u8>, force: bool) -> S::Outcome<SiiWritten, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_sii_write(subdevice, image, force).ended())
    }

    /// Writes its alias into the EEPROM, with the new checksum. A checksum that is wrong before is corrected only with
    /// `force`. As an alias of the SII it counts at once, as one of the register from the next start of the SubDevice
    /// on ([`AliasSource`](crate::AliasSource)).
    pub fn write_alias(self, alias: u16, force: bool) -> S::Outcome<SiiWritten, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_alias_write(subdevice, alias, force).ended())
    }

    /// Reloads the configuration of its controller from the EEPROM.
    pub fn sii_reload(self) -> S::Outcome<(), SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_sii_reload(subdevice).ended())
    }

    /// Reads the owner of its EEPROM: EtherCAT or the PDI.
    pub fn eeprom_owner(self) -> S::Outcome<EepromOwnership, SubDeviceError> {
        let subdevice = self.address;
        self.ask(move |engine, _| engine.start_eeprom_owner_read(subdevice).ended())
    }

    /// Assigns its EEPROM to EtherCAT or to the PDI; the result is the owner afterwards. Functions that read or write
    /// the EEPROM take it by force and give it back.
    pub fn assign_eeprom(self, assignment: EepromAssignment) -> S::Outcome<EepromOwnership, SubDeviceError> {
        let subdevice = self.address;
        self.ask(move |engine, _| engine.start_eeprom_assignment(subdevice, assignment).ended())
    }

    /// Reads the error counters of a declared SubDevice now.
    pub fn read_statistics(self) -> S::Outcome<Statistics, SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_statistics_read(subdevice).ended())
    }

    /// Clears the error counters of a declared SubDevice, and their totals.
    pub fn clear_statistics(self) -> S::Outcome<(), SubDeviceError> {
        self.ask(move |engine, subdevice| engine.start_statistics_clear(subdevice).ended())
    }
}
