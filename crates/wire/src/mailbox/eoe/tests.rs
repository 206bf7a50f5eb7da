use super::*;
use core::net::Ipv4Addr;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

fn encoded(body: EoeBody<'_>) -> Vec<u8> {
    let mut out = [0xEE; 256];
    let length = EoeMessage { port: 0, body }.encode(&mut out).unwrap();
    out[..length].to_vec()
}

fn decoded(bytes: &[u8]) -> EoeMessage<'_> {
    EoeMessage::decode(bytes).unwrap()
}

const FIRST: EoeFragment<'_> =
    EoeFragment { frame: 5, number: 0, blocks: 3, last: false, time_requested: true, time_ns: None, data: &[7; 32] };

// covers: 6.5, codec-mailbox
#[test]
fn fragments_have_the_expected_bytes() {
    let first = encoded(EoeBody::Fragment(FIRST));
    assert_eq!(first[..5], [0x00, 0x04, 0xC0, 0x50, 7]);
    assert_eq!(decoded(&first), EoeMessage { port: 0, body: EoeBody::Fragment(FIRST) });
    let last = EoeFragment {
        number: 1,
        blocks: 1,
        last: true,
        time_requested: false,
        time_ns: Some(0x0403_0201),
        data: &[9; 3],
        ..FIRST
    };
    let message = EoeMessage { port: 2, body: EoeBody::Fragment(last) };
    let mut out = [0; 16];
    let length = message.encode(&mut out).unwrap();
    assert_eq!(out[..length], [0x20, 0x03, 0x41, 0x50, 9, 9, 9, 1, 2, 3, 4]);
    assert_eq!(decoded(&out[..length]), message);
    assert_eq!((FIRST.offset(), last.offset()), (0, 32));
    assert_eq!(message.encode(&mut out[..length - 1]), None);
    let far = EoeFragment { number: 64, ..last };
    assert_eq!(EoeMessage { port: 0, body: EoeBody::Fragment(far) }.encode(&mut out), None);
}

// covers: 6.5
#[test]
fn a_fragment_has_whole_blocks_of_the_mailbox() {
    assert_eq!([128, 1024, 1486, 42, 41, 5].map(EoeFragment::max_data), [96, 992, 1472, 32, 0, 0]);
}

// covers: 6.5, codec-mailbox
#[test]
fn ip_parameters_have_fixed_offsets_and_little_endian_addresses() {
    let parameters = IpParameters {
        mac: Some([2, 0, 0, 0, 0, 1]),
        address: Some(Ipv4Addr::new(192, 168, 0, 1)),
        mask: Some(Ipv4Addr::new(255, 255, 255, 0)),
        gateway: None,
        dns: None,
        name: Some(b"drive"),
    };
    let bytes = encoded(EoeBody::SetIp(parameters));
    assert_eq!(bytes.len(), 4 + 58);
    assert_eq!(bytes[..8], [0x02, 0x01, 0, 0, 0x27, 0, 0, 0]);
    assert_eq!(bytes[8..22], [2, 0, 0, 0, 0, 1, 0x01, 0x00, 0xA8, 0xC0, 0, 255, 255, 255]);
    assert_eq!(bytes[22..36], *b"\0\0\0\0\0\0\0\0drive\0");
    assert_eq!(decoded(&bytes).body, EoeBody::SetIp(parameters));
    let long = IpParameters { name: Some(&[b'x'; 33]), ..parameters };
    assert_eq!(EoeMessage { port: 0, body: EoeBody::SetIp(long) }.encode(&mut [0; 256]), None);
}

// covers: 6.5, codec-mailbox
#[test]
fn packed_ip_parameters_are_decoded() {
    let bytes = [0x02, 0x01, 0, 0, 0x22, 0, 0, 0, 0x01, 0x00, 0xA8, 0xC0, b'a', b'b'];
    let expected =
        IpParameters { address: Some(Ipv4Addr::new(192, 168, 0, 1)), name: Some(b"ab"), ..IpParameters::default() };
    assert_eq!(decoded(&bytes).body, EoeBody::SetIp(expected));
    let short = PayloadError::Short { what: "EoE IP parameter", expected: 4, got: 3 };
    assert_eq!(EoeMessage::decode(&bytes[..11]), Err(short));
}

// covers: 6.5, codec-mailbox
#[test]
fn a_filter_has_sixteen_addresses_and_four_masks() {
    let filter = AddressFilter::new(&[[1; 6], [2; 6]], &[[0xFF; 6]], true).unwrap();
    let bytes = encoded(EoeBody::SetFilter(filter));
    assert_eq!(bytes.len(), 4 + 2 + 96 + 24);
    assert_eq!(bytes[..6], [0x04, 0x01, 0, 0, 0x92, 0x00]);
    assert_eq!((&bytes[6..18], &bytes[102..108]), (&[1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2][..], &[0xFF; 6][..]));
    assert_eq!(decoded(&bytes).body, EoeBody::SetFilter(filter));
    assert_eq!((filter.addresses().len(), filter.masks().len()), (2, 1));
    assert_eq!(AddressFilter::new(&[[0; 6]; 16], &[], false), None);
    assert_eq!(AddressFilter::new(&[], &[[0; 6]; 4], false), None);
}

// covers: 6.5
#[test]
fn requests_and_results_have_the_expected_bytes() {
    let vectors: [(EoeBody<'_>, &[u8]); 5] = [
        (EoeBody::TimeStamp { frame: 5, time_ns: 1 }, &[0x01, 0x01, 0x00, 0x50, 1, 0, 0, 0]),
        (EoeBody::SetIpDone(EoeResult::OK), &[0x03, 0x01, 0, 0]),
        (EoeBody::SetFilterDone(EoeResult::NO_FILTER_SUPPORT), &[0x05, 0x01, 0x01, 0x04]),
        (EoeBody::GetIp, &[0x06, 0x01, 0, 0]),
        (EoeBody::GetFilter, &[0x08, 0x01, 0, 0]),
    ];
    for (body, bytes) in vectors {
        assert_eq!(encoded(body), bytes);
        assert_eq!(decoded(bytes).body, body);
    }
    let body = EoeBody::Ip(EoeResult::OK, IpParameters { mac: Some([1; 6]), ..IpParameters::default() });
    let bytes = encoded(body);
    assert_eq!((&bytes[..5], bytes.len()), (&[0x07, 0x01, 0, 0, 1][..], 62));
    assert_eq!(decoded(&bytes).body, body);
    let refused = EoeBody::Filter(EoeResult::NO_FILTER_SUPPORT, AddressFilter::default());
    assert_eq!(decoded(&[0x09, 0x01, 0x01, 0x04]).body, refused);
    assert_eq!(decoded(&encoded(refused)).body, refused);
    assert_eq!(EoeResult::NO_IP_SUPPORT.to_string(), "0x0201 No IP support");
}

#[test]
fn an_invalid_message_is_refused() {
    let short = PayloadError::Short { what: "EoE message", expected: 4, got: 3 };
    assert_eq!(EoeMessage::decode(&[0, 1, 0]), Err(short));
    assert_eq!(EoeMessage::decode(&[0x0A, 1, 0, 0]).unwrap_err().to_string(), "unknown EoE type 0xa");
    let time = PayloadError::Short { what: "EoE fragment with a time", expected: 4, got: 3 };
    assert_eq!(EoeMessage::decode(&[0, 3, 0, 0, 1, 2, 3]), Err(time));
}

proptest! {
    #[test]
    fn any_bytes_never_panic_and_decoded_messages_read_back(
        kind in 0u8..11,
        rest in proptest::collection::vec(any::<u8>(), 0..140),
    ) {
        let mut bytes = std::vec![kind];
        bytes.extend(rest);
        for length in [bytes.len(), bytes.len() / 2, bytes.len() / 4] {
            if let Ok(message) = EoeMessage::decode(&bytes[..length]) {
                let mut out = [0; 256];
                let written = message.encode(&mut out).unwrap();
                prop_assert_eq!(EoeMessage::decode(&out[..written]), Ok(message));
            }
        }
    }

    // covers: codec-mailbox
    #[test]
    fn any_fragment_reads_back(
        numbers in (0u8..16, 0u8..16, 0u8..64, 0u8..64),
        flags in any::<(bool, bool)>(),
        time_ns in any::<Option<u32>>(),
        data in proptest::collection::vec(any::<u8>(), 0..64),
    ) {
        let (port, frame, number, blocks) = numbers;
        let (last, time_requested) = flags;
        let fragment = EoeFragment { frame, number, blocks, last, time_requested, time_ns, data: &data };
        let message = EoeMessage { port, body: EoeBody::Fragment(fragment) };
        let mut out = [0; 80];
        let written = message.encode(&mut out).unwrap();
        prop_assert_eq!(EoeMessage::decode(&out[..written]), Ok(message));
    }
}
