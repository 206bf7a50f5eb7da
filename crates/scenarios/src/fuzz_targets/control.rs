//! Messages of the daemon and any bytes: an error, or a message that survives a round trip.

use ringcat_control::message::{
    Answer, HandedBus, HandedLink, HandedLinks, Numbered, Query, Right, ToolAnswer, ToolQuery,
};
use ringcat_control::wire::{decode, encode};
use ringcat_control::{Content, Limits, Message, Refusal, VERSION};

/// Takes a message from bytes as they are, and from the same as content behind a header that fits.
pub fn target(bytes: &[u8]) {
    check(bytes);
    let length = (bytes.len() as u32).to_le_bytes();
    check(&[b"RCTL", &VERSION.to_le_bytes()[..], &[0; 2], &length, &[0; 4], bytes].concat());
}

fn check(bytes: &[u8]) {
    if let Ok(message) = decode(bytes, Limits::CLIENT) {
        let again = encode(&message).expect("it is short");
        assert_eq!(decode(&again, Limits::OWNER), Ok(message));
    }
}

/// One message of each kind.
pub fn seeds() -> Vec<Vec<u8>> {
    let numbered = |what| Content::Query(Numbered { id: 1, master: 0, what });
    let answered = |what| Content::Answer(Numbered { id: 1, master: 0, what });
    let main = HandedLink::Interface { name: "eth1".to_owned(), slots: 128, absent_mac: Some([2, 0, 0, 0, 0, 1]) };
    let mut handed = HandedBus::new(HandedLinks::new(main, Some(HandedLink::Pipe)));
    (handed.has_lock, handed.can_switch, handed.debug_level) = (true, true, 1);
    handed.interfaces.push("eoe0s1".to_owned());
    let contents = [
        Content::Hello { program: "program".to_owned() },
        Content::Welcome { right: Right::Change, pid: 1 },
        numbered(Query::SdoUpload { position: 1, index: 0x1018, sub_index: None }),
        numbered(Query::Events { from: 7 }),
        numbered(Query::Tool(ToolQuery::FileWrite { position: 1, name: "firmware".to_owned(), transfer: 7 })),
        answered(Ok(Answer::Tool(ToolAnswer::Objects(vec![0x1000, 0x1018])))),
        Content::Underway { id: 1 },
        answered(Ok(Answer::State(Box::default()))),
        answered(Err(Refusal::NoMaster { master: 1, present: vec![0, 2] })),
        Content::Take { master: 0, ethernet: true },
        Content::Taken(handed),
        Content::MakeInterface { name: "eoe0s1".to_owned(), mac: [2, 0, 0, 0, 0, 1] },
        Content::Interface { name: "eoe0s1".to_owned(), fault: Some("taken".to_owned()) },
        Content::SwitchLink { is_redundant: true, up: false },
        Content::Release,
        Content::Refused(Refusal::TooManyClients { limit: 64 }),
    ];
    let message = |content| encode(&Message { content, bytes: vec![1, 2] }).expect("it is short");
    contents.into_iter().map(message).collect()
}
