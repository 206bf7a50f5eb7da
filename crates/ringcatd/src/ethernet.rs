//! Network interfaces of EoE of a master: made by the daemon, which needs CAP_NET_ADMIN for that, and kept by it while
//! it drives the master and while applications do.
//!
//! An interface outlasts the daemon, too, if that is killed: the next one goes on with it. At an orderly end of the
//! daemon it lasts as long as an application has it.

use std::collections::BTreeMap;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ringcat_control::message::MOST_INTERFACES;
use ringcat_link::tap::{TapError, TapInterface};

/// Bits of the first byte of an address: of a group, locally administered.
const KIND: u8 = 0x03;
/// One address, locally administered.
const LOCAL: u8 = 0x02;
/// Digits of a position or an alias.
const DIGITS: usize = 5;

/// Network interfaces of a master.
#[derive(Debug)]
pub struct EthernetInterfaces {
    master: u32,
    made: Mutex<BTreeMap<String, TapInterface>>,
}

impl EthernetInterfaces {
    /// No interface is made yet.
    pub fn new(master: u32) -> EthernetInterfaces {
        EthernetInterfaces { master, made: Mutex::default() }
    }

    fn made(&self) -> MutexGuard<'_, BTreeMap<String, TapInterface>> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A duplicate of the interface with this name, which is made if it is not there.
    ///
    /// # Errors
    /// It cannot be made, or its name or address is not one of this master.
    pub fn make(&self, name: &str, mac: [u8; 6]) -> Result<TapInterface, TapError> {
        let refused = |cause: &str| TapError::Refused { name: name.to_owned(), cause: cause.to_owned() };
        if !is_of(name, self.master) || mac[0] & KIND != LOCAL {
            return Err(refused("expected the name and the address of an interface of this master"));
        }
        let mut made = self.made();
        // Another program may have removed one that was made.
        made.retain(|_, tap| tap.exists());
        if !made.contains_key(name) {
            if made.len() >= MOST_INTERFACES {
                return Err(refused("there are as many interfaces as there may be"));
            }
            made.insert(name.to_owned(), TapInterface::create_lasting(name, mac)?);
        }
        let tap = made.get(name).ok_or_else(|| refused("it was removed"))?;
        tap.duplicate().map_err(|error| refused(&error.to_string()))
    }

    /// Names and duplicates of all interfaces, for a process that moves their frames.
    pub fn all(&self) -> Vec<(String, OwnedFd)> {
        let duplicate =
            |(name, tap): (&String, &TapInterface)| Some((name.clone(), tap.as_fd().try_clone_to_owned().ok()?));
        self.made().iter().filter_map(duplicate).collect()
    }

    /// Nothing moves their frames: they have no carrier.
    pub fn leave(&self) {
        self.made().values().for_each(|tap| _ = tap.set_carrier(false));
    }

    /// At the end of the daemon: they last as long as a process has them.
    pub fn end(&self) {
        self.made().values().for_each(TapInterface::end_with_processes);
    }
}

/// Whether a name is one of an interface of this master: `eoeXsY` or `eoeXaY`.
fn is_of(name: &str, master: u32) -> bool {
    let rest = name.strip_prefix(&format!("eoe{master}")).and_then(|rest| rest.strip_prefix(['s', 'a']));
    rest.is_some_and(|rest| (1..=DIGITS).contains(&rest.len()) && rest.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, eoe-interfaces
    #[test]
    fn only_interfaces_of_the_master_are_made() {
        for (name, is_right) in [("eoe3s0", true), ("eoe3a65535", true), ("eoe3s", false), ("eoe3x1", false)] {
            assert_eq!(is_of(name, 3), is_right, "{name}");
        }
        for name in ["eoe4s1", "eoe33s1", "eth0", "", "eoe3s1x", "eoe3s123456", "eoe3s-1", "eoe3s1/../x"] {
            assert!(!is_of(name, 3), "{name}");
        }
        let interfaces = EthernetInterfaces::new(3);
        for (name, mac) in [("eth0", [2, 0, 0, 0, 0, 1]), ("eoe3s1", [0; 6]), ("eoe3s1", [3, 0, 0, 0, 0, 1])] {
            let refused = interfaces.make(name, mac).expect_err("it is none of this master").to_string();
            assert!(refused.contains("of this master"), "{refused}");
        }
        assert!(interfaces.all().is_empty());
    }
}
