//! IP settings of a message of EoE, as files of configuration tools have it (protocol 6.5).

use std::borrow::Cow;

use ringcat_engine::config::IpSettings;
use ringcat_wire::mailbox::eoe::{EoeBody, EoeMessage, IpParameters};

/// EoE type of a Set IP Parameter request.
pub(crate) const SET_IP: u8 = 2;
/// Bytes of the longest message: header, flags, all fields.
const LONGEST: usize = 4 + 4 + 6 + 4 * 4 + NAME;
/// Bytes of the DNS name in the request.
pub(crate) const NAME: usize = 32;

/// The settings of a Set IP Parameter message.
pub(crate) fn settings(data: &[u8]) -> Result<IpSettings, &'static str> {
    match EoeMessage::decode(&with_header(data)) {
        Ok(EoeMessage { body: EoeBody::SetIp(found), .. }) => Ok(IpSettings::default()
            .with_mac(found.mac)
            .with_address(found.address)
            .with_mask(found.mask)
            .with_gateway(found.gateway)
            .with_dns(found.dns)
            .with_name(found.name.map(<[u8]>::to_vec))),
        Ok(_) | Err(_) => Err("a message that does not set addresses (EoE type 2) is not sent"),
    }
}

/// The Set IP Parameter message with these settings, to port 0.
pub(crate) fn message(of: &IpSettings) -> Vec<u8> {
    let fields = IpParameters {
        mac: of.mac,
        address: of.address,
        mask: of.mask,
        gateway: of.gateway,
        dns: of.dns,
        name: of.name.as_deref(),
    };
    let message = EoeMessage { port: 0, body: EoeBody::SetIp(fields) };
    let mut bytes = vec![0; LONGEST];
    let length = message.encode(&mut bytes).unwrap_or_default();
    bytes.truncate(length);
    bytes
}

/// The Set IP Parameter message. Some tools write only the part after the EoE header (protocol 6.5) and leave the
/// header to the MainDevice: flags and the fields that match its length.
fn with_header(data: &[u8]) -> Cow<'_, [u8]> {
    /// Type 2, port 0, no result.
    const HEADER: [u8; 4] = [SET_IP, 0, 0, 0];
    let is_whole = data.first().is_some_and(|kind| kind & 0x0F == SET_IP) && data.get(4..).is_some_and(are_addresses);
    if is_whole || !are_addresses(data) {
        return Cow::Borrowed(data);
    }
    Cow::Owned([&HEADER, data].concat())
}

/// Whether the data has the length of flags plus all fields, or plus the fields that the flags name.
fn are_addresses(data: &[u8]) -> bool {
    /// Bytes of MAC address, address, mask, gateway, DNS server, name.
    const FIELDS: [usize; 6] = [6, 4, 4, 4, 4, NAME];
    let Some((flags, fields)) = data.split_first_chunk() else { return false };
    let flags = u32::from_le_bytes(*flags);
    let named = FIELDS.iter().enumerate().filter(|(bit, _)| flags >> bit & 1 != 0);
    let packed: usize = named.map(|(_, bytes)| bytes).sum();
    let all: usize = FIELDS.iter().sum();
    flags != 0 && flags < 1 << FIELDS.len() && (fields.len() == packed || fields.len() == all)
}
