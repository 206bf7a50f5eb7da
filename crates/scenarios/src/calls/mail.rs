//! Mailbox calls that wait, emergencies, and requests of the cycle.

use std::time::Duration;

use ringcat::{EmergencyRing, EngineKey, Error, Position, Services, SubDevice, SubDeviceError, SubDeviceId};
use ringcat_engine::main_device::Pending;

use super::errno::Errno;
use super::master::Ecrt;
use super::side::Side;

/// Default time limit of a blocking SDO call.
pub const SDO: Duration = Duration::from_secs(1);
/// A cycle more: the call ends between two of them.
const CYCLES: Duration = Duration::from_millis(20);
/// A SubDevice in INIT is brought to PREOP before.
const TO_PREOP: Duration = Duration::from_secs(3);

impl Ecrt {
    /// `ecrt_master_sdo_upload` into a buffer of this size. With an application the usual loop runs meanwhile, as in
    /// another thread.
    ///
    /// # Errors
    /// [`Errno::Inval`], [`Errno::Io`] with the abort code, [`Errno::NoBufs`], [`Errno::TimedOut`].
    pub fn sdo_upload(&mut self, position: u16, index: u16, sub_index: u8, size: usize) -> Result<Vec<u8>, Errno> {
        let data: Vec<u8> = self.waiting(
            "SDO upload",
            |main_device| main_device.subdevice(Position(position)).within(SDO).sdo_read(index, sub_index),
            |application| SubDevice::new(application, Position(position)).within(SDO).sdo_read(index, sub_index),
        )?;
        if data.len() > size { Err(Errno::NoBufs) } else { Ok(data) }
    }

    /// `ecrt_master_sdo_download`.
    ///
    /// # Errors
    /// As [`Ecrt::sdo_upload`].
    pub fn sdo_download(&mut self, position: u16, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Errno> {
        let (first, second) = (data.to_vec(), data.to_vec());
        self.waiting(
            "SDO download",
            |main_device| main_device.subdevice(Position(position)).within(SDO).sdo_write(index, sub_index, first),
            |application| {
                SubDevice::new(application, Position(position)).within(SDO).sdo_write(index, sub_index, second)
            },
        )
    }

    fn waiting<T: 'static>(
        &mut self,
        what: &str,
        idle: impl FnOnce(&mut ringcat::MainDevice<super::links::CallLinks>) -> Result<T, Error>,
        active: impl FnOnce(&mut ringcat::Application<super::links::CallLinks>) -> Pending<Result<T, SubDeviceError>>,
    ) -> Result<T, Errno> {
        self.within(SDO + TO_PREOP + CYCLES, what, |own| match &mut own.side {
            Side::Idle(main_device) => idle(main_device).map_err(Errno::from),
            Side::Active(application) => {
                let mut pending = active(application);
                own.finish(&mut pending)
            }
            Side::Changing => Err(Errno::Inval),
        })
    }

    fn finish<T: 'static>(&mut self, pending: &mut Pending<Result<T, SubDeviceError>>) -> Result<T, Errno> {
        let end = self.now() + SDO + CYCLES / 2;
        loop {
            if let Some(result) = pending.take() {
                return result.map_err(|error| error.failure.into());
            }
            assert!(pending.is_running(), "it has neither ended nor a result");
            assert!(self.now() < end, "it does not keep its limit");
            self.cycle();
        }
    }

    /// `ecrt_slave_config_emerg_size`, and the ring.
    ///
    /// # Errors
    /// [`Errno::Inval`]: active.
    pub fn emerg_size(&mut self, config: SubDeviceId, size: usize) -> Result<EmergencyRing, Errno> {
        let Side::Idle(main_device) = &mut self.side else { return Err(Errno::Inval) };
        Ok(SubDevice::new(&mut **main_device, config).create_emergency_ring(size))
    }

    /// `ecrt_slave_config_emerg_pop`: the error code.
    ///
    /// # Errors
    /// [`Errno::NoEnt`]: empty.
    pub fn emerg_pop(ring: &EmergencyRing) -> Result<u16, Errno> {
        ring.pop().map(|received| received.emergency.error_code).ok_or(Errno::NoEnt)
    }

    /// The emergencies of the SubDevice at a position.
    pub fn emergencies_at(&mut self, position: u16) -> Option<EmergencyRing> {
        match &mut self.side {
            Side::Idle(main_device) => Some(Services::immediately(&mut **main_device, EngineKey, move |engine| {
                engine.emergencies(Position(position))
            })),
            Side::Active(application) => Some(Services::immediately(&mut **application, EngineKey, move |engine| {
                engine.emergencies(Position(position))
            })),
            Side::Changing => None,
        }
    }
}
