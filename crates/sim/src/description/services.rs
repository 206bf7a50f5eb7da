//! Services behind the mailbox of a device, besides its objects (protocol 6.4 to 6.8). The SII says which protocols
//! exist.

use core::net::Ipv4Addr;
use core::time::Duration;

use ringcat_wire::mailbox::soe::Idn;

use crate::application::soe::idn::IdnObject;

/// Settings of the protocol servers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Services {
    /// Files.
    pub foe: FoeDescription,
    /// Ethernet.
    pub eoe: EoeDescription,
    /// Drives.
    pub soe: SoeDescription,
    /// ADS.
    pub aoe: AoeDescription,
}

/// Files of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoeDescription {
    /// Files that it is delivered with.
    pub files: Vec<(String, Vec<u8>)>,
    /// Password that each transfer needs; 0 for none.
    pub password: u32,
    /// Bytes for all files together.
    pub capacity: usize,
    /// Name of the firmware, which is written in BOOT alone and is the only file there.
    pub firmware: Option<String>,
    /// Time that erasing the old firmware takes; until then the sender hears BUSY.
    pub erase_time: Duration,
}

impl Default for FoeDescription {
    fn default() -> Self {
        FoeDescription {
            files: Vec::new(),
            password: 0,
            capacity: 4 << 20,
            firmware: Some("firmware.bin".into()),
            erase_time: Duration::from_millis(20),
        }
    }
}

/// Receiver of Ethernet frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EoeEnd {
    /// An IP stack: answers ARP and ping, serves TCP.
    Stack,
    /// Each frame comes back as it is.
    Loop,
    /// Frames disappear.
    Nothing,
}

/// Ethernet of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EoeDescription {
    /// The receiver.
    pub end: EoeEnd,
    /// MAC address until another one is set.
    pub mac: [u8; 6],
    /// IP address until another one is set.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask until another one is set.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway until another one is set.
    pub gateway: Option<Ipv4Addr>,
    /// Addresses can be set and asked for.
    pub ip_support: bool,
    /// The address filter can be set and asked for.
    pub filter_support: bool,
}

impl Default for EoeDescription {
    fn default() -> Self {
        EoeDescription {
            end: EoeEnd::Stack,
            mac: [0x02, 0x0C, 0x47, 0, 0, 1],
            address: None,
            mask: None,
            gateway: None,
            ip_support: true,
            filter_support: true,
        }
    }
}

/// Drives of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoeDescription {
    /// IDNs of each drive; the lists of all IDNs and of all commands are added.
    pub drives: Vec<Vec<IdnObject>>,
}

impl Default for SoeDescription {
    fn default() -> Self {
        SoeDescription { drives: vec![vec![IdnObject::number(Idn::standard(0, 11), "Class 1 diagnostic", 2, 0)]] }
    }
}

/// ADS of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AoeDescription {
    /// Ports that answer.
    pub ports: Vec<u16>,
}

impl Default for AoeDescription {
    fn default() -> Self {
        AoeDescription { ports: vec![1000, 1001] }
    }
}
