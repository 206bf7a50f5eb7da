//! Fuzz target for master frames (protocol 9.8).

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::master_frame::{
    ADO, Answer, Area, Diagnosis, DomainRecord, FragmentHead, Header, Lengths, VERSION, fragments_mut,
};

/// A received frame: its fragments, and the content of those that have a fixed form. Only working counters change.
///
/// # Panics
/// When a decoded value changes on its way back, or when something else than a counter has changed.
pub fn target(bytes: &[u8]) {
    let mut frame = bytes.to_vec();
    let mut count = 0;
    for mut fragment in fragments_mut(&mut frame) {
        assert_eq!(FragmentHead::decode(&fragment.head.encode()), fragment.head);
        content(fragment.head.area, fragment.data);
        let before = fragment.wkc();
        fragment.count();
        assert_eq!(fragment.wkc().wrapping_sub(before), fragment.head.area.weight());
        count += 1;
    }
    let changed = bytes.iter().zip(&frame).filter(|(before, after)| before != after).count();
    assert!(changed <= 2 * count && count <= bytes.len() / 24);
}

fn content(area: Area, data: &[u8]) {
    let mut out = [0; 128];
    match area {
        Area::Header => {
            if let Ok(header) = Header::decode(data) {
                header.encode(&mut out).expect("it fits");
                assert_eq!(Header::decode(&out), Ok(header));
            }
        }
        Area::Answer => {
            if let Ok(answer) = Answer::decode(data) {
                answer.encode(&mut out).expect("it fits");
                assert_eq!(Answer::decode(&out), Ok(answer));
                let _ = answer.not_ready.to_string();
            }
        }
        Area::Diagnosis => {
            if let Ok(diagnosis) = Diagnosis::decode(data) {
                diagnosis.encode(&mut out).expect("it fits");
                assert_eq!(out[..Diagnosis::LEN], data[..Diagnosis::LEN]);
                let domains = data[Diagnosis::LEN..].chunks_exact(DomainRecord::LEN);
                domains.for_each(|bytes| assert!(DomainRecord::decode(bytes).is_ok()));
            }
        }
        _ => {}
    }
}

/// A frame with a fragment of each area.
pub(super) fn seeds() -> Vec<Vec<u8>> {
    let mut content = [0; Header::LEN];
    let lengths = Lengths { subdevices: 4, inputs: 4, diagnosis: 57, to_inactive: 4, to_active: 4 };
    let header = Header { lengths, ..Header::default() };
    let header = Header { version: VERSION, least: VERSION, fragments: 8, identity: 7, ..header };
    header.encode(&mut content).expect("it fits");
    let mut answer = [0; Answer::LEN];
    Answer::new().encode(&mut answer).expect("it fits");
    let areas: [(Area, &[u8]); 8] = [
        (Area::Header, &content),
        (Area::SubDevices, &[0x68; 4]),
        (Area::Inputs, &[1, 2, 3, 4]),
        (Area::Diagnosis, &[1; Diagnosis::LEN + DomainRecord::LEN]),
        (Area::ToInactive, b"text"),
        (Area::Knowledge, &[0; 16]),
        (Area::Answer, &answer),
        (Area::ToActive, &[0; 4]),
    ];
    let mut bytes = vec![0; MAX_FRAME];
    let source = MacAddress([0x08, 0x77, 0x0E, 0x01, 0xBD, 0x9A]);
    let mut builder =
        FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, source).expect("it is long enough");
    for (number, (area, data)) in (0..).zip(areas) {
        let head = FragmentHead { area, version: VERSION, number, cycle: 3, offset: 0 };
        let length = FragmentHead::LEN + data.len();
        let at = builder.datagram(Command::Nop, 7, Target::Broadcast(ADO), length).expect("it fits");
        let place = builder.data_mut(at, length).expect("it is there");
        place[..FragmentHead::LEN].copy_from_slice(&head.encode());
        place[FragmentHead::LEN..].copy_from_slice(data);
    }
    let length = builder.finish();
    bytes.truncate(length);
    vec![bytes]
}
