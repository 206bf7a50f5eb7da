//! Services of the MainDevice besides the mailbox protocols, started and asked for their results later.
//!
//! SubDevices are named by their index in the declaration, before activation by their position in the last scan.

use alloc::vec::Vec;
use core::future::Future;

use ringcat_wire::address::{RegisterAddress, StationAddress};

use super::MainDevice;
use super::pending::Pending;
use crate::procedures::services::{ServiceError, registers};
use crate::supervisor::Bus;

impl MainDevice {
    /// Station address of a SubDevice, by which it is reached on the bus.
    pub fn station(&self, subdevice: usize) -> Option<StationAddress> {
        match (&self.fleet, &*self.scan.borrow()) {
            (Some(fleet), _) => fleet.access().members.get(subdevice).map(|member| member.station),
            (None, Some(Ok(scan))) => scan.subdevices.get(subdevice).map(|info| info.station),
            (None, _) => None,
        }
    }

    /// Starts a procedure on one SubDevice.
    pub(super) fn start_on<T, W>(
        &mut self,
        subdevice: usize,
        work: impl FnOnce(Bus, StationAddress) -> W,
    ) -> Pending<Result<T, ServiceError>>
    where
        T: 'static,
        W: Future<Output = Result<T, ServiceError>> + 'static,
    {
        let work = self.station(subdevice).map(|station| work(self.bus(), station));
        self.start(async move {
            match work {
                Some(work) => work.await,
                None => Err(ServiceError::NoSubDevice { subdevice }),
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
        self.start_on(
            subdevice,
            move |bus, station| async move { registers::write(&bus, station, address, &data).await },
        )
    }
}
