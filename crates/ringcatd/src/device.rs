//! The network interface of a link, as an option or a configuration file names it, and where it is now.

use std::fmt;
use std::str::FromStr;

use ringcat_link::interface::{self, Interface, free};
use ringcat_link::{LinkError, PresentInterface};

/// The address that stands for the first interface that is free.
pub const FIRST: [u8; 6] = [0xff; 6];
/// Longest name of an interface (`IFNAMSIZ` without its end).
const LONGEST_NAME: usize = 15;
/// Interfaces that are named with the reason why they are not free.
const MOST_NAMED: usize = 16;

/// A network interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// By its name.
    Name(String),
    /// By its address, whatever its name is.
    Address([u8; 6]),
    /// The first one that nothing else uses.
    First,
}

/// Where a device is now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Name of the interface.
    pub name: String,
    /// Its number and address.
    pub interface: PresentInterface,
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Device::Name(name) => f.write_str(name),
            Device::Address(address) => write_address(f, address),
            Device::First => write_address(f, &FIRST),
        }
    }
}

fn write_address(f: &mut fmt::Formatter<'_>, [a, b, c, d, e, g]: &[u8; 6]) -> fmt::Result {
    write!(f, "{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}")
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Device, String> {
        if text.contains(':') {
            return match address(text) {
                Some(FIRST) => Ok(Device::First),
                Some(address) if address == [0; 6] || address[0] & 1 != 0 => {
                    Err(format!("{text:?} is not the address of an interface"))
                }
                Some(address) => Ok(Device::Address(address)),
                None => Err(format!("expected an address as 00:00:08:44:ab:66, got {text:?}")),
            };
        }
        let is_strange = |it: char| it.is_whitespace() || it.is_control() || matches!(it, '/' | ',');
        if text.is_empty() || text.len() > LONGEST_NAME || text.contains(is_strange) || matches!(text, "." | "..") {
            return Err(format!("expected the address or the name of one interface, got {text:?}"));
        }
        Ok(Device::Name(text.to_owned()))
    }
}

/// Six pairs of hexadecimal digits with colons.
fn address(text: &str) -> Option<[u8; 6]> {
    let mut address = [0; 6];
    let mut parts = text.split(':');
    for byte in &mut address {
        let part = parts.next()?;
        let is_pair = matches!(part.len(), 1 | 2) && part.bytes().all(|it| it.is_ascii_hexdigit());
        *byte = u8::from_str_radix(part, 16).ok().filter(|_| is_pair)?;
    }
    parts.next().is_none().then_some(address)
}

impl Device {
    /// Whether it is this interface; false for the first free one before it is found.
    pub fn is(&self, interface: &Interface) -> bool {
        match self {
            Device::Name(name) => *name == interface.name,
            Device::Address(address) => *address == interface.mac,
            Device::First => false,
        }
    }

    /// The interface, if it is there. `others` are never taken as the first one.
    ///
    /// # Errors
    /// It is no Ethernet interface, or none is free, with the reason for each.
    pub fn find(&self, others: &[Device]) -> Result<Option<Found>, String> {
        let name = match self {
            Device::Name(name) => Some(name.clone()),
            Device::Address(_) => self.with_address(),
            Device::First => return first(others).map(Some),
        };
        let Some(name) = name else { return Ok(None) };
        let interface = PresentInterface::find(&name).map_err(|error| error.to_string())?;
        Ok(interface.map(|interface| Found { name, interface }))
    }

    /// Name of the interface with this address. Those that are made of it (VLAN, bridge) may have it too.
    fn with_address(&self) -> Option<String> {
        let mut all: Vec<Interface> = interface::list().into_iter().filter(|it| self.is(it)).collect();
        if all.len() > 1 {
            all.sort_by_key(|it| !free::has_cable(it));
        }
        all.into_iter().next().map(|it| it.name)
    }

    /// Its description in messages while it is absent.
    pub fn missing(&self) -> String {
        let present: Vec<Interface> = interface::list();
        let names = || present.iter().map(|it| it.name.clone()).collect();
        match self {
            Device::Name(name) => LinkError::NoInterface { name: name.clone(), present: names() }.to_string(),
            Device::Address(_) | Device::First => {
                let shown: Vec<String> = present
                    .iter()
                    .filter(|it| !it.loopback)
                    .take(MOST_NAMED)
                    .map(|it| format!("{} ({})", it.name, Device::Address(it.mac)))
                    .collect();
                format!("there is no interface with the address {self}; there are: {}", shown.join(", "))
            }
        }
    }
}

/// The first interface that nothing else uses.
fn first(others: &[Device]) -> Result<Found, String> {
    let mut reasons = Vec::new();
    for candidate in interface::list() {
        let reason = match PresentInterface::find(&candidate.name) {
            _ if candidate.loopback => continue,
            Err(_) | Ok(None) => continue,
            Ok(Some(_)) if others.iter().any(|other| other.is(&candidate)) => "another master has it".to_owned(),
            Ok(Some(interface)) => match free::hindrance(&candidate) {
                None => return Ok(Found { name: candidate.name, interface }),
                Some(reason) => reason,
            },
        };
        reasons.push(format!("{}: {reason}", candidate.name));
    }
    let more = reasons.len().saturating_sub(MOST_NAMED);
    reasons.truncate(MOST_NAMED);
    if more > 0 {
        reasons.push(format!("and {more} more"));
    }
    let all = if reasons.is_empty() { "there is none".to_owned() } else { reasons.join("; ") };
    Err(format!("no network interface is free for {}: {all}", Device::First))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_device_is_an_address_a_name_or_the_first() {
        let parse = |text: &str| text.parse::<Device>();
        assert_eq!(parse("00:00:08:44:AB:66"), Ok(Device::Address([0, 0, 8, 0x44, 0xab, 0x66])));
        assert_eq!(parse("0:1:2:3:4:5"), Ok(Device::Address([0, 1, 2, 3, 4, 5])));
        assert_eq!(parse("ff:FF:ff:ff:ff:ff"), Ok(Device::First));
        assert_eq!(parse("enp1s0"), Ok(Device::Name("enp1s0".to_owned())));
        for text in ["00:00:08:44:ab:66", "eth1", "ff:ff:ff:ff:ff:ff"] {
            assert_eq!(parse(text).expect("it is right").to_string(), text);
        }
        for text in ["00:00:08:44:ab", "00:00:08:44:ab:66:77", "00:00:08:44:ab:6g", "00:00:08:44:ab:+6", "::::::"] {
            assert!(parse(text).expect_err(text).contains("expected an address"), "{text}");
        }
        for text in ["00:00:00:00:00:00", "01:00:5e:00:00:01"] {
            assert!(parse(text).expect_err(text).contains("not the address of an interface"), "{text}");
        }
        for text in ["", "eth0 eth1", "eth0,eth1", "../x", ".", "a-name-that-is-long"] {
            assert!(parse(text).expect_err("it is none").contains("expected the address or the name"), "{text}");
        }
    }

    // covers: daemon
    #[test]
    fn the_loopback_and_interfaces_of_other_masters_are_never_the_first() {
        let others: Vec<Device> = interface::list().into_iter().map(|it| Device::Name(it.name)).collect();
        let none = Device::First.find(&others).expect_err("all belong to others");
        assert!(none.starts_with("no network interface is free for ff:ff:ff:ff:ff:ff: ") && !none.contains(" lo: "));
        let absent: Device = "02:00:00:00:00:99".parse().expect("it is right");
        assert_eq!(absent.find(&[]), Ok(None));
        assert!(absent.missing().contains("no interface with the address 02:00:00:00:00:99"), "{}", absent.missing());
        assert!(Device::Name("no-such".to_owned()).missing().contains("no-such"));
    }
}
