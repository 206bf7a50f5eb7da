//! Areas of process data: in a domain's image, in the device, in the logical address space.

use std::ops::Range;

use ringcat::{Direction, DomainId, SubDeviceId};
use ringcat_engine::main_device::Directory;
use ringcat_sim::cable::DeviceIndex;

/// Process data of a SubDevice in one SyncManager.
#[derive(Debug)]
pub struct Area {
    /// Index in the declaration.
    pub subdevice: usize,
    /// The simulated device.
    pub device: DeviceIndex,
    /// The domain.
    pub domain: DomainId,
    /// Its SyncManager.
    pub sync_manager: u8,
    /// Outputs or inputs.
    pub direction: Direction,
    /// Bytes of the domain's image.
    pub in_image: Range<usize>,
    /// Bytes of the device's outputs or inputs.
    pub in_device: Range<usize>,
    /// Logical address of the first byte.
    pub logical: u32,
}

/// The areas of a SubDevice, in the order of its SyncManagers.
pub fn areas_of(directory: &Directory, subdevice: usize, device: DeviceIndex) -> impl Iterator<Item = Area> {
    let (mut outputs, mut inputs) = (0, 0);
    directory.areas(SubDeviceId(subdevice)).iter().map(move |entries| {
        let start = entries.placed.image_offset as usize;
        let length = usize::from(entries.placed.area.length);
        let at = match entries.direction {
            Direction::Outputs => &mut outputs,
            Direction::Inputs => &mut inputs,
        };
        let in_device = *at..*at + length;
        *at += length;
        Area {
            subdevice,
            device,
            domain: entries.domain,
            sync_manager: entries.placed.area.sync_manager,
            direction: entries.direction,
            in_image: start..start + length,
            in_device,
            logical: entries.placed.logical.0,
        }
    })
}
