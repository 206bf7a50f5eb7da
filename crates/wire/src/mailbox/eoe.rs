//! EoE: Ethernet frames in fragments, and IP parameters and address filter of a SubDevice (protocol 6.5).
//!
//! Converts the payload of a mailbox message of protocol EoE. MainDevice and SubDevice fragment and reassemble frames;
//! [`EoeFragment::max_data`] returns the data bytes of a fragment.

mod filter;
mod fragment;
mod head;
mod ip;
mod result;

use super::payload::{FieldWriter, PayloadError, split};
use head::{
    FRAGMENT, GET_FILTER_REQUEST, GET_FILTER_RESPONSE, GET_IP_REQUEST, GET_IP_RESPONSE, KIND, LAST, PORT_SHIFT,
    SET_FILTER_REQUEST, SET_FILTER_RESPONSE, SET_IP_REQUEST, SET_IP_RESPONSE, TIME_STAMP_RESPONSE,
};

pub use filter::AddressFilter;
pub use fragment::{BLOCK, EoeFragment};
pub use ip::{IpParameters, MAX_NAME};
pub use result::EoeResult;

/// A message with its port: 0 is the SubDevice itself or any port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EoeMessage<'a> {
    /// Port, 0..=15.
    pub port: u8,
    /// Content.
    pub body: EoeBody<'a>,
}

/// Content of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EoeBody<'a> {
    /// 0: a part of a frame.
    Fragment(EoeFragment<'a>),
    /// 1: time at which the SubDevice sent the frame, if the fragment requested it.
    TimeStamp {
        /// Number of the frame, 0..=15.
        frame: u8,
        /// Lower half of the time, nanoseconds.
        time_ns: u32,
    },
    /// 2: sets the IP parameters.
    SetIp(IpParameters<'a>),
    /// 3: result of type 2.
    SetIpDone(EoeResult),
    /// 4: sets the address filter.
    SetFilter(AddressFilter),
    /// 5: result of type 4.
    SetFilterDone(EoeResult),
    /// 6: requests the IP parameters.
    GetIp,
    /// 7: the IP parameters.
    Ip(EoeResult, IpParameters<'a>),
    /// 8: requests the address filter.
    GetFilter,
    /// 9: the address filter.
    Filter(EoeResult, AddressFilter),
}

impl<'a> EoeMessage<'a> {
    /// Bytes before the data.
    pub const OVERHEAD: usize = head::OVERHEAD;

    /// Decodes a payload.
    pub fn decode(payload: &'a [u8]) -> Result<EoeMessage<'a>, PayloadError> {
        let (&[a, b, c, d], data) = split(payload, "EoE message")?;
        let (head, word) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        let result = EoeResult(word);
        let body = match head & KIND {
            FRAGMENT => EoeBody::Fragment(EoeFragment::decode(head, word, data)?),
            TIME_STAMP_RESPONSE => {
                let (time, _) = split(data, "EoE time stamp")?;
                EoeBody::TimeStamp { frame: (word >> 12) as u8, time_ns: u32::from_le_bytes(*time) }
            }
            SET_IP_REQUEST => EoeBody::SetIp(IpParameters::decode(data)?),
            SET_IP_RESPONSE => EoeBody::SetIpDone(result),
            SET_FILTER_REQUEST => EoeBody::SetFilter(AddressFilter::decode(data)?),
            SET_FILTER_RESPONSE => EoeBody::SetFilterDone(result),
            GET_IP_REQUEST => EoeBody::GetIp,
            // A response without parameters contains only its result.
            GET_IP_RESPONSE if result != EoeResult::OK && data.is_empty() => {
                EoeBody::Ip(result, IpParameters::default())
            }
            GET_IP_RESPONSE => EoeBody::Ip(result, IpParameters::decode(data)?),
            GET_FILTER_REQUEST => EoeBody::GetFilter,
            GET_FILTER_RESPONSE if result != EoeResult::OK && data.is_empty() => {
                EoeBody::Filter(result, AddressFilter::default())
            }
            GET_FILTER_RESPONSE => EoeBody::Filter(result, AddressFilter::decode(data)?),
            kind => return Err(PayloadError::Code { what: "EoE type", got: kind }),
        };
        Ok(EoeMessage { port: (head >> PORT_SHIFT & 0x0F) as u8, body })
    }

    /// Encodes a payload and returns its length; `None` if it does not fit `out`, or if [`EoeFragment`] or
    /// [`AddressFilter`] cannot be encoded. A port or frame number above 15 loses its upper bits.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        let port = u16::from(self.port & 0x0F) << PORT_SHIFT;
        // All messages are complete, except fragments of a frame with several fragments.
        let mut head = |kind: u16, word: u16| {
            writer.put_u16(kind | port | LAST)?;
            writer.put_u16(word)
        };
        match self.body {
            EoeBody::Fragment(fragment) => return fragment.encode(port, out),
            EoeBody::TimeStamp { frame, time_ns } => {
                head(TIME_STAMP_RESPONSE, u16::from(frame & 0x0F) << 12)?;
                writer.put_u32(time_ns)?;
            }
            EoeBody::SetIp(parameters) => {
                head(SET_IP_REQUEST, 0)?;
                parameters.encode(&mut writer)?;
            }
            EoeBody::SetIpDone(result) => head(SET_IP_RESPONSE, result.0)?,
            EoeBody::SetFilter(filter) => {
                head(SET_FILTER_REQUEST, 0)?;
                filter.encode(&mut writer)?;
            }
            EoeBody::SetFilterDone(result) => head(SET_FILTER_RESPONSE, result.0)?,
            EoeBody::GetIp => head(GET_IP_REQUEST, 0)?,
            EoeBody::Ip(result, parameters) => {
                head(GET_IP_RESPONSE, result.0)?;
                parameters.encode(&mut writer)?;
            }
            EoeBody::GetFilter => head(GET_FILTER_REQUEST, 0)?,
            EoeBody::Filter(result, filter) => {
                head(GET_FILTER_RESPONSE, result.0)?;
                filter.encode(&mut writer)?;
            }
        }
        Some(writer.length())
    }
}

#[cfg(test)]
mod tests;
