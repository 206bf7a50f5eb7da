//! Errors of opening an interface, with advice.

use std::error::Error;
use std::fmt;
use std::io;

use crate::permission;

/// Why a link cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LinkError {
    /// There is no interface of this name.
    NoInterface {
        /// The requested name.
        name: String,
        /// The existing interfaces.
        present: Vec<String>,
    },
    /// This process may not open packet sockets.
    Permission {
        /// The interface to open.
        name: String,
    },
    /// The interface is not an Ethernet interface, or it is the loopback.
    NotEthernet {
        /// The interface.
        name: String,
    },
    /// This process may not switch interfaces on and off.
    MayNotSwitch {
        /// The interface to switch.
        name: String,
    },
    /// Another system call error.
    Os {
        /// The interface.
        name: String,
        /// The failed operation.
        what: &'static str,
        /// The error number of the kernel.
        errno: i32,
    },
}

impl LinkError {
    /// The error for `errno` returned by operation `what` on this interface.
    pub(crate) fn from_errno(name: &str, what: &'static str, errno: i32) -> LinkError {
        let name = name.to_owned();
        match errno {
            libc::EPERM | libc::EACCES => LinkError::Permission { name },
            errno => LinkError::Os { name, what, errno },
        }
    }
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LinkError::NoInterface { name, present } if present.is_empty() => {
                write!(f, "there is no network interface {name:?}, nor any other; `ip link` shows what there is")
            }
            LinkError::NoInterface { name, present } => {
                write!(f, "there is no network interface {name:?}; there are: {}", present.join(", "))
            }
            LinkError::Permission { name } => write!(
                f,
                "not permitted to send and receive raw frames on {name}; run as root or permit it once with\n  {}",
                permission::setcap_command()
            ),
            LinkError::NotEthernet { name } => {
                write!(f, "{name} is not an Ethernet interface; take the one that the first SubDevice is plugged into")
            }
            LinkError::MayNotSwitch { name } => write!(
                f,
                "not permitted to switch {name} on and off; run as root or permit it once with\n  {}",
                permission::setcap_command()
            ),
            LinkError::Os { name, what, errno } => {
                write!(f, "{name}: {what}: {}; {}", io::Error::from_raw_os_error(*errno), advice(*errno))
            }
        }
    }
}

impl Error for LinkError {}

fn advice(errno: i32) -> &'static str {
    match errno {
        libc::ENOMEM | libc::ENOBUFS => "the kernel is short of memory: free some, or request a smaller receive ring",
        libc::EMFILE | libc::ENFILE => "too many files are open: raise the limit (ulimit -n) or close some",
        libc::ENODEV | libc::ENXIO | libc::ENETDOWN => "the interface has disappeared: see `ip link` and try again",
        libc::EAFNOSUPPORT | libc::ENOPROTOOPT | libc::EPROTONOSUPPORT => {
            "this kernel lacks packet sockets with rings (CONFIG_PACKET): use another kernel"
        }
        _ => "unexpected: please report it with the output of `uname -r` and `ethtool -i` of the interface",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interface_error_lists_the_existing_interfaces() {
        let present = vec!["lo".to_owned(), "eth0".to_owned()];
        let text = LinkError::NoInterface { name: "eth9".to_owned(), present }.to_string();
        assert_eq!(text, "there is no network interface \"eth9\"; there are: lo, eth0");
    }

    #[test]
    fn a_missing_permission_error_contains_the_setcap_line() {
        for errno in [libc::EPERM, libc::EACCES] {
            let text = LinkError::from_errno("eth0", "socket", errno).to_string();
            let line = permission::setcap_command();
            assert!(text.contains("eth0") && text.ends_with(&line), "{text}");
        }
    }

    #[test]
    fn a_missing_permission_to_switch_an_interface_is_reported_with_the_setcap_line() {
        let text = LinkError::MayNotSwitch { name: "eth0".to_owned() }.to_string();
        assert!(text.starts_with("not permitted to switch eth0") && text.contains("cap_net_admin"), "{text}");
    }

    #[test]
    fn other_errors_name_interface_operation_and_advice() {
        let text = LinkError::from_errno("eth0", "mapping the receive ring", libc::ENOMEM).to_string();
        assert!(text.starts_with("eth0: mapping the receive ring: "), "{text}");
        assert!(text.ends_with("smaller receive ring"), "{text}");
        assert!(LinkError::from_errno("eth0", "bind", libc::EIO).to_string().contains("uname -r"));
    }

    #[test]
    fn an_interface_without_ethernet_is_an_error() {
        assert!(LinkError::NotEthernet { name: "lo".to_owned() }.to_string().starts_with("lo is not an Ethernet"));
    }
}
