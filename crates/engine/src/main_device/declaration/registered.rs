//! Domains of registered process data at activation: the areas with their places, compared with the plans.

use super::areas::Areas;
use super::registered_area::RegisteredArea;
use crate::domain::DomainId;
use crate::layout::{AreaSpec, DomainSpec, FixedImage, ImageOrder};
use crate::main_device::activate::activate_error::ActivateError;

/// Fills in the areas of a domain. The places of SubDevices that exchange no process data in their target state stay
/// in the image, and no frame holds them.
pub(in crate::main_device) fn fill(
    spec: &mut DomainSpec,
    domain: DomainId,
    registered: &[RegisteredArea],
    plans: &[Areas],
    is_lrw_asked_for: bool,
) -> Result<(), ActivateError> {
    let mut image = FixedImage::default();
    for area in registered {
        let RegisteredArea { subdevice, sync_manager, direction, start, length } = *area;
        let Some(areas) = plans.get(subdevice.0) else {
            return Err(ActivateError::UnknownMember { domain, subdevice });
        };
        if is_lrw_asked_for && !areas.lrw() {
            return Err(ActivateError::LrwUnknown { domain, subdevice });
        }
        image.bytes = image.bytes.max(start + u32::from(length));
        if matches!(areas, Areas::Planned(None)) {
            continue;
        }
        let listed = areas.list().into_iter().find(|(number, ..)| *number == sync_manager);
        let got = listed.map(|(_, direction, length)| (direction, length));
        let is_open = matches!(areas, Areas::Declared(_)) && (got.is_none() || areas.unfit().is_some());
        if !is_open && got != Some((direction, length)) {
            let expected = (direction, length);
            return Err(ActivateError::Registered { domain, subdevice, sync_manager, expected, got });
        }
        spec.lrw &= areas.lrw();
        spec.areas.push(AreaSpec { subdevice: subdevice.0, sync_manager, direction, length });
        image.starts.push(start);
    }
    spec.image = ImageOrder::Fixed(image);
    Ok(())
}
