//! Checks the use of LRW: never over several SubDevices on two links (protocol 9.2.2, CR-16).

use alloc::vec::Vec;

use ringcat_wire::command::Command;

use super::activate_error::ActivateError;
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::layout::{DomainSpec, Layout, LrwPolicy, Rules};
use crate::link::LinkSet;
use crate::main_device::declaration::ExplicitLrw;

/// The policy together with datagrams of a configuration file.
pub(in crate::main_device) fn policy(
    policy: LrwPolicy,
    named: &[ExplicitLrw],
    links: LinkSet,
) -> Result<LrwPolicy, ActivateError> {
    if links == LinkSet::Single || named.is_empty() {
        return Ok(policy);
    }
    match named.iter().find(|datagram| datagram.subdevices.len() > 1) {
        Some(datagram) => Err(ActivateError::NamedLrwOnTwoLinks(datagram.clone())),
        None => Ok(LrwPolicy::PerSubDevice),
    }
}

/// Refuses LRW over several SubDevices on two links, and names the datagram.
pub(in crate::main_device) fn check_lrw(
    lrw: LrwPolicy,
    specs: &[DomainSpec],
    links: LinkSet,
) -> Result<(), ActivateError> {
    if lrw != LrwPolicy::Explicit || links == LinkSet::Single {
        return Ok(());
    }
    let specs: Vec<DomainSpec> = specs.iter().map(|spec| DomainSpec { lrw: true, ..spec.clone() }).collect();
    let rules =
        Rules { links: LinkSet::Single, supervision: false, lrw, witnesses: &[], session: 0, max_datagrams: None };
    let wanted = Layout::with(&specs, rules).map_err(ActivateError::Layout)?;
    for (domain, planned) in wanted.domains.iter().enumerate() {
        let datagrams = planned.frames.iter().flat_map(|frame| &frame.datagrams);
        if let Some(datagram) = datagrams.clone().find(|datagram| datagram.command == Command::Lrw) {
            return Err(ActivateError::LrwOnTwoLinks {
                domain: DomainId(domain),
                logical: datagram.logical,
                length: usize::from(datagram.outputs) + usize::from(datagram.inputs),
                subdevices: datagram.contributions.iter().map(|(subdevice, _)| SubDeviceId(*subdevice)).collect(),
            });
        }
    }
    Ok(())
}
