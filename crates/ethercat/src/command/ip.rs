//! `ip`: sets IP parameters by EoE.

use ringcat_control::tool::{IpParameters, ToolQuery};

use crate::failure::Failure;
use crate::ipv4;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Longest host name.
const LONGEST_NAME: usize = 32;

/// The command.
pub const COMMAND: Command = Command {
    name: "ip",
    summary: "Set EoE IP parameters.",
    forms: &["<KEY> <VALUE> ..."],
    help: "One slave must be selected. Keys:
  ip_address (addr)          IPv4 address, with an optional prefix /0 to /32.
  mac_address (link)         MAC address.
  default_gateway (default)  IPv4 address.
  dns_address (dns)          IPv4 address.
  hostname (name)            Name of at most 32 bytes.
Instead of an IPv4 address a host name can be given.
",
    options: super::reg_read::SINGLE,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let words = session.words();
    if words.is_empty() || !words.len().is_multiple_of(2) {
        return Err(Failure::usage("'ip' needs an even number of arguments!"));
    }
    let ip = parameters(words)?;
    let (master, position) = session.single_slave()?;
    session.done(master, ToolQuery::SetIp { position, ip }, Vec::new())?;
    Ok(())
}

fn parameters(words: &[String]) -> Result<IpParameters, Failure> {
    let mut ip = IpParameters::default();
    for pair in words.chunks_exact(2) {
        let [key, value] = pair else { continue };
        match key.to_lowercase().as_str() {
            "ip_address" | "addr" => {
                let (address, mask) = ipv4::with_prefix(value)?;
                (ip.address, ip.mask) = (Some(address), mask);
            }
            "mac_address" | "link" => ip.mac = Some(ipv4::mac(value)?),
            "default_gateway" | "default" => ip.gateway = Some(ipv4::address(value)?),
            // The second one is a slip of an older tool that scripts may have.
            "dns_address" | "dns_adress" | "dns" => ip.dns = Some(ipv4::address(value)?),
            "hostname" | "name" if value.len() > LONGEST_NAME => return Err(Failure::usage("Name too long!")),
            "hostname" | "name" => ip.name = Some(value.as_bytes().to_vec()),
            _ => return Err(Failure::usage(format!("Unknown argument '{key}'!"))),
        }
    }
    Ok(ip)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn keys_have_short_names_and_wrong_values_are_named() {
        let read = |text: &str| parameters(&text.split(' ').map(str::to_owned).collect::<Vec<_>>());
        let ip = read("addr 10.0.0.2/24 link 02:00:00:00:00:01 default 10.0.0.1 dns_adress 10.0.0.3 name axis")
            .expect("it is right");
        assert_eq!(
            ip,
            read("ip_address 10.0.0.2/24 mac_address 2:0:0:0:0:1 default_gateway 10.0.0.1 dns 10.0.0.3 hostname axis")
                .expect("it is right")
        );
        assert_eq!(ip.mask.map(|mask| mask.to_string()).as_deref(), Some("255.255.255.0"));
        let long = format!("name {}", "x".repeat(33));
        for (text, part) in
            [("foo 1", "Unknown argument 'foo'!"), ("addr 1.2.3.4/40", "prefix '40'"), (&long, "too long")]
        {
            assert!(read(text).expect_err("it is wrong").text().contains(part), "{text}");
        }
    }
}
