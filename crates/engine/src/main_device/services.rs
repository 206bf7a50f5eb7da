//! Services of the MainDevice besides the mailbox protocols. Each starts a procedure; its result is fetched later.
//!
//! SubDevices are named by their [`Address`]: the index in the declaration, or the position on the bus.

pub(super) mod commands;
pub(super) mod datagrams;
pub(super) mod ethernet;
pub(super) mod gateway;
pub(super) mod mail;
pub(super) mod messages;
pub(super) mod tool;

use alloc::vec::Vec;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::memory_write::WriteKind;
use ringcat_wire::register::LoopControl;
use ringcat_wire::sii::{Identity, SiiHeader};

use super::MainDevice;
use super::pending::Pending;
use crate::declared::{Address, SubDeviceId};
use crate::info::SubDeviceInfo;
use crate::mail::coe::Dictionaries;
use crate::procedures::complete_siis::complete;
use crate::procedures::error_statistics::ErrorStatistics;
use crate::procedures::idle::rescue;
use crate::procedures::services::ports::BlockedPort;
use crate::procedures::services::registers::Urgency;
use crate::procedures::services::statistics::{self, Statistics};
use crate::procedures::services::{ServiceError, ports, registers, reset};
use crate::procedures::sii::images::{self, SiiImages};
use crate::procedures::sii::program::{self, SiiWritten};
use crate::procedures::unassigned::rescan::{Rescan, rescan};
use crate::role::Function;
use crate::segment::{Addressed, More, Observation};
use crate::supervisor::Bus;
use crate::supervisor::long_transfers::TransferProgress;

impl MainDevice {
    /// Station address of a SubDevice.
    pub fn station(&self, subdevice: impl Into<Address>) -> Option<StationAddress> {
        let view = self.segment.view();
        view.station(view.find(subdevice)?)
    }

    /// Object dictionaries that were read before, for all SubDevices.
    pub fn dictionaries(&self) -> Dictionaries {
        self.segment.dictionaries.clone()
    }

    /// Identity and features of a SubDevice as the scan found them, or as they were read when it came later; `None` if
    /// it was absent, and in role INACTIVE.
    pub fn info(&self, subdevice: impl Into<Address>) -> Option<SubDeviceInfo> {
        self.permit(Function::SubDeviceInfo).ok()?;
        let view = self.segment.view();
        let info = match view.find(subdevice)? {
            Addressed::Undeclared(key) => view.unassigned(key)?.knowledge.info(),
            Addressed::Member(index) => {
                let station = view.member(index)?.station;
                view.found()?.subdevices.iter().find(|info| info.station == station)
            }
        };
        info.map(|info| (**info).clone())
    }

    /// Identity of a SubDevice as it was read last: also of one that has replaced another one since the scan.
    pub fn identity(&self, subdevice: impl Into<Address>) -> Option<Identity> {
        let view = self.segment.view();
        let info = match view.find(subdevice)? {
            Addressed::Undeclared(key) => view.unassigned(key)?.knowledge.info(),
            Addressed::Member(index) => view.member(index)?.info,
        };
        info.map(|info| info.identity)
    }

    /// Starts a procedure on one SubDevice.
    pub(super) fn start_on<T, E, W>(
        &mut self,
        function: Function,
        subdevice: impl Into<Address>,
        work: impl FnOnce(Bus, StationAddress) -> W,
    ) -> Pending<Result<T, ServiceError>>
    where
        T: 'static,
        ServiceError: From<E>,
        W: Future<Output = Result<T, E>> + 'static,
    {
        let subdevice = subdevice.into();
        let permitted = self.permit(function).map_err(ServiceError::NotPermitted);
        let station = self.station(subdevice).ok_or(ServiceError::NoSubDevice { subdevice });
        let work = permitted.and(station).map(|station| work(self.bus(), station));
        self.start(async move { Ok(work?.await?) })
    }

    /// Starts a read of `length` bytes of registers or memory.
    pub fn start_register_read(
        &mut self,
        subdevice: impl Into<Address>,
        address: RegisterAddress,
        length: usize,
    ) -> Pending<Result<Vec<u8>, ServiceError>> {
        self.start_on(Function::Registers, subdevice, move |bus, station| async move {
            registers::read(&bus, station, address, length).await
        })
    }

    /// Starts a write of registers or memory. A datagram of a lost frame is sent again: a register may be written
    /// twice.
    pub fn start_register_write(
        &mut self,
        subdevice: impl Into<Address>,
        address: RegisterAddress,
        data: Vec<u8>,
    ) -> Pending<Result<(), ServiceError>> {
        self.start_register_write_with(subdevice, address, data, Urgency::InOrder)
    }

    /// As [`MainDevice::start_register_write`], in order or before all datagrams that wait.
    pub fn start_register_write_with(
        &mut self,
        subdevice: impl Into<Address>,
        address: RegisterAddress,
        data: Vec<u8>,
        urgency: Urgency,
    ) -> Pending<Result<(), ServiceError>> {
        let segment = self.segment.clone();
        self.start_on(Function::Registers, subdevice, move |bus, station| async move {
            registers::write(&bus, &segment, station, address, &data, urgency).await
        })
    }

    /// Starts a read of the loop control of a port.
    pub fn start_port_read(
        &mut self,
        subdevice: impl Into<Address>,
        port: u8,
    ) -> Pending<Result<LoopControl, ServiceError>> {
        self.start_on(Function::PortState, subdevice, move |bus, station| async move {
            ports::read(&bus, station, port).await
        })
    }

    /// Starts to open or close a port. SubDevices behind a closed one are out of reach.
    pub fn start_port_set(
        &mut self,
        subdevice: impl Into<Address>,
        port: u8,
        control: LoopControl,
    ) -> Pending<Result<(), ServiceError>> {
        let segment = self.segment.clone();
        self.start_on(Function::PortState, subdevice, move |bus, station| async move {
            ports::set(&bus, &segment, station, port, control).await
        })
    }

    /// Starts to cut off a declared SubDevice, by closing the ports of its neighbours. In a line the SubDevices behind
    /// it are cut off too.
    pub fn start_block(&mut self, subdevice: impl Into<Address>) -> Pending<Result<Vec<BlockedPort>, ServiceError>> {
        let permitted = self.permit(Function::BlockedPorts).map_err(ServiceError::NotPermitted);
        let index = permitted.and_then(|()| self.find_member(subdevice));
        let (bus, segment) = (self.bus(), self.segment.clone());
        self.start(async move { ports::block(&bus, &segment, index?).await })
    }

    /// Starts to open all ports that were closed to cut SubDevices off, by this application or by one before it. A
    /// scan from the beginning opens them as well, a rescan does not.
    pub fn start_open_blocked(&mut self) -> Pending<Result<usize, ServiceError>> {
        let (bus, segment, permitted) = (self.bus(), self.segment.clone(), self.permit(Function::BlockedPorts));
        self.start(async move {
            permitted?;
            ports::open_blocked(&bus, &segment).await
        })
    }

    /// Starts a reset of a SubDevice controller. A declared SubDevice is lost, found again and configured again.
    pub fn start_reset(&mut self, subdevice: impl Into<Address>) -> Pending<Result<(), ServiceError>> {
        self.start_on(Function::ControllerReset, subdevice, move |bus, station| async move {
            reset::reset_controller(&bus, station).await
        })
    }

    /// Makes supervision scan all SubDevices now, and search for new ones, as if the segment had changed. False before
    /// activation, when a normal scan does the same.
    pub fn force_topology_change(&mut self) -> bool {
        let is_permitted = self.permit(Function::ForceTopologyChange).is_ok();
        if let Some(segment) = self.active().filter(|_| is_permitted) {
            segment.observe(Observation::RoundWanted);
        }
        is_permitted
    }

    /// Starts a scan of the whole segment while process data continues: the position of each SubDevice, and which are
    /// new, have moved or are missing. New ones are read, but not configured. It lasts until the segment is stable and
    /// all are identified, or until `limit`; then the result contains what is known.
    ///
    /// From then on places of breaks, errors of cables and positions in events follow the new cabling, rings behind
    /// junctions included. Exception: while the ring of two links is open, or a mandatory SubDevice does not answer,
    /// they follow the previous cabling.
    ///
    /// Without an application it needs idle operation. SubDevices that have kept their station addresses are left in
    /// their states, their mailboxes stay open, and no word of their EEPROMs is read, except the identities of those
    /// that are at another place; others get addresses, are read and brought to PREOP. The result has the differences
    /// from the scan before ([`Rescan::added`], `removed`, `moved_from`).
    pub fn start_rescan(&mut self, limit: Duration) -> Pending<Result<Rescan, ServiceError>> {
        let (bus, segment, permitted) = (self.bus(), self.segment.clone(), self.permit(Function::Rescan));
        let (is_active, is_kept) = (self.active().is_some(), self.options.idle_operation);
        self.start(async move {
            permitted?;
            match (is_active, is_kept) {
                (true, _) => rescan(&bus, &segment, limit).await,
                (false, true) => rescue(&bus, &segment, limit).await,
                (false, false) => Err(ServiceError::NoIdleOperation),
            }
        })
    }

    /// Starts a read of what the scan left out of the SIIs ([`Options::sii_extent`](super::Options)); the result is the
    /// SubDevices of the scan with all of it. Only the reading of SIIs that are not complete yet takes time.
    pub fn start_sii_completion(&mut self) -> Pending<Result<Vec<SubDeviceInfo>, ServiceError>> {
        let (bus, segment, permitted) = (self.bus(), self.segment.clone(), self.permit(Function::SiiCompletion));
        self.start(async move {
            permitted?;
            complete(&bus, &segment).await
        })
    }

    /// Starts a read of a whole EEPROM, word by word; the SII contains its size.
    pub fn start_sii_read(&mut self, subdevice: impl Into<Address>) -> Pending<Result<Vec<u8>, ServiceError>> {
        let (images, eeproms) = (self.images_of_present(), self.segment.eeproms.clone());
        self.start_on(Function::Eeprom, subdevice, move |bus, station| async move {
            let _turn = eeproms.take(station).await;
            images::read_anew(&bus, station, &images).await
        })
    }

    /// As [`MainDevice::start_sii_read`], but an EEPROM that has proved to be unchanged since it was read whole is not
    /// read again (decision 0210).
    pub fn start_sii_image(&mut self, subdevice: impl Into<Address>) -> Pending<Result<Vec<u8>, ServiceError>> {
        let (images, eeproms) = (self.images_of_present(), self.segment.eeproms.clone());
        let cache = self.cache.clone();
        self.start_on(Function::Eeprom, subdevice, move |bus, station| async move {
            let _turn = eeproms.take(station).await;
            images::read(&bus, station, &images, &cache).await
        })
    }

    /// The images that were read, without those of SubDevices that have left.
    fn images_of_present(&self) -> SiiImages {
        let view = self.segment.view();
        self.sii_images.keep_those(|station| view.subdevices().all().iter().any(|it| it.key.station == station));
        self.sii_images.clone()
    }

    /// Progress of the long transfers of a SubDevice: EEPROM, files, objects in segments.
    pub fn transfers(&self, subdevice: impl Into<Address>) -> Vec<TransferProgress> {
        self.station(subdevice).map(|station| self.bus().transfers(station)).unwrap_or_default()
    }

    /// Starts a write of an EEPROM: each word that differs is written and read back. Without `force` only an SII image
    /// is accepted. The SubDevice uses it after its next start or [`MainDevice::start_sii_reload`].
    pub fn start_sii_write(
        &mut self,
        subdevice: impl Into<Address>,
        image: Vec<u8>,
        force: bool,
    ) -> Pending<Result<SiiWritten, ServiceError>> {
        let (cache, images, segment) = (self.cache.clone(), self.sii_images.clone(), self.segment.clone());
        let subdevice: Address = subdevice.into();
        self.start_on(Function::Eeprom, subdevice, move |bus, station| async move {
            let _turn = segment.eeproms.take(station).await;
            let _write = bus.begin_memory_write(subdevice.memory_write(WriteKind::Eeprom));
            images.forget(station);
            let key = segment.key_for_alias(station);
            let written = program::write(&bus, station, &image, force).await;
            cache.clear();
            if let (Ok(_), Some(key), Some(header)) = (&written, key, image.first_chunk()) {
                let alias = crate::info::alias_of(&SiiHeader::decode(header));
                segment.observe(Observation::MoreRead { key, more: More::Alias(alias) });
            }
            written
        })
    }

    /// Starts a write of the alias into the EEPROM, with the new checksum. A checksum that is wrong before is corrected
    /// only with `force`. As an alias of the SII it counts at once, as one of the register from the next start of the
    /// SubDevice on ([`AliasSource`](crate::info::AliasSource)).
    pub fn start_alias_write(
        &mut self,
        subdevice: impl Into<Address>,
        alias: u16,
        force: bool,
    ) -> Pending<Result<SiiWritten, ServiceError>> {
        let (cache, images, segment) = (self.cache.clone(), self.sii_images.clone(), self.segment.clone());
        let subdevice: Address = subdevice.into();
        self.start_on(Function::Eeprom, subdevice, move |bus, station| async move {
            let _turn = segment.eeproms.take(station).await;
            let _write = bus.begin_memory_write(subdevice.memory_write(WriteKind::Eeprom));
            images.forget(station);
            let key = segment.key_for_alias(station);
            let written = program::write_alias(&bus, station, alias, force).await;
            cache.clear();
            if let (Ok(_), Some(key)) = (&written, key) {
                segment.observe(Observation::MoreRead { key, more: More::Alias(alias) });
            }
            written
        })
    }

    /// Starts a reload of a controller's configuration from the EEPROM.
    pub fn start_sii_reload(&mut self, subdevice: impl Into<Address>) -> Pending<Result<(), ServiceError>> {
        let eeproms = self.segment.eeproms.clone();
        self.start_on(Function::Eeprom, subdevice, move |bus, station| async move {
            let _turn = eeproms.take(station).await;
            program::reload(&bus, station).await
        })
    }

    /// Sets the interval at which the error counters of all declared SubDevices are read in the background; `None` (the
    /// initial value) is never.
    pub fn set_statistics_period(&mut self, period: Option<Duration>) {
        self.statistics_period = period;
        if let Some(book) = &self.statistics {
            book.set_period(period);
        }
    }

    /// Error counts of a declared SubDevice as of the last reading. `None` before activation.
    pub fn statistics(&self, subdevice: impl Into<Address>) -> Option<Statistics> {
        self.permit(Function::Statistics).ok()?;
        self.statistics.as_ref()?.find(self.find_member(subdevice).ok()?)
    }

    /// Starts a read of the error counters of a declared SubDevice.
    pub fn start_statistics_read(
        &mut self,
        subdevice: impl Into<Address>,
    ) -> Pending<Result<Statistics, ServiceError>> {
        self.start_statistics(subdevice, |bus, book, index, station| async move {
            statistics::read(&bus, &book, index, station).await
        })
    }

    /// Starts to clear the error counters of a declared SubDevice, and their totals.
    pub fn start_statistics_clear(&mut self, subdevice: impl Into<Address>) -> Pending<Result<(), ServiceError>> {
        self.start_statistics(subdevice, |bus, book, index, station| async move {
            statistics::clear(&bus, &book, index, station).await
        })
    }

    /// Starts a procedure on a declared SubDevice and its error counts.
    fn start_statistics<T, W>(
        &mut self,
        subdevice: impl Into<Address>,
        work: impl FnOnce(Bus, ErrorStatistics, usize, StationAddress) -> W,
    ) -> Pending<Result<T, ServiceError>>
    where
        T: 'static,
        W: Future<Output = Result<T, ServiceError>> + 'static,
    {
        let permitted = self.permit(Function::Statistics).map_err(ServiceError::NotPermitted);
        let work = permitted.and_then(|()| self.find_member(subdevice)).and_then(|index| {
            let book = self.statistics.clone().ok_or(ServiceError::NotActive)?;
            let station = self.station(SubDeviceId(index)).ok_or(ServiceError::NotActive)?;
            Ok(work(self.bus(), book, index, station))
        });
        self.start(async move { work?.await })
    }
}
