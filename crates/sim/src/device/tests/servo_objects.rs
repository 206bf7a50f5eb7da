//! The objects of the drive and of analogue terminals: objects used by drivers exist, are described, and check their
//! values.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::{
    AccessRights, DataType, EntryDescription, EntryRequest, InformationOpcode, ObjectDescription, SdoInformation,
    ValueInfo,
};
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::register::map;

use super::client::Client;
use crate::catalogue;

fn information(client: &mut Client, opcode: InformationOpcode, data: &[u8]) -> (InformationOpcode, Vec<u8>) {
    let mut payload = [0; 64];
    let message = SdoInformation { opcode, fragments_left: 0, data, incomplete: false };
    let length = message.encode(&mut payload).unwrap();
    client.post(Protocol::Coe, &payload[..length]);
    let mut all = Vec::new();
    loop {
        let (_, payload) = client.answer();
        let message = SdoInformation::decode(&payload).unwrap();
        all.extend_from_slice(message.data);
        if message.fragments_left == 0 {
            return (message.opcode, all);
        }
    }
}

// covers: sim-drive
#[test]
fn the_drive_has_the_objects_that_drivers_read() {
    let mut client = Client::new("servo", AlState::PreOp);
    let variables = [
        (0x603F, DataType::UNSIGNED16),
        (0x6040, DataType::UNSIGNED16),
        (0x6041, DataType::UNSIGNED16),
        (0x605A, DataType::INTEGER16),
        (0x605B, DataType::INTEGER16),
        (0x605C, DataType::INTEGER16),
        (0x605D, DataType::INTEGER16),
        (0x605E, DataType::INTEGER16),
        (0x6060, DataType::INTEGER8),
        (0x6061, DataType::INTEGER8),
        (0x6064, DataType::INTEGER32),
        (0x6065, DataType::UNSIGNED32),
        (0x606C, DataType::INTEGER32),
        (0x6071, DataType::INTEGER16),
        (0x6072, DataType::UNSIGNED16),
        (0x6077, DataType::INTEGER16),
        (0x607A, DataType::INTEGER32),
        (0x607C, DataType::INTEGER32),
        (0x607F, DataType::UNSIGNED32),
        (0x6080, DataType::UNSIGNED32),
        (0x6081, DataType::UNSIGNED32),
        (0x6083, DataType::UNSIGNED32),
        (0x6084, DataType::UNSIGNED32),
        (0x6085, DataType::UNSIGNED32),
        (0x6087, DataType::UNSIGNED32),
        (0x6098, DataType::INTEGER8),
        (0x609A, DataType::UNSIGNED32),
        (0x60B0, DataType::INTEGER32),
        (0x60B1, DataType::INTEGER32),
        (0x60B2, DataType::INTEGER16),
        (0x60F4, DataType::INTEGER32),
        (0x60FF, DataType::INTEGER32),
        (0x6502, DataType::UNSIGNED32),
    ];
    for (index, data_type) in variables {
        let (opcode, data) = information(&mut client, InformationOpcode::ObjectRequest, &u16::to_le_bytes(index));
        assert_eq!(opcode, InformationOpcode::ObjectResponse, "{index:#06x}");
        let object = ObjectDescription::decode(&data).unwrap();
        assert_eq!((object.data_type, object.max_sub_index), (data_type, 0), "{index:#06x}");
    }
    for (index, last) in [(0x1C32, 10), (0x1C33, 10), (0x607D, 2), (0x6099, 2), (0x60C2, 2), (0x60E3, 6)] {
        assert_eq!(client.upload(index, 0), Ok(vec![last]), "{index:#06x}");
    }
    assert_eq!(client.upload(0x1000, 0), Ok(vec![0x92, 0x01, 0x02, 0x00]), "servo drive of CiA 402");
    assert_eq!(client.upload(0x6502, 0), Ok(vec![0xAD, 0x03, 0, 0]), "modes 1, 3, 4, 6, 8, 9, 10");
}

// covers: sim-drive
#[test]
fn invalid_values_are_refused_with_their_abort_code() {
    use AbortCode as A;
    let mut client = Client::new("servo", AlState::PreOp);
    type Row = (u16, u8, i64, usize, Result<(), AbortCode>);
    let table: [Row; 20] = [
        (0x6060, 0, 8, 1, Ok(())),
        (0x6060, 0, 2, 1, Err(A::VALUE_RANGE)),
        (0x6060, 0, -1, 1, Err(A::VALUE_RANGE)),
        (0x6098, 0, 17, 1, Ok(())),
        (0x6098, 0, 1, 1, Err(A::VALUE_RANGE)),
        (0x605A, 0, 4, 2, Err(A::VALUE_RANGE)),
        (0x605A, 0, 7, 2, Ok(())),
        (0x605E, 0, 4, 2, Err(A::VALUE_TOO_HIGH)),
        (0x605D, 0, 0, 2, Err(A::VALUE_TOO_LOW)),
        (0x6072, 0, 3_001, 2, Err(A::VALUE_TOO_HIGH)),
        (0x6071, 0, -3_001, 2, Err(A::VALUE_TOO_LOW)),
        (0x6084, 0, 0, 4, Err(A::VALUE_TOO_LOW)),
        (0x6099, 1, 0, 4, Err(A::VALUE_TOO_LOW)),
        (0x60C2, 2, 1, 1, Err(A::VALUE_TOO_HIGH)),
        (0x1C32, 1, 3, 2, Err(A::VALUE_RANGE)),
        (0x607A, 0, 1, 2, Err(A::LENGTH_TOO_SHORT)),
        (0x6060, 0, 8, 2, Err(A::LENGTH_TOO_LONG)),
        (0x6041, 0, 0, 2, Err(A::READ_ONLY)),
        (0x6079, 0, 0, 4, Err(A::OBJECT_DOES_NOT_EXIST)),
        (0x607D, 3, 0, 4, Err(A::SUB_INDEX_DOES_NOT_EXIST)),
    ];
    for (index, sub_index, value, length, expected) in table {
        let done = client.download(index, sub_index, &value.to_le_bytes()[..length]).map(drop);
        assert_eq!(done, expected, "{index:#06x}:{sub_index} = {value}");
    }
    assert_eq!(client.upload(0x6060, 0), Ok(vec![8]), "refused values change nothing");
}

// covers: sim-drive
#[test]
fn outputs_are_mapped_to_rx_pdos_and_inputs_to_tx_pdos() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.download(0x1601, 0, &[0]).unwrap();
    client.download(0x1A01, 0, &[0]).unwrap();
    assert_eq!(client.download(0x1601, 1, &0x6041_0010u32.to_le_bytes()), Err(AbortCode::CANNOT_BE_MAPPED));
    assert_eq!(client.download(0x1A01, 1, &0x6040_0010u32.to_le_bytes()), Err(AbortCode::CANNOT_BE_MAPPED));
    assert_eq!(client.download(0x1601, 1, &0x6071_0010u32.to_le_bytes()), Ok(Vec::new()));
    assert_eq!(client.download(0x1A01, 1, &0x6077_0010u32.to_le_bytes()), Ok(Vec::new()));
}

// covers: sim-drive
#[test]
fn entries_are_described_with_unit_default_and_range() {
    let mut client = Client::new("servo", AlState::PreOp);
    let mut entry = |index, sub_index| {
        let request = EntryRequest { index, sub_index, value_info: ValueInfo::ALL }.encode();
        information(&mut client, InformationOpcode::EntryRequest, &request).1
    };
    let bytes = entry(0x6066, 0);
    let time_out = EntryDescription::decode(&bytes).unwrap();
    assert_eq!((time_out.unit, time_out.default), (Some(0xFD03), Some(&[10, 0][..])), "10 ms");
    assert!(time_out.access.has(AccessRights::READ | AccessRights::WRITE | AccessRights::SETTING));
    let bytes = entry(0x6072, 0);
    let torque = EntryDescription::decode(&bytes).unwrap();
    assert_eq!((torque.minimum, torque.maximum), (Some(&[0, 0][..]), Some(&[0xB8, 0x0B][..])));
    assert!(torque.access.has(AccessRights::RX_MAPPABLE) && torque.name == b"Max torque");
    let bytes = entry(0x607D, 2);
    assert_eq!(EntryDescription::decode(&bytes).unwrap().name, b"Max position limit");
    let bytes = entry(0x6041, 0);
    let status = EntryDescription::decode(&bytes).unwrap();
    assert!(status.access.has(AccessRights::READ | AccessRights::TX_MAPPABLE));
    assert!(!status.access.has(AccessRights::WRITE_PREOP));
}

// covers: sim-drive
#[test]
fn sync_parameters_follow_the_distributed_clocks() {
    let mut client = Client::new("servo", AlState::PreOp);
    client.bench.set_process_data();
    client.bench.request(AlState::SafeOp);
    assert_eq!(client.upload(0x1C32, 1), Ok(vec![1, 0]), "without SYNC signals");
    assert_eq!(client.upload(0x1C32, 10), Ok(vec![0; 4]));
    client.bench.request(AlState::PreOp);
    client.bench.write(map::DC_SYNC0_CYCLE, &2_000_000u32.to_le_bytes());
    client.bench.write(map::DC_ACTIVATION, &[3]);
    client.bench.request(AlState::SafeOp);
    for object in [0x1C32, 0x1C33] {
        assert_eq!(client.upload(object, 1), Ok(vec![2, 0]), "SYNC0");
        assert_eq!(client.upload(object, 2), Ok(2_000_000u32.to_le_bytes().to_vec()));
        assert_eq!(client.upload(object, 10), Ok(2_000_000u32.to_le_bytes().to_vec()));
    }
    client.bench.request(AlState::PreOp);
    client.bench.write(map::DC_ACTIVATION, &[0]);
    client.bench.request(AlState::SafeOp);
    assert_eq!(client.upload(0x1C33, 1), Ok(vec![1, 0]));
}

// covers: sim-drive
#[test]
fn without_process_data_the_drive_still_reports_its_status() {
    let mut client = Client::new("servo", AlState::PreOp);
    assert_eq!(client.upload(0x6041, 0), Ok(vec![0x50, 0x00]), "switch on disabled");
    assert_eq!(client.upload(0x60FE, 1), Ok(vec![1, 0, 0, 0]), "brake closed");
}

// covers: sim-drive
#[test]
fn a_device_has_the_name_of_its_type_not_of_its_segment() {
    for kind in ["servo", "analog-input-4", "all-protocols"] {
        let mut described = catalogue::by_name(kind).unwrap();
        described.name = "axis-7".into();
        let mut client = Client::of(described, AlState::PreOp);
        assert_eq!(client.upload(0x1008, 0), Ok(kind.as_bytes().to_vec()));
    }
}

// covers: sim-drive
#[test]
fn analogue_terminals_describe_their_objects_like_real_ones() {
    for (name, index, expected) in
        [("analog-input-4", 0x6000u16, "Channel 1"), ("analog-output-4", 0x7010, "Channel 2")]
    {
        let mut client = Client::new(name, AlState::PreOp);
        let beyond = EntryRequest { index: 0x1018, sub_index: 5, value_info: ValueInfo::ALL }.encode();
        let (opcode, data) = information(&mut client, InformationOpcode::EntryRequest, &beyond);
        assert_eq!((opcode, data), (InformationOpcode::Error, vec![0x11, 0, 0x09, 0x06]), "after the last entry");
        let (opcode, list) = information(&mut client, InformationOpcode::ListRequest, &[1, 0]);
        assert_eq!(opcode, InformationOpcode::ListResponse, "{name}");
        let objects: Vec<u16> = list[2..].chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        assert!(objects.contains(&index) && objects.contains(&0x1018), "{name}: {objects:x?}");
        for object in objects {
            let (opcode, data) = information(&mut client, InformationOpcode::ObjectRequest, &object.to_le_bytes());
            assert_eq!(opcode, InformationOpcode::ObjectResponse, "{name} {object:#06x}");
            let described = ObjectDescription::decode(&data).unwrap();
            assert!(!described.name.is_empty(), "{name} {object:#06x}");
            assert!(object != index || described.name == expected.as_bytes(), "{name} {object:#06x}");
            for sub_index in 0..=described.max_sub_index {
                let request = EntryRequest { index: object, sub_index, value_info: ValueInfo::ALL }.encode();
                let (opcode, data) = information(&mut client, InformationOpcode::EntryRequest, &request);
                assert_eq!(opcode, InformationOpcode::EntryResponse, "{name} {object:#06x}:{sub_index}");
                let entry = EntryDescription::decode(&data).unwrap();
                if client.upload(object, sub_index) == Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST) {
                    let gap = (entry.data_type, entry.bit_length, entry.access);
                    assert_eq!(gap, (DataType(0), 0, AccessRights(0)), "{name} {object:#06x}:{sub_index}");
                    continue;
                }
                assert!(entry.access.has(AccessRights::READ_PREOP) && !entry.name.is_empty(), "{object:#06x}");
            }
        }
    }
}
