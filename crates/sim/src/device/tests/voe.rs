//! Protocol 6.8 from the view of a MainDevice, and all protocols together.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::{Idn, SoeElements, SoeMessage, SoeOperation};
use ringcat_wire::mailbox::voe::VoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Header, Protocol, next_counter};

use super::client::{ANSWER, Client};
use crate::catalogue::{self, VENDOR_ID};

fn message(vendor_id: u32, data: &[u8]) -> Vec<u8> {
    let mut payload = vec![0; 6 + data.len()];
    VoeMessage { vendor_id, vendor_type: 7, data }.encode(&mut payload).unwrap();
    payload
}

// covers: 6.8, sim-mailbox
#[test]
fn messages_of_the_vendor_are_echoed() {
    let mut client = Client::new("all-protocols", AlState::PreOp);
    for size in [0, 1, 1012] {
        let payload = message(VENDOR_ID, &vec![0xA5; size]);
        client.post(Protocol::Voe, &payload);
        let (header, answer) = client.answer();
        assert_eq!((header.protocol, answer), (Protocol::Voe, payload));
    }
    client.post(Protocol::Voe, &message(1, b"not for you"));
    let (header, answer) = client.answer();
    assert_eq!(header.protocol, Protocol::Error);
    assert_eq!(ErrorReply::decode(answer.first_chunk().unwrap()).detail, ErrorReply::SERVICE_NOT_SUPPORTED);
}

// covers: 6.1, robust, sim-mailbox
#[test]
fn several_protocols_answer_in_the_order_of_the_requests() {
    let mut client = Client::new("all-protocols", AlState::PreOp);
    let mut read = [0; 4];
    let request = SoeMessage::whole(SoeOperation::ReadRequest, 0, SoeElements::VALUE, Idn::standard(0, 11), &[]);
    request.encode(&mut read).unwrap();
    let requests: [(Protocol, &[u8]); 4] = [
        (Protocol::Coe, &[0, 0x20, 0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
        (Protocol::Soe, &read),
        (Protocol::Foe, b"\x01\0\0\0\0\0nothing"),
        (Protocol::Voe, &message(VENDOR_ID, b"x")),
    ];
    for (protocol, payload) in requests {
        client.post(protocol, payload);
    }
    client.bench.pass(ANSWER);
    let mut counter = 0;
    for (protocol, _) in requests {
        counter = next_counter(counter);
        let (header, _) = client.bench.fetch_mail().unwrap();
        assert_eq!((header.protocol, header.counter), (protocol, counter));
    }
}

// covers: 6.1, robust, sim-mailbox
#[test]
fn a_protocol_missing_in_the_sii_is_refused() {
    for name in ["servo", "ethernet-terminal", "soe-drive"] {
        let protocols = catalogue::by_name(name).unwrap().mailbox.unwrap().protocols;
        let mut client = Client::new(name, AlState::PreOp);
        for (protocol, announced) in [
            (Protocol::Aoe, protocols.aoe()),
            (Protocol::Eoe, protocols.eoe()),
            (Protocol::Coe, protocols.coe()),
            (Protocol::Foe, protocols.foe()),
            (Protocol::Soe, protocols.soe()),
            (Protocol::Voe, protocols.voe()),
            (Protocol::Other(9), false),
        ] {
            client.counter = next_counter(client.counter);
            // A length that is too short for every protocol.
            let header = Header::new(protocol, client.counter, 1);
            assert!(client.bench.send_mail(header, &[0]));
            let (header, payload) = client.answer();
            assert_eq!(header.protocol, Protocol::Error, "{name} {protocol}");
            let detail = ErrorReply::decode(payload.first_chunk().unwrap()).detail;
            let expected = if announced { ErrorReply::SIZE_TOO_SHORT } else { ErrorReply::UNSUPPORTED_PROTOCOL };
            assert_eq!(detail, expected, "{name} {protocol}");
        }
    }
}
