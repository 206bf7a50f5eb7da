//! Where the SubDevices are: positions, hot connect groups, what is plugged into what; and the commands for the whole
//! bus.

use std::collections::{HashMap, HashSet};

use ringcat_engine::config::ConfigAddress;
use ringcat_wire::address::Position;
use ringcat_wire::command::Command;

use super::messages::{command_name, contradiction, label, named};
use super::notices::Notices;
use crate::eni::{EcatCommand, Eni, EniError, Poll, Port, Target};

/// Places of the SubDevices.
pub(super) struct Bus {
    /// Where each is expected; those of groups are set later.
    pub addresses: Vec<ConfigAddress>,
    /// Number of its group.
    pub groups: Vec<Option<usize>>,
    /// What each is plugged into.
    pub plugged_into: Vec<Option<(usize, Port)>>,
    /// The file writes `Ccs` the other way round: 2 downloads.
    pub ccs_is_reversed: bool,
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
        };
        for command in &eni.main_device.init_commands {
            of_everybody(command, notices);
        }
        of_mailboxes(eni, notices);
        if eni.main_device.eoe {
            let reason = "bridging Ethernet is not a matter of the file: the program's option --eoe";
            notices.add(None, None, "Master/EoE", reason);
        }
        Ok(bus)
    }
}

/// Numbers of the groups, by SubDevice: a head and those behind it in document order.
fn members(eni: &Eni) -> Result<Vec<Option<usize>>, EniError> {
    let mut groups = vec![None; eni.subdevices.len()];
    let mut number = 0;
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(group) = &subdevice.hot_connect else { continue };
        let end = index + usize::from(group.members);
        let Some(members) = groups.get_mut(index..end) else {
            let what = "members of the hot connect group";
            let there = (eni.subdevices.len() - index).to_string();
            let hint = "the members stand behind the head";
            return Err(contradiction(eni, index, group.place, what, group.members.to_string(), there, hint));
        };
        if members.iter().any(Option::is_some) {
            let what = "the hot connect group";
            let got = "another group has it as a member";
            return Err(contradiction(eni, index, group.place, what, "a head of its own", got, ""));
        }
        members.fill(Some(number));
        number += 1;
    }
    Ok(groups)
}

/// SubDevices by `PhysAddr`, which must differ; 0 says nothing.
fn stations(eni: &Eni) -> Result<HashMap<u16, usize>, EniError> {
    let mut stations = HashMap::new();
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(station) = subdevice.station.filter(|station| *station != 0) else { continue };
        if let Some(other) = stations.insert(station, index) {
            let (expected, got) = ("a number of its own", format!("{station}, which {} has too", label(eni, other)));
            return Err(contradiction(eni, index, subdevice.place, "PhysAddr", expected, got, ""));
        }
    }
    Ok(stations)
}

/// Positions by `AutoIncAddr`; where these are missing, or all the same, by document order. Members of groups have
/// none.
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
            let got = format!("position {position}, where {other} is too");
            return Err(contradiction(eni, index, place, "AutoIncAddr", "a position of its own", got, ""));
        }
        // With groups the engine counts those that belong to none.
        let counted = if positions.len() == count { position } else { rank };
        addresses[index] = ConfigAddress::Position(counted);
    }
    Ok(addresses)
}

/// What `PreviousPort` says: the selected one, or the only one. It must be there, and there must be no circle.
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
    // Each chain is followed until something that is known to end well.
    let mut ends_well = vec![false; eni.subdevices.len()];
    for start in 0..plugged_into.len() {
        let mut way = Vec::new();
        let mut on_way = HashSet::new();
        let mut at = Some(start);
        while let Some(index) = at.filter(|index| !ends_well[*index]) {
            if !on_way.insert(index) {
                let place =
                    eni.subdevices[index].previous_ports.first().map_or(eni.subdevices[index].place, |p| p.place);
                let got = "a circle that leads back to itself";
                return Err(contradiction(eni, index, place, "PreviousPort", "a way to the first SubDevice", got, ""));
            }
            way.push(index);
            at = plugged_into[index].map(|(previous, _)| previous);
        }
        way.into_iter().for_each(|index| ends_well[index] = true);
    }
    Ok(plugged_into)
}

/// Protocol 8.2: 1 downloads. A file whose CoE commands all have data and the value 2 has it reversed: no network is
/// configured by reads only.
fn ccs_is_reversed(eni: &Eni) -> bool {
    let mut commands = eni.subdevices.iter().flat_map(|subdevice| &subdevice.mailbox).flat_map(|mailbox| &mailbox.coe);
    let is_there = commands.clone().next().is_some();
    is_there && commands.all(|command| command.ccs == 2 && !command.data.is_empty())
}

/// A command for the whole bus: RingCAT resets what it uses by itself, and sends none of the file's.
fn of_everybody(command: &EcatCommand, notices: &mut Notices) {
    let zero = command.datagram.data.iter().all(|byte| *byte == 0);
    let ours = match command.datagram.target {
        Target::Logical(_) => false,
        Target::Register { ado, .. } => match ado.0 {
            0x0010..=0x0011 | 0x0120..=0x0135 | 0x0300..=0x0313 | 0x0500..=0x050F => true,
            0x0600..=0x06FF | 0x0800..=0x08FF | 0x0900..=0x09FF => true,
            // The second address is switched off in any case.
            0x0103 => zero,
            _ => command.datagram.command == Command::Nop,
        },
    };
    if !ours {
        let reason = match command.datagram.target {
            Target::Register { ado, .. } if ado.0 == 0x0200 => {
                "not sent: RingCAT does not use the event requests in datagrams".to_owned()
            }
            Target::Register { ado, .. } => {
                format!(
                    "{} to register {ado}: commands to the whole bus are not sent",
                    command_name(command.datagram.command)
                )
            }
            Target::Logical(_) => "logical commands to the whole bus are not sent".to_owned(),
        };
        notices.add(Some(command.place), None, named("Master/InitCmd", &command.comment), reason);
    }
}

/// How it is noticed that mail waits.
fn of_mailboxes(eni: &Eni, notices: &mut Notices) {
    if let Some(states) = &eni.main_device.mailbox_states {
        let reason =
            "RingCAT looks for mail in its own way: a logical read where the SII offers it, otherwise by asking";
        notices.add(Some(states.place), None, "MailboxStates", reason);
    }
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(mailbox) = &subdevice.mailbox else { continue };
        if let (Some(Poll::Every(_)), Some(receive)) = (mailbox.poll, mailbox.receive) {
            let reason = "RingCAT decides by itself how often it looks for mail";
            notices.add(Some(receive.place), Some(index), "Mailbox/Recv/PollTime", reason);
        }
    }
}
