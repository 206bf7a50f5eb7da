//! FMMUs for process data: one for each place of an area in a domain.

use alloc::vec::Vec;

use ringcat_wire::register::Fmmu;

use super::error::SetupError;
use crate::info::SubDeviceInfo;
use crate::layout::{Layout, PlacedArea};
use crate::plan::{self, SubDevicePlan};

/// The FMMUs of all places, and how many there are for process data. The first place of an area has the FMMU of its
/// number among the areas; further ones follow behind those of all areas.
pub fn fmmus(
    index: usize,
    plan: &SubDevicePlan,
    info: &SubDeviceInfo,
    layout: &Layout,
) -> Result<(Vec<(u8, Fmmu)>, usize), SetupError> {
    let places: Vec<PlacedArea> = layout.areas_of(index).map(|(_, placed)| placed).collect();
    let has = |placed: &PlacedArea| plan.mapped_areas().any(|(_, area)| area.sync_manager == placed.area.sync_manager);
    if let Some(placed) = places.iter().find(|placed| !has(placed)) {
        let (sync_manager, expected) = (placed.area.sync_manager, placed.area.length);
        return Err(SetupError::Area { sync_manager, expected, got: 0 });
    }
    let mut fmmus = Vec::new();
    let mut next = plan.mapped_areas().count();
    for (number, area) in plan.mapped_areas() {
        let of_area = places.iter().filter(|placed| placed.area.sync_manager == area.sync_manager);
        let mut own = Some(usize::from(number));
        for placed in of_area {
            if placed.area.length != area.length || placed.area.direction != area.direction {
                let (expected, got) = (placed.area.length, area.length);
                return Err(SetupError::Area { sync_manager: area.sync_manager, expected, got });
            }
            let number = own.take().unwrap_or(next);
            next = next.max(number + 1);
            fmmus.push((number, plan::fmmu(area, placed.logical)));
        }
    }
    let available = info.controller.fmmu_count;
    if next > usize::from(available) {
        return Err(SetupError::TooManyPlaces { needed: next, available });
    }
    let numbered = fmmus.into_iter().filter_map(|(number, fmmu)| Some((u8::try_from(number).ok()?, fmmu)));
    Ok((numbered.collect(), next))
}
