//! Expected identity of a SubDevice: EEPROM reads through registers 0x0502 to 0x050B with a compared response, and the
//! identification of hot connect groups (protocol 8.2).

use ringcat_engine::config::Expected;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::map;

use super::messages::contradiction;
use crate::eni::{EcatCommand, Eni, EniError, Place, Target, Transition};

/// The value that a command compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ComparedValue {
    /// Two words of the EEPROM from this address.
    Eeprom {
        /// Word address.
        word: u32,
        /// Expected value.
        value: u32,
    },
    /// One word of the EEPROM.
    EepromWord {
        /// Its address.
        word: u32,
        /// Expected value.
        value: u16,
    },
    /// The alias, read from its register.
    Alias(u16),
    /// The identification in AL status code (protocol 5.3).
    Identification(u16),
    /// The identification in a word of the SubDevice's memory (protocol 4.3).
    DataWord {
        /// Physical address.
        register: RegisterAddress,
        /// Expected value.
        value: u16,
    },
}

/// Memory in which a SubDevice may have its identification: digital inputs, user RAM, process RAM (protocol 3.13).
const MEMORY: std::ops::RangeInclusive<u16> = 0x0F00..=0xFFFE;

const WORD_ALIAS: u32 = 0x0004;
const WORD_VENDOR: u32 = 0x0008;
const WORD_PRODUCT: u32 = 0x000A;
const WORD_REVISION: u32 = 0x000C;
const WORD_SERIAL: u32 = 0x000E;
/// Words of a revision, as masks of it.
pub(crate) const LOW_WORD: u32 = 0x0000_FFFF;
pub(crate) const HIGH_WORD: u32 = 0xFFFF_0000;

/// The values that commands compare, in order, and whether all bits are compared.
pub(super) fn compared_values(commands: &[EcatCommand]) -> Vec<(ComparedValue, bool, Place)> {
    let mut word = None;
    let mut found = Vec::new();
    for command in commands {
        let Target::Register { ado, .. } = command.datagram.target else { continue };
        let data = &command.datagram.data;
        if command.datagram.command.writes() {
            let address = match ado {
                map::SII_CONTROL => data.get(2..6),
                map::SII_ADDRESS => data.get(0..4),
                _ => None,
            };
            word = address.and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes).or(word);
        }
        let Some(validate) = &command.validate else { continue };
        let whole = validate.mask.as_ref().is_none_or(|mask| mask.iter().all(|byte| *byte == 0xFF));
        let first_word = validate.data.first_chunk().map(|bytes| u16::from_le_bytes(*bytes));
        match ado {
            map::SII_DATA => {
                let (pairs, rest) = validate.data.as_chunks();
                for (number, value) in (0_u32..).zip(pairs) {
                    let word = word.unwrap_or_default().wrapping_add(2 * number);
                    found.push((
                        ComparedValue::Eeprom { word, value: u32::from_le_bytes(*value) },
                        whole,
                        command.place,
                    ));
                }
                if let [low, high, ..] = rest {
                    let word = word.unwrap_or_default().wrapping_add(2 * pairs.len() as u32);
                    let compared = ComparedValue::EepromWord { word, value: u16::from_le_bytes([*low, *high]) };
                    found.push((compared, whole, command.place));
                }
            }
            map::STATION_ALIAS => {
                found.extend(first_word.map(|alias| (ComparedValue::Alias(alias), whole, command.place)))
            }
            map::AL_STATUS_CODE => {
                found.extend(first_word.map(|id| (ComparedValue::Identification(id), whole, command.place)));
            }
            word if MEMORY.contains(&word.0) && validate.data.len() == 2 => {
                found.extend(
                    first_word.map(|value| (ComparedValue::DataWord { register: word, value }, whole, command.place)),
                );
            }
            _ => {}
        }
    }
    found
}

/// The expected identity: exactly the values that the commands compare. A file without commands expects vendor and
/// product of `Info`.
pub(super) fn expected(eni: &Eni, index: usize, complete: bool) -> Result<Expected, EniError> {
    let subdevice = &eni.subdevices[index];
    let mut expected = Expected::default();
    if !complete {
        expected.vendor_id = subdevice.vendor_id.filter(|id| *id != 0);
        expected.product_code = subdevice.product_code.filter(|code| *code != 0);
        return Ok(expected);
    }
    let mut revision = (0_u32, 0_u32);
    let identify = subdevice.hot_connect.iter().flat_map(|group| compared_values(&group.identify));
    for (compared, whole, place) in compared_values(&subdevice.init_commands).into_iter().chain(identify) {
        if let Some((mask, value)) = part_of_revision(&compared).filter(|_| whole) {
            revision = (revision.0 & !mask | value, revision.1 | mask);
            continue;
        }
        let ComparedValue::Eeprom { word, value } = compared else { continue };
        let (field, what, said) = match word {
            WORD_VENDOR => (&mut expected.vendor_id, "the compared vendor id", subdevice.vendor_id),
            WORD_PRODUCT => (&mut expected.product_code, "the compared product code", subdevice.product_code),
            WORD_SERIAL => (&mut expected.serial, "the compared serial number", None),
            _ => continue,
        };
        if !whole {
            continue;
        }
        if let Some(said) = said.filter(|said| *said != value) {
            let hint = "Info and the command that compares must agree: export the file again";
            return Err(contradiction(eni, index, place, what, format!("{said:#x}"), format!("{value:#x}"), hint));
        }
        *field = Some(value);
    }
    if let (value, mask @ 1..) = revision {
        // A word that is not compared is the one of Info, which describes the device.
        expected.revision = Some(subdevice.revision.unwrap_or_default() & !mask | value);
        expected.revision_mask = mask;
    }
    Ok(expected)
}

/// The bits of a revision that are compared, and their value: the whole one or a word of it (protocol ES-121).
fn part_of_revision(compared: &ComparedValue) -> Option<(u32, u32)> {
    match *compared {
        ComparedValue::Eeprom { word: WORD_REVISION, value } => Some((u32::MAX, value)),
        ComparedValue::EepromWord { word: WORD_REVISION, value } => Some((LOW_WORD, value.into())),
        ComparedValue::EepromWord { word, value } if word == WORD_REVISION + 1 => {
            Some((HIGH_WORD, u32::from(value) << 16))
        }
        _ => None,
    }
}

/// Whether a command compares an EEPROM value that is not in [`expected`]: another word, a part of a word. Such
/// commands are sent unchanged.
pub(super) fn is_sent(command: &EcatCommand, address: Option<&EcatCommand>) -> bool {
    let Target::Register { ado, .. } = command.datagram.target else { return false };
    let pair: Vec<EcatCommand> = address.into_iter().chain([command]).cloned().collect();
    let is_whole = |(compared, whole, _): &(ComparedValue, bool, Place)| {
        let known = [WORD_VENDOR, WORD_PRODUCT, WORD_SERIAL];
        let is_number = matches!(compared, ComparedValue::Eeprom { word, .. } if known.contains(word));
        *whole && (is_number || part_of_revision(compared).is_some())
    };
    let Some(validate) = command.validate.as_ref().filter(|_| ado == map::SII_DATA) else { return false };
    validate.data.len() % 2 == 1 || !compared_values(&pair).iter().all(is_whole)
}

/// Whether a command sets the EEPROM address of the next read.
pub(super) fn is_eeprom_address(command: &EcatCommand) -> bool {
    let Target::Register { ado, .. } = command.datagram.target else { return false };
    (ado == map::SII_CONTROL || ado == map::SII_ADDRESS) && command.datagram.command.writes()
}

/// The first two different aliases, identifications or data words that the commands of a group compare; an alias may be
/// read from the EEPROM or from its register.
pub(super) fn compared_values_of_group(commands: &[EcatCommand]) -> Vec<(ComparedValue, Place)> {
    let mut found: Vec<(ComparedValue, Place)> = Vec::new();
    for (compared, whole, place) in compared_values(commands) {
        let compared = match compared {
            ComparedValue::Eeprom { word: WORD_ALIAS, value } => ComparedValue::Alias(value as u16),
            ComparedValue::EepromWord { word: WORD_ALIAS, value } if whole => ComparedValue::Alias(value),
            ComparedValue::Eeprom { .. } | ComparedValue::EepromWord { .. } => continue,
            ComparedValue::Alias(_) | ComparedValue::Identification(_) | ComparedValue::DataWord { .. } if whole => {
                compared
            }
            ComparedValue::Alias(_) | ComparedValue::Identification(_) | ComparedValue::DataWord { .. } => continue,
        };
        if compared != ComparedValue::Alias(0) && found.iter().all(|(known, _)| *known != compared) {
            found.push((compared, place));
        }
        if found.len() == 2 {
            break;
        }
    }
    found
}

/// Whether the PDI keeps the EEPROM in PREOP: assigned to the PDI at IP and not taken back.
pub(super) fn keeps_eeprom(commands: &[EcatCommand]) -> bool {
    let up = commands.iter().filter(|command| command.transitions.contains(&Transition::Ip));
    let mut given = up.filter_map(|command| match command.datagram.target {
        Target::Register { ado, .. } if ado == map::SII_CONFIGURATION && command.datagram.command.writes() => {
            command.datagram.data.first().map(|byte| byte & 1 != 0)
        }
        Target::Register { .. } | Target::Logical(_) => None,
    });
    given.next_back().unwrap_or(false)
}
