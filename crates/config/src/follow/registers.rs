//! Register values of a controller after the commands of a file: the commands are replayed in the order of sending, and
//! the result is evaluated. The number of writes to a register does not matter.

use std::collections::BTreeMap;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::{Fmmu, SyncManager, map};

use crate::eni::{EcatCommand, Place, Target, Transition};

/// The transitions to OP, in the order of sending.
pub(super) const UP: [Transition; 3] = [Transition::Ip, Transition::Ps, Transition::So];

/// Registers that were written, by address, each with the command that wrote it last.
#[derive(Clone, Debug, Default)]
pub(super) struct Registers {
    bytes: BTreeMap<u16, (u8, Place)>,
}

impl Registers {
    /// The registers after the commands of these transitions, one transition after the other, each in document order.
    pub fn after(commands: &[EcatCommand], transitions: &[Transition]) -> Registers {
        let mut registers = Registers::default();
        for transition in transitions {
            for command in commands.iter().filter(|command| command.transitions.contains(transition)) {
                registers.write(command);
            }
        }
        registers
    }

    fn write(&mut self, command: &EcatCommand) {
        let Target::Register { ado, .. } = command.datagram.target else { return };
        if !command.datagram.command.writes() || command.datagram.command.reads() {
            return;
        }
        for (offset, byte) in (0_u16..).zip(&command.datagram.data) {
            // Only configuration registers are relevant; process data memory would only cost time.
            let Some(address) = ado.0.checked_add(offset).filter(|address| *address < 0x1000) else { break };
            self.bytes.insert(address, (*byte, command.place));
        }
    }

    /// The last write to this address, if there is one.
    pub fn place(&self, address: RegisterAddress, length: u16) -> Option<Place> {
        let end = address.0.saturating_add(length);
        self.bytes.range(address.0..end).map(|(_, (_, place))| *place).next_back()
    }

    /// A register; bytes that were never written are 0.
    pub fn read<const N: usize>(&self, address: RegisterAddress) -> [u8; N] {
        let mut read = [0; N];
        for (offset, byte) in (0_u16..).zip(&mut read) {
            *byte = self.bytes.get(&address.0.saturating_add(offset)).map_or(0, |(byte, _)| *byte);
        }
        read
    }

    /// A register of 16 bits; `None` if it was never written.
    pub fn word(&self, address: RegisterAddress) -> Option<u16> {
        self.place(address, 2).map(|_| u16::from_le_bytes(self.read(address)))
    }

    /// A register of 32 bits; `None` if it was never written.
    pub fn double_word(&self, address: RegisterAddress) -> Option<u32> {
        self.place(address, 4).map(|_| u32::from_le_bytes(self.read(address)))
    }

    /// The SyncManagers that are not all zero, with the place of their last command.
    pub fn sync_managers(&self) -> impl Iterator<Item = (u8, SyncManager, Place)> + '_ {
        (0..16).filter_map(|index| {
            let address = map::sync_manager(index);
            let bytes: [u8; SyncManager::LEN] = self.read(address);
            let place = self.place(address, SyncManager::LEN as u16)?;
            (bytes != [0; SyncManager::LEN]).then(|| (index, SyncManager::decode(&bytes), place))
        })
    }

    /// The activated FMMUs.
    pub fn fmmus(&self) -> impl Iterator<Item = (u8, Fmmu, Place)> + '_ {
        (0..16).filter_map(|index| {
            let address = map::fmmu(index);
            let place = self.place(address, Fmmu::LEN as u16)?;
            let fmmu = Fmmu::decode(&self.read(address));
            fmmu.active.then_some((index, fmmu, place))
        })
    }
}

/// Whether the file has the commands that bring a SubDevice up. Files written by hand have at most a few additional
/// commands and leave the rest to the SII.
pub(super) fn is_complete(commands: &[EcatCommand]) -> bool {
    commands.iter().any(|command| match command.datagram.target {
        Target::Register { ado, .. } => {
            ado == map::AL_CONTROL || (map::FMMU_BASE.0..map::SYNC_MANAGER_BASE.0 + 0x80).contains(&ado.0)
        }
        Target::Logical(_) => false,
    })
}
