//! Start-up commands.

use std::net::Ipv4Addr;

use serde::Deserialize;

use crate::network::values::{Bytes, Mac, Time};

/// A start-up command. It has one of the keys `sdo`, `upload`, `idn`, `read_idn`, `ip`, `aoe`, `voe`, `write_file`,
/// `read_file`, `write` and `check`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Startup {
    /// The transition; PS if the key is missing.
    #[serde(default)]
    pub at: At,
    /// At PS: it is sent after the PDO assignment and mapping; before them if the key is missing.
    #[serde(default)]
    pub after_pdos: bool,
    /// SDO download.
    pub sdo: Option<Sdo>,
    /// SDO upload.
    pub upload: Option<Upload>,
    /// SoE write.
    pub idn: Option<Idn>,
    /// SoE read.
    pub read_idn: Option<ReadIdn>,
    /// IP parameters (EoE).
    pub ip: Option<Ip>,
    /// AoE: an AMS header with a request.
    pub aoe: Option<Bytes>,
    /// VoE: vendor, type and data of a message.
    pub voe: Option<Bytes>,
    /// Write of a file (FoE).
    pub write_file: Option<WriteFile>,
    /// Read of a file (FoE) of at most 64 KiB.
    pub read_file: Option<ReadFile>,
    /// Register write.
    pub write: Option<Write>,
    /// Register that must have a value.
    pub check: Option<Check>,
    /// Time limit of a mailbox command.
    pub limit: Option<Time>,
    /// Purpose.
    pub comment: Option<String>,
}

/// A transition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "UPPERCASE")]
pub enum At {
    /// INIT to PREOP.
    Ip,
    /// PREOP to SAFEOP.
    #[default]
    Ps,
    /// SAFEOP to OP.
    So,
    /// OP to SAFEOP.
    Os,
    /// SAFEOP to PREOP.
    Sp,
    /// INIT to INIT: at the beginning of a bring-up; registers only.
    Ii,
    /// PREOP to PREOP: PREOP is requested again.
    Pp,
    /// SAFEOP to SAFEOP: SAFEOP is requested again.
    Ss,
    /// PREOP to INIT.
    Pi,
    /// SAFEOP to INIT.
    Si,
    /// OP to INIT.
    Oi,
    /// INIT to BOOT.
    Ib,
    /// BOOT to INIT.
    Bi,
}

/// An SDO download.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Sdo {
    /// Index of the object.
    pub index: u16,
    /// Subindex; with complete access 0 or 1.
    #[serde(default)]
    pub sub: u8,
    /// Complete access.
    #[serde(default)]
    pub complete: bool,
    /// Data, little-endian.
    pub data: Bytes,
}

/// An SDO upload.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Upload {
    /// Index of the object.
    pub index: u16,
    /// Subindex; with complete access 0 or 1.
    #[serde(default)]
    pub sub: u8,
    /// Complete access.
    #[serde(default)]
    pub complete: bool,
    /// Required value; any value if the key is missing.
    pub data: Option<Bytes>,
}

/// A SoE write.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Idn {
    /// Drive of the SubDevice, 0 to 7.
    #[serde(default)]
    pub drive: u8,
    /// The IDN as a number of 16 bits.
    pub idn: u16,
    /// Data, little-endian.
    pub data: Bytes,
}

/// A SoE read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ReadIdn {
    /// Drive of the SubDevice, 0 to 7.
    #[serde(default)]
    pub drive: u8,
    /// The IDN as a number of 16 bits.
    pub idn: u16,
    /// The elements as a bit mask; the value, 0x40, if the key is missing.
    pub elements: Option<u8>,
    /// Required data; any data if the key is missing.
    pub data: Option<Bytes>,
}

/// A write of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WriteFile {
    /// Name of the file in the SubDevice.
    pub name: String,
    /// Password, 0 for none.
    #[serde(default)]
    pub password: u32,
    /// Its contents.
    pub data: Bytes,
}

/// A read of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ReadFile {
    /// Name of the file in the SubDevice.
    pub name: String,
    /// Password, 0 for none.
    #[serde(default)]
    pub password: u32,
}

/// IP parameters behind a SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Ip {
    /// MAC address.
    pub mac: Option<Mac>,
    /// IP address.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway.
    pub gateway: Option<Ipv4Addr>,
    /// DNS server.
    pub dns: Option<Ipv4Addr>,
    /// Name, at most 32 bytes.
    pub name: Option<String>,
}

impl From<ringcat_engine::config::IpSettings> for Ip {
    fn from(settings: ringcat_engine::config::IpSettings) -> Ip {
        Ip {
            mac: settings.mac.map(Mac),
            address: settings.address,
            mask: settings.mask,
            gateway: settings.gateway,
            dns: settings.dns,
            name: settings.name.map(|name| String::from_utf8_lossy(&name).into_owned()),
        }
    }
}

/// A register write.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// Address of the first register.
    pub address: u16,
    /// Data, little-endian.
    pub data: Bytes,
    /// Retries of a write that the SubDevice did not process.
    #[serde(default)]
    pub retries: u16,
    /// The SubDevice must process the write.
    #[serde(default)]
    pub required: bool,
}

/// A register that must have a value.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// Address of the first register.
    pub address: u16,
    /// Required data.
    pub data: Bytes,
    /// Mask of the compared bits, as long as the data; all bits if the key is missing.
    pub mask: Option<Bytes>,
    /// Time until the data must be as required; without it the register is read once.
    pub within: Option<Time>,
    /// Retries of a read that the SubDevice did not process.
    #[serde(default)]
    pub retries: u16,
    /// The SubDevice must process the read.
    #[serde(default)]
    pub required: bool,
}
