//! Services of one SubDevice besides its mailbox (Master Redundancy 10.8): registers, ports, resets, error counters,
//! its EEPROM.

pub mod eeprom_owner;
pub mod forced_state;
mod open_ring;
pub mod port_report;
pub mod ports;
pub mod registers;
pub mod reset;
pub mod statistics;

use core::fmt;

use ringcat_wire::address::LogicalAddress;

use super::sii::program::SiiProgramError;
use crate::declared::{Address, SubDeviceId};
use crate::role::NotPermitted;
use crate::supervisor::BusError;

/// Why a service failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ServiceError {
    /// No SubDevice is declared, or was found, with this number.
    NoSubDevice {
        /// Its index in the declaration, before activation its position.
        subdevice: Address,
    },
    /// The bus failed, or the SubDevice does not answer.
    Bus(BusError),
    /// The EEPROM was not written or loaded.
    Sii(SiiProgramError),
    /// The address and the length leave the memory of 64 KiB.
    Range {
        /// The first byte.
        address: u16,
        /// Bytes.
        length: usize,
    },
    /// Not a port: ports are 0 to 3.
    Port {
        /// The port.
        port: u8,
    },
    /// It is connected to the main link directly: there is no port before it.
    OnTheLink {
        /// The SubDevice.
        subdevice: SubDeviceId,
    },
    /// An EtherType that a debug message may not have: that of EtherCAT or of a VLAN tag, or a length.
    EtherType {
        /// The EtherType.
        ethertype: u16,
    },
    /// A debug message that fits no frame, in bytes.
    TooLong {
        /// Its length.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// The function is refused in the present role or phase.
    NotPermitted(NotPermitted),
    /// No declaration is active yet.
    NotActive,
    /// Without an application this needs idle operation; a scan does the same for SubDevices in INIT.
    NoIdleOperation,
    /// The segment was not stable for long enough.
    Unsteady,
    /// More datagrams than allowed per call.
    TooMany {
        /// Number of datagrams.
        got: usize,
        /// The limit.
        limit: usize,
    },
    /// An LRW of the application over process data of several SubDevices, with two links: with a break each copy would
    /// be processed by only some of them (protocol 9.2.2).
    LrwOnTwoLinks {
        /// Its logical address.
        logical: LogicalAddress,
        /// Its bytes.
        length: usize,
        /// Two SubDevices with process data in its range, by their indices in the declaration.
        subdevices: [SubDeviceId; 2],
    },
}

impl fmt::Display for ServiceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ServiceError::NoSubDevice { subdevice } => write!(f, "there is no {subdevice}"),
            ServiceError::Bus(error) => error.fmt(f),
            ServiceError::Sii(error) => error.fmt(f),
            ServiceError::Port { port } => write!(f, "there is no port {port}, only 0 to 3"),
            ServiceError::OnTheLink { subdevice } => {
                write!(f, "SubDevice {subdevice} is connected to the main link: there is no port before it")
            }
            ServiceError::EtherType { ethertype } => {
                write!(f, "EtherType {ethertype:#06x} is that of EtherCAT or of a VLAN tag, or a length: take another")
            }
            ServiceError::TooLong { got, limit } => write!(f, "{got} bytes, at most {limit} fit"),
            ServiceError::NotPermitted(denied) => denied.fmt(f),
            ServiceError::NotActive => f.write_str("nothing is declared yet"),
            ServiceError::NoIdleOperation => {
                f.write_str("no application is active, and idle operation is off: set the option, or scan")
            }
            ServiceError::Unsteady => f.write_str("the segment changes repeatedly"),
            ServiceError::TooMany { got, limit } => write!(f, "{got} at once, at most {limit} are taken"),
            ServiceError::LrwOnTwoLinks { logical, length, subdevices: [one, other] } => write!(
                f,
                "an LRW at logical address {logical} of {length} bytes covers process data of SubDevices {one} and \
                 {other}: with two links an LRW may address one SubDevice, use LWR and LRD"
            ),
            ServiceError::Range { address, length } => {
                write!(f, "{length} bytes from {address:#06x} on: the memory ends at 0xffff")
            }
        }
    }
}

impl core::error::Error for ServiceError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            ServiceError::Bus(error) => Some(error),
            ServiceError::Sii(error) => Some(error),
            ServiceError::NotPermitted(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for ServiceError {
    fn from(denied: NotPermitted) -> ServiceError {
        ServiceError::NotPermitted(denied)
    }
}

impl From<SiiProgramError> for ServiceError {
    fn from(error: SiiProgramError) -> ServiceError {
        ServiceError::Sii(error)
    }
}

impl From<BusError> for ServiceError {
    fn from(error: BusError) -> ServiceError {
        ServiceError::Bus(error)
    }
}
