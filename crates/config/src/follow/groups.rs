//! Hot connect groups: the head is identified by alias or identification, its members follow it (protocol 8.2).

use ringcat_engine::config::{ConfigAddress, SubDeviceConfig};
use ringcat_engine::main_device::GroupId;

use super::bus::Bus;
use super::identity::{Mark, group_mark};
use super::messages::contradiction;
use crate::eni::{Eni, EniError};

/// Declares the groups in `configs`; returns their names.
pub(super) fn follow(eni: &Eni, bus: &Bus, configs: &mut [SubDeviceConfig]) -> Result<Vec<String>, EniError> {
    let mut names = Vec::new();
    for (index, subdevice) in eni.subdevices.iter().enumerate() {
        let Some(group) = &subdevice.hot_connect else { continue };
        let mark = group_mark(&group.identify);
        let address = |offset| match mark {
            Some(Mark::Alias(alias)) if alias != 0 => Ok(ConfigAddress::Alias { alias, offset }),
            Some(Mark::DataWord { register, value }) => Ok(ConfigAddress::DataWord { register, value, offset }),
            Some(Mark::Identification(value)) => Ok(ConfigAddress::Identification { value, offset }),
            Some(Mark::Alias(_) | Mark::Eeprom { .. } | Mark::EepromWord { .. }) | None => {
                let what = format!("identification of the hot connect group {}", crate::eni::quoted(&group.name));
                let expected = "an IdentifyCmd that compares the alias (register 0x0012 or EEPROM word 4), the \
                                identification (register 0x0134) or a whole data word (from 0x0F00)";
                let got = format!("{} commands, none of that kind", group.identify.len());
                let hint = "RingCAT does not support other kinds of identification";
                Err(contradiction(eni, index, group.place, what, expected, got, hint))
            }
        };
        let number = names.len();
        for (offset, member) in (0..group.members).zip(index..) {
            debug_assert_eq!(bus.groups[member], Some(number));
            let config = &mut configs[member];
            config.address = address(offset)?;
            config.optional = true;
            config.group = Some(GroupId(number));
        }
        names.push(group.name.clone());
    }
    Ok(names)
}
