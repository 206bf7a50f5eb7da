//! Services of the MainDevice besides the mailbox protocols, started and asked for their results later.
//!
//! SubDevices are named by their index in the declaration, before activation by their position in the last scan.

use alloc::vec::Vec;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress};
use ringcat_wire::register::LoopControl;

use super::MainDevice;
use super::pending::Pending;
use crate::declared::{Address, SubDeviceId};
use crate::procedures::services::ports::BlockedPort;
use crate::procedures::services::statistics::{self, Statistics};
use crate::procedures::services::{ServiceError, ports, registers, reset};
use crate::procedures::sii::program::{self, SiiWritten};
use crate::procedures::unassigned::rescan::{Rescan, rescan};
use crate::segment::Observation;
use crate::supervisor::Bus;

impl MainDevice {
    /// Station address of a SubDevice, by which it is reached on the bus.
    pub fn station(&self, subdevice: usize) -> Option<StationAddress> {
        match (&self.segment, &*self.scan.borrow()) {
            (Some(segment), _) => segment.view().members.get(subdevice).map(|member| member.station),
            (None, Some(Ok(scan))) => scan.subdevices.get(subdevice).map(|info| info.station),
            (None, _) => None,
        }
    }

    /// Starts a procedure on one SubDevice.
    fn start_on<T, E, W>(
        &mut self,
        subdevice: usize,
        work: impl FnOnce(Bus, StationAddress) -> W,
    ) -> Pending<Result<T, ServiceError>>
    where
        T: 'static,
        ServiceError: From<E>,
        W: Future<Output = Result<T, E>> + 'static,
    {
        let work = self.station(subdevice).map(|station| work(self.bus(), station));
        let address = match self.segment {
            Some(_) => Address::Declared(SubDeviceId(subdevice)),
            None => Address::Scanned(Position(u16::try_from(subdevice).unwrap_or(u16::MAX))),
        };
        self.start(async move {
            match work {
                Some(work) => Ok(work.await?),
                None => Err(ServiceError::NoSubDevice { subdevice: address }),
            }
        })
    }

    /// Starts to read `length` bytes of registers or memory.
    pub fn start_register_read(
        &mut self,
        subdevice: usize,
        address: RegisterAddress,
        length: usize,
    ) -> Pending<Result<Vec<u8>, ServiceError>> {
        self.start_on(
            subdevice,
            move |bus, station| async move { registers::read(&bus, station, address, length).await },
        )
    }

    /// Starts to write registers or memory. A datagram whose frame is lost is sent again: a register may be written
    /// twice.
    pub fn start_register_write(
        &mut self,
        subdevice: usize,
        address: RegisterAddress,
        data: Vec<u8>,
    ) -> Pending<Result<(), ServiceError>> {
        let segment = self.segment.clone();
        self.start_on(subdevice, move |bus, station| async move {
            registers::write(&bus, segment.as_ref(), station, address, &data).await
        })
    }

    /// Starts to ask what a port does about its loop.
    pub fn start_port_read(&mut self, subdevice: usize, port: u8) -> Pending<Result<LoopControl, ServiceError>> {
        self.start_on(subdevice, move |bus, station| async move { ports::read(&bus, station, port).await })
    }

    /// Starts to open or close a port. SubDevices behind a closed one are out of reach.
    pub fn start_port_set(
        &mut self,
        subdevice: usize,
        port: u8,
        control: LoopControl,
    ) -> Pending<Result<(), ServiceError>> {
        let segment = self.segment.clone();
        self.start_on(subdevice, move |bus, station| async move {
            ports::set(&bus, segment.as_ref(), station, port, control).await
        })
    }

    /// Starts to cut a declared SubDevice off, by closing the ports of its neighbours. In a line those behind it go
    /// with it.
    pub fn start_block(&mut self, subdevice: usize) -> Pending<Result<Vec<BlockedPort>, ServiceError>> {
        let (bus, segment) = (self.bus(), self.segment.clone());
        self.start(async move {
            let segment = segment.ok_or(ServiceError::NotActive)?;
            ports::block(&bus, &segment, subdevice).await
        })
    }

    /// Starts to open all ports that were closed to cut SubDevices off.
    pub fn start_open_blocked(&mut self) -> Pending<Result<usize, ServiceError>> {
        let (bus, segment) = (self.bus(), self.segment.clone());
        self.start(async move {
            let segment = segment.ok_or(ServiceError::NotActive)?;
            ports::open_blocked(&bus, &segment).await
        })
    }

    /// Starts to reset a SubDevice controller. A declared SubDevice is lost and found again, and configured anew.
    pub fn start_reset(&mut self, subdevice: usize) -> Pending<Result<(), ServiceError>> {
        self.start_on(subdevice, move |bus, station| async move { reset::reset_controller(&bus, station).await })
    }

    /// Has supervision scan all SubDevices now, and search for new ones, as if the segment had changed. False before
    /// activation: there a scan looks.
    pub fn force_topology_change(&mut self) -> bool {
        if let Some(segment) = &self.segment {
            segment.observe(Observation::LookAgain);
        }
        self.segment.is_some()
    }

    /// Starts a scan of the whole segment while process data goes on: which SubDevice is at which place now, which are
    /// new, have moved or are missing. New ones are read, but left alone. It lasts until the segment holds still and
    /// all are identified, for so long at most; then the result is what is known.
    ///
    /// Places of breaks, errors of cables and positions in events go by the new cabling from then on, rings behind
    /// junctions included, unless it is not whole: while the ring of two links is open, or a mandatory SubDevice does
    /// not answer, they go by the cabling of before.
    pub fn start_rescan(&mut self, limit: Duration) -> Pending<Result<Rescan, ServiceError>> {
        let (bus, segment) = (self.bus(), self.segment.clone());
        self.start(async move { rescan(&bus, &segment.ok_or(ServiceError::NotActive)?, limit).await })
    }

    /// Starts to read an EEPROM, as large as it says that it is.
    pub fn start_sii_read(&mut self, subdevice: usize) -> Pending<Result<Vec<u8>, ServiceError>> {
        self.start_on(subdevice, move |bus, station| async move { program::read_all(&bus, station).await })
    }

    /// Starts to write an EEPROM: each word that is not right already, and read back. What is no SII image is refused
    /// unless `force` says so. What a SubDevice does with it, it does after its next start or
    /// [`MainDevice::start_sii_reload`].
    pub fn start_sii_write(
        &mut self,
        subdevice: usize,
        image: Vec<u8>,
        force: bool,
    ) -> Pending<Result<SiiWritten, ServiceError>> {
        let cache = self.cache.clone();
        self.start_on(subdevice, move |bus, station| async move {
            let written = program::write(&bus, station, &image, force).await;
            cache.clear();
            written
        })
    }

    /// Starts to write the alias into the EEPROM, with the checksum that belongs to it. One that is wrong already is
    /// made right only with `force`. The alias counts from the SubDevice's next start on.
    pub fn start_alias_write(
        &mut self,
        subdevice: usize,
        alias: u16,
        force: bool,
    ) -> Pending<Result<SiiWritten, ServiceError>> {
        let cache = self.cache.clone();
        self.start_on(subdevice, move |bus, station| async move {
            let written = program::write_alias(&bus, station, alias, force).await;
            cache.clear();
            written
        })
    }

    /// Starts to have a controller load its configuration from the EEPROM again.
    pub fn start_sii_reload(&mut self, subdevice: usize) -> Pending<Result<(), ServiceError>> {
        self.start_on(subdevice, move |bus, station| async move { program::reload(&bus, station).await })
    }

    /// Sets how often the error counters of all declared SubDevices are read in the background; `None`, as at the
    /// beginning, is never.
    pub fn set_statistics_period(&mut self, period: Option<Duration>) {
        self.statistics_period = period;
        if let Some(book) = &self.statistics {
            book.set_period(period);
        }
    }

    /// What a declared SubDevice has counted, as far as it was read. `None` before activation.
    pub fn statistics(&self, subdevice: usize) -> Option<Statistics> {
        self.statistics.as_ref()?.find(subdevice)
    }

    /// Starts to read the error counters of a declared SubDevice now.
    pub fn start_statistics_read(&mut self, subdevice: usize) -> Pending<Result<Statistics, ServiceError>> {
        let book = self.statistics.clone();
        self.start_on(subdevice, move |bus, station| async move {
            let book = book.ok_or(ServiceError::NotActive)?;
            statistics::read(&bus, &book, subdevice, station).await
        })
    }

    /// Starts to clear the error counters of a declared SubDevice, and what was kept of them.
    pub fn start_statistics_clear(&mut self, subdevice: usize) -> Pending<Result<(), ServiceError>> {
        let book = self.statistics.clone();
        self.start_on(subdevice, move |bus, station| async move {
            let book = book.ok_or(ServiceError::NotActive)?;
            statistics::clear(&bus, &book, subdevice, station).await
        })
    }
}
