//! The diagnosis history of the MainDevice itself, object 0x10F3 (protocol 6.3, 10.2): its entries as bytes, and back.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::coe::{DataType, DiagnosisHistory, DiagnosisMessage, DiagnosisParameter};
use ringcat_wire::mailbox::sdo::AbortCode;

use super::catalogue::{PARAMETERS, Values};
use crate::declared::SubDeviceId;
use crate::event::history::{Incident, MESSAGES};
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// All entries; places without a message are empty.
pub(super) fn read(bus: &Bus, segment: Option<&SharedSegment>) -> Values {
    let station = |subdevice: SubDeviceId| {
        let station = segment.and_then(|segment| segment.view().member(subdevice.0).map(|member| member.station));
        station.unwrap_or_default()
    };
    bus.history(|history| {
        let mut values = vec![
            (DiagnosisHistory::MAXIMUM_MESSAGES, vec![MESSAGES]),
            (DiagnosisHistory::NEWEST_MESSAGE, vec![history.newest()]),
            (DiagnosisHistory::NEWEST_ACKNOWLEDGED, vec![history.acknowledged()]),
            (DiagnosisHistory::NEW_AVAILABLE, vec![u8::from(history.has_unacknowledged())]),
            (DiagnosisHistory::FLAGS, history.flags().0.to_le_bytes().to_vec()),
        ];
        values.extend((DiagnosisHistory::FIRST_MESSAGE..).take(MESSAGES.into()).map(|sub_index| {
            let message = history.incident(sub_index);
            (sub_index, message.map_or(Vec::new(), |incident| encode(&incident, incident.subdevice.map(station))))
        }));
        values
    })
}

fn encode(incident: &Incident, station: Option<StationAddress>) -> Vec<u8> {
    let station = station.unwrap_or_default().0.to_le_bytes();
    let detail = incident.detail.to_le_bytes();
    let mut parameters = [0; PARAMETERS];
    let mut length = 0;
    for parameter in [
        DiagnosisParameter::Value(DataType::UNSIGNED16, &station),
        DiagnosisParameter::Value(DataType::UNSIGNED32, &detail),
    ] {
        length += parameter.encode(&mut parameters[length..]).unwrap_or(0);
    }
    let message = DiagnosisMessage {
        code: u32::from(DiagnosisMessage::VENDOR_CODE) | u32::from(incident.number) << 16,
        kind: incident.kind,
        local_time: true,
        reserved: 0,
        text: incident.number,
        time_ns: incident.at.0,
        parameter_count: 2,
        parameters: &parameters[..length],
    };
    let mut bytes = vec![0; DiagnosisMessage::OVERHEAD + PARAMETERS];
    // The buffer has the length of the message.
    let length = message.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(length);
    bytes
}

/// Acknowledges messages, or sets the flags. The data has the length of its entry.
pub(super) fn write(bus: &Bus, sub_index: u8, data: &[u8]) -> Result<(), AbortCode> {
    bus.history(|history| match (sub_index, data) {
        (DiagnosisHistory::NEWEST_ACKNOWLEDGED, [newest, ..]) => history.acknowledge(*newest),
        (DiagnosisHistory::FLAGS, [low, high, ..]) => history.set_flags(u16::from_le_bytes([*low, *high])),
        _ => Err(AbortCode::READ_ONLY),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Instant;
    use ringcat_wire::mailbox::coe::DiagnosisKind;

    // covers: 6.3
    #[test]
    fn a_message_has_these_bytes() {
        let incident = Incident {
            at: Instant(0x0102),
            kind: DiagnosisKind::Error,
            number: 3,
            subdevice: Some(SubDeviceId(4)),
            detail: 0x1B,
        };
        assert_eq!(
            encode(&incident, Some(StationAddress(0x1005))),
            [
                0x00, 0xE8, 0x03, 0x00, 0x12, 0x02, 0x03, 0x00, 0x02, 0x01, 0, 0, 0, 0, 0, 0, 0x06, 0x00, 0x05, 0x10,
                0x07, 0x00, 0x1B, 0, 0, 0
            ]
        );
    }
}
