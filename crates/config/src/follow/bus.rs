//! Positions of the SubDevices, hot connect groups and upstream connections.

use std::collections::{HashMap, HashSet};

use ringcat_engine::config::ConfigAddress;
use ringcat_wire::address::Position;

use super::messages::{contradiction, label};
use super::notices::Notices;
use super::whole_bus::WholeBus;
use crate::eni::{Eni, EniError, Poll, Port};

/// Positions and connections of the SubDevices.
pub(super) struct Bus {
    /// Address of each SubDevice; the addresses of group members are set later.
    pub addresses: Vec<ConfigAddress>,
    /// Group index of each SubDevice.
    pub groups: Vec<Option<usize>>,
    /// Upstream connection of each SubDevice.
    pub plugged_into: Vec<Option<(usize, Port)>>,
    /// Whether the file reverses `Ccs`: 2 downloads.
    pub ccs_is_reversed: bool,
    /// Commands to the whole bus.
    pub commands: WholeBus,
}

impl Bus {
    pub fn of(eni: &Eni, notices: &mut Notices) -> Result<Bus, EniError> {
        let groups = members(eni)?;
        let stations = stations(eni)?;
        let bus = Bus {
            addresses: positions(eni, &groups, notices)?,
            plugged_into: plugged_into(eni, &stations)?,
            groups,
            ccs_is_reversed: ccs_is_reversed(eni),
            commands: WholeBus::of(eni, &stations, notices)?,
        };
        of_mailboxes(eni, notices);
        if eni.main_device.eoe {
            let reason = "RingCAT bridges Ethernet with the option --eoe of the program, not from the file";
            notices.add(None, None, "Master/EoE", reason);
        }
        Ok(bus)
    }
}

/// Group index of each SubDevice: a head and the SubDevices that follow it in document order.
fn members(eni: &Eni) -> Result<Vec<Option<usize>>, EniError> {
    let mut groups = vec![None; eni.subdevices.len()];
    let mut number = 0;
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(group) = &subdevice.hot_connect else { continue };
        let end = index + usize::from(group.members);
        let Some(members) = groups.get_mut(index..end) else {
            let what = "members of the hot connect group";
            let there = (eni.subdevices.len() - index).to_string();
            let hint = "the members follow the head";
            return Err(contradiction(eni, index, group.place, what, group.members.to_string(), there, hint));
        };
        if members.iter().any(Option::is_some) {
            let what = "the hot connect group";
            let got = "another group has it as a member";
            return Err(contradiction(eni, index, group.place, what, "the head of one group only", got, ""));
        }
        members.fill(Some(number));
        number += 1;
    }
    Ok(groups)
}

/// SubDevices by `PhysAddr`, which must be unique; 0 means unset.
fn stations(eni: &Eni) -> Result<HashMap<u16, usize>, EniError> {
    let mut stations = HashMap::new();
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(station) = subdevice.station.filter(|station| *station != 0) else { continue };
        if let Some(other) = stations.insert(station, index) {
            let (expected, got) = ("a unique number", format!("{station}, which {} also has", label(eni, other)));
            return Err(contradiction(eni, index, subdevice.place, "PhysAddr", expected, got, ""));
        }
    }
    Ok(stations)
}

/// Positions by `AutoIncAddr`; if these are missing or all equal, by document order. Members of groups have no
/// position.
fn positions(eni: &Eni, groups: &[Option<usize>], notices: &mut Notices) -> Result<Vec<ConfigAddress>, EniError> {
    let count = eni.subdevices.len();
    let fixed: Vec<usize> = (0..count).filter(|index| groups[*index].is_none()).collect();
    let said: Vec<Option<u16>> = fixed.iter().map(|index| eni.subdevices[*index].auto_increment).collect();
    let different: HashSet<u16> = said.iter().flatten().copied().collect();
    let mut addresses = vec![ConfigAddress::Position(0); count];
    let in_document_order = said.iter().any(Option::is_none) || (different.len() <= 1 && fixed.len() > 1);
    if in_document_order {
        if fixed.len() > 1 {
            let reason = "missing, or the same for all: positions follow the order of the file";
            notices.add(None, None, "AutoIncAddr", reason);
        }
        for (position, index) in (0..).zip(&fixed) {
            addresses[*index] = ConfigAddress::Position(position);
        }
        return Ok(addresses);
    }
    let mut positions: Vec<(u16, usize)> =
        said.iter().flatten().zip(&fixed).map(|(said, index)| (Position(*said).auto_increment(), *index)).collect();
    positions.sort_unstable();
    for (rank, pair) in (0_u16..).zip(&positions) {
        let (position, index) = *pair;
        if rank > 0 && positions[usize::from(rank) - 1].0 == position {
            let other = label(eni, positions[usize::from(rank) - 1].1);
            let place = eni.subdevices[index].place;
            let got = format!("position {position}, which {other} also has");
            return Err(contradiction(eni, index, place, "AutoIncAddr", "a unique position", got, ""));
        }
        // With groups the engine counts only SubDevices without a group.
        let counted = if positions.len() == count { position } else { rank };
        addresses[index] = ConfigAddress::Position(counted);
    }
    Ok(addresses)
}

/// The upstream connection from `PreviousPort`: the selected one, or the only one. Its SubDevice must exist, and
/// connections must not form a loop.
fn plugged_into(eni: &Eni, stations: &HashMap<u16, usize>) -> Result<Vec<Option<(usize, Port)>>, EniError> {
    let mut plugged_into = vec![None; eni.subdevices.len()];
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let selected = subdevice.previous_ports.iter().find(|port| port.selected);
        let Some(port) = selected.or(subdevice.previous_ports.first()) else { continue };
        let Some(station) = port.station else { continue };
        let Some(previous) = stations.get(&station) else {
            let expected = "the PhysAddr of a SubDevice of the file";
            return Err(contradiction(eni, index, port.place, "PreviousPort", expected, station.to_string(), ""));
        };
        plugged_into[index] = Some((*previous, port.port));
    }
    // Each chain is followed to a SubDevice that is known to be connected to the first one.
    let mut reaches_first = vec![false; eni.subdevices.len()];
    for start in 0..plugged_into.len() {
        let mut way = Vec::new();
        let mut on_way = HashSet::new();
        let mut at = Some(start);
        while let Some(index) = at.filter(|index| !reaches_first[*index]) {
            if !on_way.insert(index) {
                let place =
                    eni.subdevices[index].previous_ports.first().map_or(eni.subdevices[index].place, |p| p.place);
                let got = "a loop";
                return Err(contradiction(eni, index, place, "PreviousPort", "a path to the first SubDevice", got, ""));
            }
            way.push(index);
            at = plugged_into[index].map(|(previous, _)| previous);
        }
        way.into_iter().for_each(|index| reaches_first[index] = true);
    }
    Ok(plugged_into)
}

/// Protocol 8.2: 1 downloads. If all CoE commands of a file have data and the value 2, the file reverses it: a
/// configuration of reads only makes no sense.
fn ccs_is_reversed(eni: &Eni) -> bool {
    let mut commands = eni.subdevices.iter().flat_map(|subdevice| &subdevice.mailbox).flat_map(|mailbox| &mailbox.coe);
    let is_there = commands.clone().next().is_some();
    is_there && commands.all(|command| command.ccs == 2 && !command.data.is_empty())
}

/// Detection of full mailboxes.
fn of_mailboxes(eni: &Eni, notices: &mut Notices) {
    if let Some(states) = &eni.main_device.mailbox_states {
        let reason =
            "RingCAT detects mail in its own way: by a logical read if the SII offers it, otherwise by polling";
        notices.add(Some(states.place), None, "MailboxStates", reason);
    }
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(mailbox) = &subdevice.mailbox else { continue };
        if let (Some(Poll::Every(_)), Some(receive)) = (mailbox.poll, mailbox.receive) {
            let reason = "RingCAT determines the polling interval of mailboxes";
            notices.add(Some(receive.place), Some(index), "Mailbox/Recv/PollTime", reason);
        }
    }
}
