//! The IP parameters of a SubDevice (protocol 6.5).

use core::net::Ipv4Addr;

use super::{FieldWriter, PayloadError, split};

/// Bytes of a name.
pub const MAX_NAME: usize = 32;

const MAC: u32 = 1 << 0;
const ADDRESS: u32 = 1 << 1;
const MASK: u32 = 1 << 2;
const GATEWAY: u32 = 1 << 3;
const DNS: u32 = 1 << 4;
const NAME: u32 = 1 << 5;

/// Bytes of all fields after the flags.
const FIELDS_LEN: usize = 6 + 4 * 4 + MAX_NAME;

/// IP parameters to set, or as reported; `None`: not contained in the message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IpParameters<'a> {
    /// MAC address.
    pub mac: Option<[u8; 6]>,
    /// IP address.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway.
    pub gateway: Option<Ipv4Addr>,
    /// DNS server.
    pub dns: Option<Ipv4Addr>,
    /// DNS name, at most [`MAX_NAME`] bytes, without terminating NUL.
    pub name: Option<&'a [u8]>,
}

impl<'a> IpParameters<'a> {
    /// Decodes flags and fields. A message of 58 bytes has each field at a fixed offset; a shorter message has the
    /// present fields packed.
    pub(super) fn decode(data: &'a [u8]) -> Result<IpParameters<'a>, PayloadError> {
        let (flags, rest) = split(data, "EoE IP parameters")?;
        let mut fields = Fields { flags: u32::from_le_bytes(*flags), fixed: rest.len() >= FIELDS_LEN, rest };
        Ok(IpParameters {
            mac: fields.field(MAC)?.copied(),
            address: fields.address(ADDRESS)?,
            mask: fields.address(MASK)?,
            gateway: fields.address(GATEWAY)?,
            dns: fields.address(DNS)?,
            name: fields.name(),
        })
    }

    /// Writes all fields, with zeros for absent fields: some SubDevices ignore fields that follow an absent field.
    pub(super) fn encode(&self, writer: &mut FieldWriter<'_>) -> Option<()> {
        let present = [
            (self.mac.is_some(), MAC),
            (self.address.is_some(), ADDRESS),
            (self.mask.is_some(), MASK),
            (self.gateway.is_some(), GATEWAY),
            (self.dns.is_some(), DNS),
            (self.name.is_some(), NAME),
        ];
        writer.put_u32(present.iter().filter(|(set, _)| *set).fold(0, |flags, (_, bit)| flags | bit))?;
        writer.put(&self.mac.unwrap_or_default())?;
        for address in [self.address, self.mask, self.gateway, self.dns] {
            let mut octets = address.map(|address| address.octets()).unwrap_or_default();
            octets.reverse();
            writer.put(&octets)?;
        }
        let mut padded = [0; MAX_NAME];
        let name = self.name.unwrap_or_default();
        padded.get_mut(..name.len())?.copy_from_slice(name);
        writer.put(&padded)
    }
}

/// Reads the fields one after the other.
struct Fields<'a> {
    flags: u32,
    fixed: bool,
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    fn field<const N: usize>(&mut self, bit: u32) -> Result<Option<&'a [u8; N]>, PayloadError> {
        let present = self.flags & bit != 0;
        if !present && !self.fixed {
            return Ok(None);
        }
        let (field, rest) = split(self.rest, "EoE IP parameter")?;
        self.rest = rest;
        Ok(present.then_some(field))
    }

    fn address(&mut self, bit: u32) -> Result<Option<Ipv4Addr>, PayloadError> {
        Ok(self.field::<4>(bit)?.map(|&[d, c, b, a]| Ipv4Addr::new(a, b, c, d)))
    }

    /// A name ends at NUL or at the end of the message.
    fn name(&self) -> Option<&'a [u8]> {
        let bytes = self.rest.get(..MAX_NAME).unwrap_or(self.rest);
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        (self.flags & NAME != 0).then_some(&bytes[..end])
    }
}
