//! Expected place of a SubDevice.

use core::fmt;

use ringcat_wire::address::RegisterAddress;

use crate::info::SubDeviceInfo;

/// Expected place of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ConfigAddress {
    /// Position in the configured order, from 0. If an optional SubDevice is absent, the following ones are expected
    /// one position nearer to the start of the segment. Members of [groups](super::Group) are not counted.
    Position(u16),
    /// `offset` SubDevices behind the one with this alias. Alias 0 is the exact position in the segment, as with IgH:
    /// it counts every SubDevice, and neither an absent SubDevice nor a group moves it.
    Alias {
        /// The alias, or 0.
        alias: u16,
        /// Number of SubDevices behind it, or the position.
        offset: u16,
    },
    /// `offset` SubDevices behind the one with this explicit device identification (protocol 5.3).
    Identification {
        /// The identification.
        value: u16,
        /// Number of SubDevices behind it.
        offset: u16,
    },
    /// `offset` SubDevices behind the one with this value in a word of its memory. The SII need not name the word
    /// (protocol 4.3). The word is read between the scan and the activation (`MainDevice::start_loaded_data_words`).
    DataWord {
        /// Physical address of the word.
        register: RegisterAddress,
        /// Value of the word.
        value: u16,
        /// Number of SubDevices behind it.
        offset: u16,
    },
}

impl ConfigAddress {
    /// Number of SubDevices behind the one with the alias, identification or data word; 0 for a position.
    pub fn offset(self) -> usize {
        match self {
            ConfigAddress::Alias { offset, .. }
            | ConfigAddress::Identification { offset, .. }
            | ConfigAddress::DataWord { offset, .. } => offset.into(),
            ConfigAddress::Position(_) => 0,
        }
    }

    /// Address of the data word from which the address counts.
    pub const fn data_word(self) -> Option<RegisterAddress> {
        match self {
            ConfigAddress::DataWord { register, .. } => Some(register),
            ConfigAddress::Position(_) | ConfigAddress::Alias { .. } | ConfigAddress::Identification { .. } => None,
        }
    }

    /// The address this number of places further behind.
    pub fn behind(self, places: u16) -> ConfigAddress {
        match self {
            ConfigAddress::Alias { alias, .. } => ConfigAddress::Alias { alias, offset: places },
            ConfigAddress::Identification { value, .. } => ConfigAddress::Identification { value, offset: places },
            ConfigAddress::DataWord { register, value, .. } => {
                ConfigAddress::DataWord { register, value, offset: places }
            }
            ConfigAddress::Position(position) => ConfigAddress::Position(position.saturating_add(places)),
        }
    }

    /// Whether a SubDevice has the alias or identification from which the address counts.
    pub(crate) fn is_mark_of(self, info: &SubDeviceInfo) -> bool {
        match self {
            ConfigAddress::Alias { alias, .. } => alias != 0 && alias == info.alias,
            ConfigAddress::Identification { value, .. } => info.identification == Some(value),
            ConfigAddress::DataWord { register, value, .. } => info.data_word(register) == Some(value),
            ConfigAddress::Position(_) => false,
        }
    }

    /// The alias, identification or data word from which the address counts, or the position, for messages.
    pub fn mark(self) -> impl fmt::Display {
        struct Mark(ConfigAddress);
        impl fmt::Display for Mark {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match self.0 {
                    ConfigAddress::Alias { alias, .. } => write!(f, "alias {alias}"),
                    ConfigAddress::Identification { value, .. } => write!(f, "identification {value}"),
                    ConfigAddress::DataWord { register, value, .. } => {
                        write!(f, "data word {value} at {register}")
                    }
                    ConfigAddress::Position(position) => write!(f, "position {position}"),
                }
            }
        }
        Mark(self)
    }
}

impl fmt::Display for ConfigAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigAddress::Position(_) => self.mark().fmt(f),
            ConfigAddress::Alias { offset, .. }
            | ConfigAddress::Identification { offset, .. }
            | ConfigAddress::DataWord { offset, .. } => {
                write!(f, "{} offset {offset}", self.mark())
            }
        }
    }
}
