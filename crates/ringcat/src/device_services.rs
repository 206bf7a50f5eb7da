//! Services on single SubDevices besides the mailbox protocols, from any thread: registers, datagrams, ports, resets, the
//! EEPROM, error counters.
//!
//! SubDevices are named by their index in the declaration, before activation by their position.

use std::time::Duration;

use ringcat_engine::main_device::RawDatagram;
use ringcat_engine::procedures::services::ports::BlockedPort;
use ringcat_engine::procedures::services::statistics::Statistics;
use ringcat_engine::procedures::sii::program::SiiWritten;
use ringcat_engine::procedures::unassigned::rescan::Rescan;
use ringcat_engine::supervisor::{BusError, Reply};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::LoopControl;

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

impl SupervisorThread {
    /// Reads registers or memory of a SubDevice, by its index in the declaration, before activation by its position.
    ///
    /// # Errors
    /// It does not answer, or as [`SupervisorThread::run`].
    pub fn register_read(&self, subdevice: usize, address: RegisterAddress, length: usize) -> Result<Vec<u8>, Error> {
        Ok(self.wait_for(move |engine| engine.start_register_read(subdevice, address, length))??)
    }

    /// Writes registers or memory of a SubDevice; as [`SupervisorThread::register_read`]. Where a frame is lost, a
    /// register may be written twice.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn register_write(&self, subdevice: usize, address: RegisterAddress, data: Vec<u8>) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_register_write(subdevice, address, data))??)
    }

    /// Sends datagrams of the application's own at once, in one frame where they fit, and waits for all answers. Each is
    /// there whatever its working counter.
    ///
    /// # Errors
    /// More than [`ringcat_engine::main_device::MAX_DATAGRAMS`], or as [`SupervisorThread::run`].
    pub fn datagrams(&self, datagrams: Vec<RawDatagram>) -> Result<Vec<Result<Reply, BusError>>, Error> {
        Ok(self.wait_for(move |engine| engine.start_datagrams(datagrams))??)
    }

    /// What a port does about its loop.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn port(&self, subdevice: usize, port: u8) -> Result<LoopControl, Error> {
        Ok(self.wait_for(move |engine| engine.start_port_read(subdevice, port))??)
    }

    /// Opens or closes a port. Who is behind one that is closed is gone for everybody.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn set_port(&self, subdevice: usize, port: u8, control: LoopControl) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_port_set(subdevice, port, control))??)
    }

    /// Cuts a declared SubDevice off by closing the ports of its neighbours. In a line those behind it go with it.
    ///
    /// # Errors
    /// It hangs on the main link itself, a neighbour does not answer, or as [`SupervisorThread::run`].
    pub fn block(&self, subdevice: usize) -> Result<Vec<BlockedPort>, Error> {
        Ok(self.wait_for(move |engine| engine.start_block(subdevice))??)
    }

    /// Opens all ports that [`SupervisorThread::block`] has closed; returns how many there were.
    ///
    /// # Errors
    /// A neighbour does not answer; its port is kept for the next try. Or as [`SupervisorThread::run`].
    pub fn open_blocked(&self) -> Result<usize, Error> {
        Ok(self.wait_for(|engine| engine.start_open_blocked())??)
    }

    /// Resets a SubDevice controller. A declared SubDevice is lost and found again, and configured anew.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn reset_controller(&self, subdevice: usize) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_reset(subdevice))??)
    }

    /// Has all SubDevices looked at now, and new ones looked for, as if the segment had changed. False before activation:
    /// there a scan looks.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn force_topology_change(&self) -> Result<bool, Error> {
        self.with(|engine| engine.force_topology_change())
    }

    /// Looks at the whole segment again while process data goes on: who is at which place now, who is new, has moved or is
    /// gone. New ones are read, but left alone; those that have moved are events, too. Waits until the segment holds still
    /// and it is known of everybody who it is, for so long at most.
    ///
    /// Places of breaks, errors of cables and positions in events go by the new cabling from then on, unless the ring of two
    /// links is open or a mandatory SubDevice does not answer.
    ///
    /// # Errors
    /// Nothing is declared yet, the segment does not hold still or the bus fails at the end of the time, or as
    /// [`SupervisorThread::run`].
    pub fn rescan(&self, limit: Duration) -> Result<Rescan, Error> {
        Ok(self.wait_for(move |engine| engine.start_rescan(limit))??)
    }

    /// Reads an EEPROM, as large as it says that it is.
    ///
    /// # Errors
    /// It cannot be read, or as [`SupervisorThread::run`].
    pub fn sii_read(&self, subdevice: usize) -> Result<Vec<u8>, Error> {
        Ok(self.wait_for(move |engine| engine.start_sii_read(subdevice))??)
    }

    /// Writes an EEPROM: each word that is not right already, and read back. What is no SII image is refused unless
    /// `force` says so. It counts from the SubDevice's next start on, most of it.
    ///
    /// # Errors
    /// No image, a word that is refused or does not read back, or as [`SupervisorThread::run`].
    pub fn sii_write(&self, subdevice: usize, image: Vec<u8>, force: bool) -> Result<SiiWritten, Error> {
        Ok(self.wait_for(move |engine| engine.start_sii_write(subdevice, image, force))??)
    }

    /// Writes the alias into the EEPROM, with the checksum that belongs to it; one that is wrong already is made right only
    /// with `force`. The alias counts from the SubDevice's next start on.
    ///
    /// # Errors
    /// As [`SupervisorThread::sii_write`].
    pub fn write_alias(&self, subdevice: usize, alias: u16, force: bool) -> Result<SiiWritten, Error> {
        Ok(self.wait_for(move |engine| engine.start_alias_write(subdevice, alias, force))??)
    }

    /// Has a controller load its configuration from the EEPROM again.
    ///
    /// # Errors
    /// It refuses the checksum, or as [`SupervisorThread::run`].
    pub fn sii_reload(&self, subdevice: usize) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_sii_reload(subdevice))??)
    }

    /// Sets how often the error counters of all declared SubDevices are read in the background; `None`, as at the
    /// beginning, is never.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn set_statistics_period(&self, period: Option<Duration>) -> Result<(), Error> {
        self.with(move |engine| engine.set_statistics_period(period))
    }

    /// What a declared SubDevice has counted, as far as it was read. `None` before activation.
    ///
    /// # Errors
    /// The thread is gone.
    pub fn statistics(&self, subdevice: usize) -> Result<Option<Statistics>, Error> {
        self.with(move |engine| engine.statistics(subdevice))
    }

    /// Reads the error counters of a declared SubDevice now.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn read_statistics(&self, subdevice: usize) -> Result<Statistics, Error> {
        Ok(self.wait_for(move |engine| engine.start_statistics_read(subdevice))??)
    }

    /// Clears the error counters of a declared SubDevice, and what was kept of them.
    ///
    /// # Errors
    /// As [`SupervisorThread::register_read`].
    pub fn clear_statistics(&self, subdevice: usize) -> Result<(), Error> {
        Ok(self.wait_for(move |engine| engine.start_statistics_clear(subdevice))??)
    }
}
