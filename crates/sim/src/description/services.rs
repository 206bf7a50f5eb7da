//! Mailbox services of a device, except its objects (protocol 6.4 to 6.8). The SII determines which protocols exist.

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
    /// Files on delivery.
    pub files: Vec<(String, Vec<u8>)>,
    /// Password that each transfer needs; 0 for none.
    pub password: u32,
    /// Maximum number of bytes of all files together.
    pub capacity: usize,
    /// Name of the firmware, which can only be written in BOOT and is the only file there.
    pub firmware: Option<String>,
    /// Time to erase the old firmware; until then the response is BUSY.
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
    /// Each frame is returned unchanged.
    Loop,
    /// Frames are discarded.
    Nothing,
}

/// Ethernet of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EoeDescription {
    /// The receiver.
    pub end: EoeEnd,
    /// MAC address until it is set.
    pub mac: [u8; 6],
    /// IP address until it is set.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask until it is set.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway until it is set.
    pub gateway: Option<Ipv4Addr>,
    /// Whether IP parameters can be set and read.
    pub ip_support: bool,
    /// Whether the address filter can be set and read.
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
    /// Valid ADS ports.
    pub ports: Vec<u16>,
}

impl Default for AoeDescription {
    fn default() -> Self {
        AoeDescription { ports: vec![1000, 1001] }
    }
}
