//! Messages of remote access and any bytes: an error, or a message that survives a round trip.

use ringcat_control::remote::{
    LONGEST_ANSWER, LONGEST_QUERY, REMOTE_VERSION, RemoteAnswer, RemoteQuery, RemoteRole, RemoteState, decode, encode,
};

/// Takes a message from bytes as they are, and from the same as content behind a header that fits.
pub fn target(bytes: &[u8]) {
    check(bytes);
    let length = (bytes.len() as u32).to_le_bytes();
    check(&[b"RCRA", &REMOTE_VERSION.to_le_bytes()[..], &[0; 2], &length, bytes].concat());
}

fn check(bytes: &[u8]) {
    if let Ok(Some((query, length))) = decode::<RemoteQuery>(bytes, LONGEST_QUERY) {
        assert!(length <= bytes.len());
        let again = encode(&query).expect("it is short");
        assert_eq!(decode(&again, LONGEST_QUERY), Ok(Some((query, again.len()))));
    }
    if let Ok(Some((answer, length))) = decode::<RemoteAnswer>(bytes, LONGEST_ANSWER) {
        assert!(length <= bytes.len());
        let again = encode(&answer).expect("it is short");
        assert_eq!(decode(&again, LONGEST_ANSWER * 2), Ok(Some((answer, again.len()))));
    }
}

/// One message of each kind.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut state = RemoteState::default();
    (state.is_active, state.ring) = (true, "closed".to_owned());
    state.not_ready.push("no guard".to_owned());
    state.subdevices.push("OP".to_owned());
    let queries = [
        RemoteQuery::Hello { token: "0123456789abcdef".to_owned() },
        RemoteQuery::State,
        RemoteQuery::Request { role: RemoteRole::HandOver, force: true },
        RemoteQuery::Hold { held: true, force: false },
    ];
    let answers = [
        RemoteAnswer::Welcome("0.1.0".to_owned()),
        RemoteAnswer::State(Box::new(state)),
        RemoteAnswer::Done,
        RemoteAnswer::Refused("another token".to_owned()),
    ];
    let queries = queries.iter().map(|query| encode(query).expect("it is short"));
    queries.chain(answers.iter().map(|answer| encode(answer).expect("it is short"))).collect()
}
