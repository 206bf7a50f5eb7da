//! Hot connect groups: the head is identified by alias, identification or data word, its members follow it
//! (protocol 8.2).

use std::collections::HashMap;

use ringcat_engine::config::{ConfigAddress, SubDeviceConfig};
use ringcat_engine::main_device::{GroupId, Required};

use super::bus::Bus;
use super::identity::{ComparedValue, compared_values_of_group};
use super::messages::{contradiction, label};
use crate::declared_twice::declared_twice;
use crate::eni::{Eni, EniError, HotConnect, Place, quoted};

/// Declares the groups in `configs`; returns their names.
pub(super) fn follow(eni: &Eni, bus: &Bus, configs: &mut [SubDeviceConfig]) -> Result<Vec<String>, EniError> {
    let mut names = Vec::new();
    let mut heads: HashMap<&str, usize> = HashMap::new();
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(group) = &subdevice.hot_connect else { continue };
        let head = head(eni, index, group)?;
        let number = names.len();
        for (offset, member) in (0..group.members).zip(index..) {
            debug_assert_eq!(bus.groups[member], Some(number));
            let config = &mut configs[member];
            config.address = head.behind(offset);
            config.optional = true;
            config.group = Some(GroupId(number));
        }
        if let Some(first) = heads.insert(&group.name, index).filter(|_| !group.name.is_empty()) {
            let got = format!("{}, which the group of {} also has", quoted(&group.name), label(eni, first));
            return Err(contradiction(eni, index, group.place, "GroupName", "a name of its own", got, ""));
        }
        names.push(group.name.clone());
    }
    each_once(eni, configs)?;
    Ok(names)
}

/// The address of the head of a group.
fn head(eni: &Eni, index: usize, group: &HotConnect) -> Result<ConfigAddress, EniError> {
    let compared_values = compared_values_of_group(&group.identify);
    let refused = |place: Place, expected: &str, got: String, hint: &str| {
        let what = format!("identification of the hot connect group {}", quoted(&group.name));
        contradiction(eni, index, place, what, expected, got, hint)
    };
    let addresses: Vec<(ConfigAddress, Place)> =
        compared_values.iter().filter_map(|(compared, place)| Some((address(*compared)?, *place))).collect();
    match addresses[..] {
        [] => {
            let expected = "an IdentifyCmd that compares the alias (register 0x0012 or EEPROM word 4), the \
                            identification (register 0x0134) or a whole data word (from 0x0F00)";
            let got = format!("{} commands, none of that kind", group.identify.len());
            Err(refused(group.place, expected, got, "RingCAT does not support other kinds of identification"))
        }
        [(address, _)] => Ok(address),
        [(first, _), (second, place), ..] => {
            let expected = "one alias, identification or data word that is compared";
            let got = format!("{} and {}", first.mark(), second.mark());
            Err(refused(place, expected, got, "RingCAT finds a group by one of them"))
        }
    }
}

fn address(compared: ComparedValue) -> Option<ConfigAddress> {
    let offset = 0;
    match compared {
        ComparedValue::Alias(alias) => Some(ConfigAddress::Alias { alias, offset }),
        ComparedValue::DataWord { register, value } => Some(ConfigAddress::DataWord { register, value, offset }),
        ComparedValue::Identification(value) => Some(ConfigAddress::Identification { value, offset }),
        ComparedValue::Eeprom { .. } | ComparedValue::EepromWord { .. } => None,
    }
}

/// Two groups with one alias, identification or data word are refused unless their SubDevices exclude each other.
fn each_once(eni: &Eni, configs: &[SubDeviceConfig]) -> Result<(), EniError> {
    let Some((first, second)) = declared_twice(configs, Required::default()) else { return Ok(()) };
    let group = (0..=second).rev().find_map(|index| Some((index, eni.subdevices[index].hot_connect.as_ref()?)));
    let (index, place, name) = match group {
        Some((index, group)) => (index, group.place, group.name.as_str()),
        None => (second, eni.subdevices[second].place, ""),
    };
    let what = format!("identification of the hot connect group {}", quoted(name));
    let got = format!("{}, which {} also has", configs[second].address, label(eni, first));
    Err(contradiction(eni, index, place, what, "one that no other group has", got, ""))
}
