//! Junction redundancy as the application requests it (protocol 9.4): the mode, and declared connections.
//!
//! A local ring begins at one port of a junction and returns to another port. A connection names the cable that
//! returns, the *closing* cable: its *head* is the junction, its *tail* the last SubDevice of the ring. This module
//! checks the form of a connection; it is compared with the segment when it is applied.

use crate::declared::SubDeviceId;

use core::fmt;

use ringcat_wire::address::Position;

/// Port of a junction to which the closing cable of a declared connection leads (JR-06).
pub const HEAD_PORT: u8 = 1;
/// Port at which the ring then begins: frames pass it before [`HEAD_PORT`] (protocol 9.4).
pub const START_PORT: u8 = 3;
/// Largest number of ports of a SubDevice.
const PORTS: u8 = 4;

/// Handling of local rings (JR-03).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum JunctionMode {
    /// Local rings are not known: a break in one is reported as a crossed line (JR-04).
    #[default]
    Disabled,
    /// Local rings that exist at the scan are learned, and supervised from then on.
    Automatic,
    /// Local rings that the application declares are supervised from the start on.
    Strict,
}

impl fmt::Display for JunctionMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            JunctionMode::Disabled => "disabled",
            JunctionMode::Automatic => "automatic",
            JunctionMode::Strict => "strict",
        })
    }
}

/// The closing cable of a local ring, as the application declares it. SubDevices are named by their index in the
/// declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct JunctionConnection {
    /// The junction.
    pub head: SubDeviceId,
    /// Its port: [`HEAD_PORT`].
    pub head_port: u8,
    /// The last SubDevice of the ring.
    pub tail: SubDeviceId,
    /// Its port: any but 0.
    pub tail_port: u8,
}

impl fmt::Display for JunctionConnection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let JunctionConnection { head, head_port, tail, tail_port } = self;
        write!(f, "junction connection {head}:{head_port}-{tail}:{tail_port}")
    }
}

/// Why a connection is refused: a fault of the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum JunctionError {
    /// No declaration is loaded to which a connection could be added.
    NotLoaded,
    /// The head is not declared.
    UnknownHead(JunctionConnection),
    /// The tail is not declared.
    UnknownTail(JunctionConnection),
    /// The head's port is not [`HEAD_PORT`].
    HeadPort(JunctionConnection),
    /// The tail's port is 0, or no port.
    TailPort(JunctionConnection),
    /// Head and tail are the same port, or one of them is part of another connection.
    Taken(JunctionConnection),
    /// The tail is not behind the head.
    NotBehind(JunctionConnection),
    /// A SubDevice does not have one of the ports; the head needs [`START_PORT`] too.
    NoSuchPort {
        /// The connection.
        connection: JunctionConnection,
        /// Index of the SubDevice in the declaration.
        subdevice: SubDeviceId,
        /// The port.
        port: u8,
    },
    /// The mode is strict and there is no connection.
    NoConnection,
    /// The closing cable does not exist: this was detected when both of its ends were closed for a moment.
    NotThere {
        /// The connection.
        connection: JunctionConnection,
        /// The evidence.
        shown: ClosingEvidence,
    },
    /// Connections could not be tested: the segment changed during each test, or a scan, another procedure or an
    /// application was using it.
    NotTested,
}

/// Evidence that no cable connects the declared ports, from closing both ports for a moment. An intact ring then loses
/// no SubDevice; a ring that is broken elsewhere loses the SubDevices behind its break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ClosingEvidence {
    /// A SubDevice did not answer, although it would be reached if the cable existed.
    CutOff {
        /// Position of the first of them.
        position: Position,
    },
    /// A SubDevice behind the break answered.
    StillThere {
        /// Position of the first of them.
        position: Position,
    },
    /// No frame came back.
    NoFrame,
}

impl fmt::Display for ClosingEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClosingEvidence::CutOff { position } => write!(f, "the SubDevice at position {position} is cut off"),
            ClosingEvidence::StillThere { position } => write!(f, "the SubDevice at position {position} still answers"),
            ClosingEvidence::NoFrame => f.write_str("no frame comes back"),
        }
    }
}

impl fmt::Display for JunctionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            JunctionError::NotLoaded => f.write_str("nothing is loaded: load a configuration before adding to it"),
            JunctionError::UnknownHead(connection) => write!(f, "{connection}: its head is not declared"),
            JunctionError::UnknownTail(connection) => write!(f, "{connection}: its tail is not declared"),
            JunctionError::HeadPort(connection) => {
                write!(f, "{connection}: expected head port {HEAD_PORT}, got {}", connection.head_port)
            }
            JunctionError::TailPort(connection) => {
                write!(f, "{connection}: expected tail port 1, 2 or 3, got {}", connection.tail_port)
            }
            JunctionError::Taken(connection) => write!(f, "{connection}: one of its ports is in use already"),
            JunctionError::NotBehind(connection) => write!(f, "{connection}: its tail does not lie behind its head"),
            JunctionError::NoSuchPort { connection, subdevice, port } => {
                write!(f, "{connection}: SubDevice {subdevice} has no port {port}")
            }
            JunctionError::NotThere { connection, shown } => {
                let JunctionConnection { head, head_port, tail, tail_port } = connection;
                write!(
                    f,
                    "{connection}: SubDevice {tail} port {tail_port} does not lead back to SubDevice {head} port "
                )?;
                write!(f, "{head_port}: with these ports closed {shown}")
            }
            JunctionError::NotTested => {
                f.write_str("the junction connections could not be tested: the segment changes, or is in use")
            }
            JunctionError::NoConnection => f.write_str("strict junction redundancy needs at least one connection"),
        }
    }
}

impl core::error::Error for JunctionError {}

impl JunctionConnection {
    /// The cable from a port of the junction to a port of the last SubDevice.
    pub const fn new(head: SubDeviceId, head_port: u8, tail: SubDeviceId, tail_port: u8) -> JunctionConnection {
        JunctionConnection { head, head_port, tail, tail_port }
    }

    /// Checks a connection against earlier ones and against the number of declared SubDevices (JR-06).
    pub(crate) fn check(&self, before: &[JunctionConnection], declared: usize) -> Result<(), JunctionError> {
        if self.head >= SubDeviceId(declared) {
            return Err(JunctionError::UnknownHead(*self));
        }
        if self.tail >= SubDeviceId(declared) {
            return Err(JunctionError::UnknownTail(*self));
        }
        self.check_ports()?;
        let [head, tail] = self.ends();
        if before.iter().flat_map(JunctionConnection::ends).any(|end| end == head || end == tail) {
            return Err(JunctionError::Taken(*self));
        }
        Ok(())
    }

    /// Checks its ports, which needs no declaration.
    ///
    /// # Errors
    /// Another port than 1 at the head, port 0 or above 3 at the tail, or one port for both ends (JR-06).
    pub fn check_ports(&self) -> Result<(), JunctionError> {
        if self.head_port != HEAD_PORT {
            return Err(JunctionError::HeadPort(*self));
        }
        if self.tail_port == 0 || self.tail_port >= PORTS {
            return Err(JunctionError::TailPort(*self));
        }
        let [head, tail] = self.ends();
        if head == tail { Err(JunctionError::Taken(*self)) } else { Ok(()) }
    }

    fn ends(&self) -> [(SubDeviceId, u8); 2] {
        [(self.head, self.head_port), (self.tail, self.tail_port)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: JR-06, junctions
    #[test]
    fn a_connection_has_its_head_at_port_1_and_its_tail_not_at_port_0() {
        let good = JunctionConnection { head: SubDeviceId(1), head_port: 1, tail: SubDeviceId(4), tail_port: 1 };
        assert_eq!(good.check(&[], 5), Ok(()));
        let head = |head_port| JunctionConnection { head_port, ..good };
        for port in [0, 2, 3, 4, 255] {
            assert_eq!(head(port).check(&[], 5), Err(JunctionError::HeadPort(head(port))));
        }
        let tail = |tail_port| JunctionConnection { tail_port, ..good };
        for port in [0, 4, 255] {
            assert_eq!(tail(port).check(&[], 5), Err(JunctionError::TailPort(tail(port))));
        }
        assert_eq!(tail(3).check(&[], 5), Ok(()));
        assert_eq!(good.check(&[], 4), Err(JunctionError::UnknownTail(good)));
        assert_eq!(good.check(&[], 1), Err(JunctionError::UnknownHead(good)));
        let same_subdevice = JunctionConnection { tail: SubDeviceId(1), ..good };
        assert_eq!(same_subdevice.check(&[], 5), Err(JunctionError::Taken(same_subdevice)));
        assert_eq!(good.check(&[tail(2)], 5), Err(JunctionError::Taken(good)), "the head has one port 1");
    }
}
