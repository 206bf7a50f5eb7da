//! What the driver of an interface is set to: its name, link, interrupt coalescing, offloads, energy-efficient
//! Ethernet.
//!
//! Input: a name. Output: [`Settings`], each as the driver answers, or why it does not. Only commands that read are
//! used; they need no permission. Layouts are from `linux/ethtool.h`. Calls may wait for a lock of the kernel.

use std::fmt;
use std::io;
use std::os::fd::AsRawFd;

use crate::kernel::{self, ETHTOOL_WORDS};

const GET_SETTINGS: u32 = 0x01;
const GET_DRIVER: u32 = 0x03;
const GET_COALESCING: u32 = 0x0e;
const GET_FLAGS: u32 = 0x25;
const GET_GRO: u32 = 0x2b;
const GET_EEE: u32 = 0x44;

/// `ETH_FLAG_LRO`.
const LRO: u32 = 1 << 15;
/// `SPEED_UNKNOWN`.
const UNKNOWN_SPEED: u32 = u32::MAX;

/// What the driver of an interface is set to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The driver.
    pub driver: Result<Driver, NoAnswer>,
    /// What both ends of the cable have agreed on.
    pub link: Result<Link, NoAnswer>,
    /// When interrupts come.
    pub coalescing: Result<Coalescing, NoAnswer>,
    /// What is done with received frames.
    pub offloads: Result<Offloads, NoAnswer>,
    /// Energy-efficient Ethernet.
    pub eee: Result<Eee, NoAnswer>,
}

/// Why a driver does not answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoAnswer {
    /// It does not have such a setting, or does not report it.
    NotSupported,
    /// Another error of the kernel.
    Failed(i32),
}

impl fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoAnswer::NotSupported => f.write_str("the driver does not report it"),
            NoAnswer::Failed(errno) => write!(f, "the driver answers: {}", io::Error::from_raw_os_error(*errno)),
        }
    }
}

/// A driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Driver {
    /// Its name, such as "igb" or "veth".
    pub name: String,
    /// Where the device is, such as "0000:02:00.0" or "usb-0000:00:14.0-2"; empty for one without hardware.
    pub bus: String,
}

/// A link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Its speed in Mbit/s; `None` if it is not known, as without a link partner.
    pub mbits: Option<u32>,
    /// Whether it sends and receives at the same time; `None` if it is not known.
    pub full_duplex: Option<bool>,
}

/// How long interrupts wait for further frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coalescing {
    /// Longest wait after a received frame, in microseconds.
    pub rx_us: u32,
    /// Longest wait after a sent frame, in microseconds.
    pub tx_us: u32,
    /// Whether the driver changes the wait after received frames with their rate.
    pub adaptive_rx: bool,
    /// The same for sent frames.
    pub adaptive_tx: bool,
}

/// What is done with received frames before they are delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Offloads {
    /// The kernel collects frames (generic receive offload).
    pub gro: bool,
    /// The device collects frames (large receive offload).
    pub lro: bool,
}

/// Energy-efficient Ethernet (IEEE 802.3az): the link sleeps between frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Eee {
    /// Whether it is permitted.
    pub enabled: bool,
    /// Whether both ends have agreed on it.
    pub active: bool,
}

/// Reads all settings.
pub fn settings(name: &str) -> Settings {
    let socket = kernel::request_socket();
    let ask = |command| {
        let socket = socket.as_ref().map_err(|errno| NoAnswer::Failed(*errno))?;
        kernel::ethtool(socket.as_raw_fd(), name, command).map_err(|errno| match errno {
            libc::EOPNOTSUPP => NoAnswer::NotSupported,
            errno => NoAnswer::Failed(errno),
        })
    };
    let flags = ask(GET_FLAGS);
    Settings {
        driver: ask(GET_DRIVER).map(|words| driver(&words)),
        link: ask(GET_SETTINGS).map(|words| link(&words)),
        coalescing: ask(GET_COALESCING).map(|words| coalescing(&words)),
        offloads: ask(GET_GRO).and_then(|gro| Ok(Offloads { gro: gro[1] != 0, lro: flags?[1] & LRO != 0 })),
        eee: ask(GET_EEE).map(|words| Eee { active: words[4] != 0, enabled: words[5] != 0 }),
    }
}

/// `ethtool_drvinfo`: after the command texts of 32 bytes, each ends with a zero.
fn driver(words: &[u32; ETHTOOL_WORDS]) -> Driver {
    let text = |number: usize| {
        let field = &words[1 + number * 8..][..8];
        let bytes: Vec<u8> = field.iter().flat_map(|word| word.to_ne_bytes()).take_while(|byte| *byte != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    Driver { name: text(0), bus: Some(text(3)).filter(|bus| bus != "N/A").unwrap_or_default() }
}

/// `ethtool_cmd`: the speed is in two halves, 12 and 28 bytes from its beginning.
fn link(words: &[u32; ETHTOOL_WORDS]) -> Link {
    let byte = |at: usize| words[at / 4].to_ne_bytes()[at % 4];
    let half = |at: usize| u32::from(u16::from_ne_bytes([byte(at), byte(at + 1)]));
    let mbits = half(28) << 16 | half(12);
    let full_duplex = match byte(14) {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    };
    // Drivers report 0 or 65,535 too where there is no link.
    Link { mbits: Some(mbits).filter(|mbits| ![0, 0xFFFF, UNKNOWN_SPEED].contains(mbits)), full_duplex }
}

/// `ethtool_coalesce`.
fn coalescing(words: &[u32; ETHTOOL_WORDS]) -> Coalescing {
    Coalescing { rx_us: words[1], tx_us: words[5], adaptive_rx: words[10] != 0, adaptive_tx: words[11] != 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A structure of these bytes.
    fn words(bytes: &[u8]) -> [u32; ETHTOOL_WORDS] {
        let mut padded = bytes.to_vec();
        padded.resize(4 * ETHTOOL_WORDS, 0);
        std::array::from_fn(|at| u32::from_ne_bytes(std::array::from_fn(|byte| padded[4 * at + byte])))
    }

    // covers: bench
    #[test]
    fn structures_of_drivers_are_read_as_the_kernel_lays_them_out() {
        let mut info = vec![0; 196];
        info[4..7].copy_from_slice(b"igb");
        info[100..112].copy_from_slice(b"0000:02:00.0");
        let found = driver(&words(&info));
        assert_eq!((found.name.as_str(), found.bus.as_str()), ("igb", "0000:02:00.0"));
        info[4..100].fill(0xff);
        info[100..104].copy_from_slice(b"N/A\0");
        let wild = driver(&words(&info));
        assert_eq!((wild.name.chars().count(), wild.bus.as_str()), (32, ""));
        let mut command = vec![0; 44];
        command[12..16].copy_from_slice(&[100, 0, 1, 0]);
        assert_eq!(link(&words(&command)), Link { mbits: Some(100), full_duplex: Some(true) });
        command[12..15].copy_from_slice(&[0xff; 3]);
        command[28..30].copy_from_slice(&[0xff; 2]);
        assert_eq!(link(&words(&command)), Link { mbits: None, full_duplex: None });
        let numbered: [u32; ETHTOOL_WORDS] = std::array::from_fn(|at| at as u32);
        let expected = Coalescing { rx_us: 1, tx_us: 5, adaptive_rx: true, adaptive_tx: true };
        assert_eq!(coalescing(&numbered), expected);
    }

    // covers: bench
    #[test]
    fn an_interface_that_is_missing_has_no_settings() {
        for name in ["no-such", "", "a-name-that-is-longer-than-the-kernel-allows"] {
            let none = settings(name);
            assert_eq!(none.driver, Err(NoAnswer::Failed(libc::ENODEV)), "{name}");
            assert_eq!((none.offloads.is_err(), none.eee.is_err()), (true, true), "{name}");
        }
        assert!(settings("lo").offloads.is_ok(), "the kernel answers for every interface");
    }
}
