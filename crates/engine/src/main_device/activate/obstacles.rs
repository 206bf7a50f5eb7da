//! What an activation would refuse, for comparisons of a declaration with a scan that do not activate it. The checks
//! are those of the activation ([`super::prepare`], [`super::lay_out`]). All checks are made here; an activation ends
//! at the first that fails.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::Position;

use super::activate_error::ActivateError;
use super::lay_out::{LaidOut, lay_out};
use super::prepare::{check, check_domains, no_clock, plan_all, with_domain};
use crate::config::{ReferenceClock, Resolution, resolve};
use crate::declared::SubDeviceId;
use crate::info::SubDeviceInfo;
use crate::junction::{JunctionConnection, JunctionMode};
use crate::layout::Rules;
use crate::link::LinkSet;
use crate::main_device::declaration::Declaration;
use crate::main_device::declaration::loaded::{check_connections, closing};
use crate::segment::setup::Setup;

/// Everything with which [`MainDevice::activate`](super::super::MainDevice::activate) would refuse a declaration on the
/// SubDevices of a scan, and SYNC signals that only prevent OP of their own SubDevice. Not contained are missing
/// SubDevices and SubDevices of another type ([`resolve`]), process data that a SubDevice cannot have
/// ([`plan`](crate::plan)), closing cables that are not there, which only a test on the bus shows
/// ([`MainDevice::start_connection_check`](super::super::MainDevice::start_connection_check)), and what depends on the
/// options of a MainDevice: memory for images, fewer datagrams per frame, the refusals beside a standby.
pub fn obstacles(
    declaration: &Declaration,
    (mode, connections): (JunctionMode, &[JunctionConnection]),
    found: &[SubDeviceInfo],
    links: LinkSet,
) -> Vec<ActivateError> {
    let found = by_declaration(declaration, found);
    let mut obstacles: Vec<ActivateError> = check(declaration).err().into_iter().collect();
    for (at, connection) in connections.iter().enumerate() {
        let checked = connection.check(&connections[..at], declaration.subdevices.len());
        let error = checked.err().or_else(|| closing(connection, &found).err());
        obstacles.extend(error.map(ActivateError::Junction));
    }
    obstacles.extend(check_connections(mode, connections).err());
    obstacles.extend((0..found.len()).filter_map(|subdevice| no_clock(declaration, &found, subdevice)));
    let Ok(plans) = plan_all(declaration, &found) else { return obstacles };
    obstacles.extend(check_domains(declaration, &plans).err());
    let rules =
        Rules { links, supervision: true, lrw: declaration.lrw, witnesses: &[], session: 0, max_datagrams: None };
    match lay_out(&with_domain(declaration.clone()), &plans, &found, rules) {
        Err(error) => obstacles.push(error),
        Ok(LaidOut { layout, .. }) => {
            for (index, (config, info)) in declaration.subdevices.iter().zip(&found).enumerate() {
                let Some(info) = info.as_ref().filter(|_| plans[index].unfit().is_none()) else { continue };
                let subdevice = SubDeviceId(index);
                let error = Setup::new(index, config, info, &layout).err();
                obstacles.extend(error.map(|error| ActivateError::Setup { subdevice, error }));
            }
        }
    }
    obstacles
}

/// A SubDevice that is declared as the reference clock but has no clock, and the position of the clock that is used
/// instead.
pub fn replaced_reference(
    declaration: &Declaration,
    found: &[SubDeviceInfo],
) -> Option<(SubDeviceId, Option<Position>)> {
    let of_declaration = by_declaration(declaration, found);
    replaced(declaration, &of_declaration, found.iter())
}

/// As [`replaced_reference`], with the SubDevices by declaration.
pub(in crate::main_device) fn replaced<'a>(
    declaration: &Declaration,
    of_declaration: &[Option<Rc<SubDeviceInfo>>],
    mut found: impl Iterator<Item = &'a SubDeviceInfo>,
) -> Option<(SubDeviceId, Option<Position>)> {
    let ReferenceClock::Declared(subdevice) = declaration.clocks.as_ref()?.reference else { return None };
    let has_none = !of_declaration.get(subdevice.0)?.as_ref()?.controller.features.dc;
    let first = found.find(|info| info.controller.features.dc).map(|info| info.position);
    has_none.then_some((subdevice, first))
}

fn by_declaration(declaration: &Declaration, found: &[SubDeviceInfo]) -> Vec<Option<Rc<SubDeviceInfo>>> {
    let mut of_declaration = vec![None; declaration.subdevices.len()];
    for resolution in resolve(&declaration.subdevices, found) {
        if let Resolution::Found { config, info } = resolution {
            of_declaration[config] = Some(Rc::new(found[info].clone()));
        }
    }
    of_declaration
}
