//! Addresses of networks as users write them.

use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs};

use crate::failure::Failure;
use crate::numbers;

/// Longest prefix.
const BITS: u32 = 32;

/// An address, or the one of a host name.
///
/// # Errors
/// There is no such host.
pub fn address(text: &str) -> Result<Ipv4Addr, Failure> {
    let failed = |cause: &str| Failure::failed(format!("Lookup of '{text}' failed: {cause}"));
    if let Ok(address) = text.parse() {
        return Ok(address);
    }
    let found = (text, 0).to_socket_addrs().map_err(|error| failed(&error.to_string()))?;
    let first = found.filter_map(|address| match address {
        SocketAddr::V4(address) => Some(*address.ip()),
        SocketAddr::V6(_) => None,
    });
    first.into_iter().next().ok_or_else(|| failed("no IPv4 address"))
}

/// An address with the mask of its prefix, if it has one.
///
/// # Errors
/// The prefix is longer than 32, or there is no such host.
pub fn with_prefix(text: &str) -> Result<(Ipv4Addr, Option<Ipv4Addr>), Failure> {
    let Some((host, prefix)) = text.split_once('/') else { return Ok((address(text)?, None)) };
    let bits = numbers::parse::<u32>(prefix).filter(|bits| *bits <= BITS);
    let bits = bits.ok_or_else(|| Failure::usage(format!("Invalid prefix '{prefix}'!")))?;
    let mask = u32::MAX.checked_shl(BITS - bits).unwrap_or(0);
    Ok((address(host)?, Some(Ipv4Addr::from(mask))))
}

/// A MAC address: six bytes in hexadecimal with colons or hyphens between them (manual 7.1.13).
///
/// # Errors
/// It is no MAC address.
pub fn mac(text: &str) -> Result<[u8; 6], Failure> {
    let parts: Vec<&str> = text.split(if text.contains(':') { ':' } else { '-' }).collect();
    if parts.len() < 6 {
        return Err(Failure::usage("Incomplete MAC address!"));
    }
    let byte = |part: &&str| {
        let is_byte = (1..=2).contains(&part.len()) && part.bytes().all(|it| it.is_ascii_hexdigit());
        if is_byte { u8::from_str_radix(part, 16).ok() } else { None }
    };
    let bytes: Option<Vec<u8>> = parts.iter().map(byte).collect();
    let bytes = bytes.and_then(|bytes| <[u8; 6]>::try_from(bytes).ok());
    bytes.ok_or_else(|| Failure::usage("Invalid MAC address!"))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn prefixes_are_masks_and_mac_addresses_have_six_bytes() {
        let mask = |text: &str| with_prefix(text).map(|(_, mask)| mask.map(|mask| mask.to_string()));
        assert_eq!(mask("10.0.0.1/24").expect("it is one"), Some("255.255.255.0".to_owned()));
        assert_eq!(mask("10.0.0.1/0").expect("it is one"), Some("0.0.0.0".to_owned()));
        assert_eq!(mask("10.0.0.1/32").expect("it is one"), Some("255.255.255.255".to_owned()));
        assert_eq!(mask("10.0.0.1").expect("it is one"), None);
        assert_eq!(mask("10.0.0.1/40").expect_err("it is long").text(), "Invalid prefix '40'!\n");
        assert_eq!(mac("02:0:00:00:00:fF").expect("it is one"), [2, 0, 0, 0, 0, 255]);
        assert_eq!(mac("02-0-00-00-00-fF").expect("it is one"), [2, 0, 0, 0, 0, 255]);
        assert_eq!(mac("02-00-00").expect_err("it is short").text(), "Incomplete MAC address!\n");
        assert_eq!(mac("02:00:00").expect_err("it is short").text(), "Incomplete MAC address!\n");
        for text in [
            "02:00:00:00:00:xx",
            "02:00:00:00:00:00-1",
            "02:00:00:00:00:100",
            "02:00:00:00:00:",
            "1:2:3:4:5:6:7",
            "+1:2:3:4:5:6",
        ] {
            assert_eq!(mac(text).expect_err("it is wrong").text(), "Invalid MAC address!\n", "{text}");
        }
    }
}
