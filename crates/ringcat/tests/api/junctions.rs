//! Rings behind junctions through the public API: configuration in steps, and the lines of their events.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{
    ActivateError, Declaration, Error, Event, Instant, JunctionConnection, JunctionError, JunctionMode, MainDevice,
    Options, Refused, SubDeviceId, TimedEvent, automatic,
};
use ringcat_engine::{Closing, PortOf};
use ringcat_wire::address::{Position, StationAddress};

const SEGMENT: &str = include_str!("../../../sim/segments/junction-ring.toml");
/// The junction is number 1, the members of its ring are 2 to 4.
const GOOD: JunctionConnection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(4), 1);

fn requested(junctions: JunctionMode) -> MainDevice<SimulatedSegment> {
    let segment = SimulatedSegment::from_toml(SEGMENT).expect("the example is a segment");
    MainDevice::request(segment, &Options::default().with_junctions(junctions))
}

fn junction_error(result: Result<(), Error>) -> JunctionError {
    match result {
        Err(Error::Activate(ActivateError::Junction(error))) => error,
        other => panic!("{other:?}"),
    }
}

fn refused<T: std::fmt::Debug>(
    result: Result<T, Box<Refused<MainDevice<SimulatedSegment>>>>,
) -> (ActivateError, MainDevice<SimulatedSegment>) {
    match result {
        Err(refused) => match *refused {
            Refused { error: Error::Activate(error), main_device, .. } => (error, main_device),
            other => panic!("{other:?}"),
        },
        Ok(application) => panic!("applied: {application:?}"),
    }
}

// covers: JR-05, JR-06, JR-08, junctions
#[test]
fn each_misuse_of_load_add_and_apply_is_an_error_of_its_own() {
    let mut main_device = requested(JunctionMode::Strict);
    assert_eq!(junction_error(main_device.add_junction_connection(GOOD)), JunctionError::NotLoaded);
    let (error, mut main_device) = refused(main_device.apply());
    assert_eq!(error, ActivateError::NotLoaded);

    main_device.load(Declaration::default()).expect("nothing is wrong with nothing");
    let (error, mut main_device) = refused(main_device.apply());
    assert_eq!(error, ActivateError::NoScan);

    let scan = main_device.scan().expect("the segment answers");
    let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
    main_device.load(declaration.clone()).expect("it is what was found");
    let (error, mut main_device) = refused(main_device.apply());
    assert_eq!(error, ActivateError::Junction(JunctionError::NoConnection));

    let head = JunctionConnection::new(SubDeviceId(1), 2, SubDeviceId(4), 1);
    assert_eq!(junction_error(main_device.add_junction_connection(head)), JunctionError::HeadPort(head));
    let tail = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(4), 0);
    assert_eq!(junction_error(main_device.add_junction_connection(tail)), JunctionError::TailPort(tail));
    let unknown = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(6), 1);
    assert_eq!(junction_error(main_device.add_junction_connection(unknown)), JunctionError::UnknownTail(unknown));
    main_device.add_junction_connection(GOOD).expect("it fits");
    assert_eq!(junction_error(main_device.add_junction_connection(GOOD)), JunctionError::Taken(GOOD));
}

// covers: JR-05, JR-06, junctions
#[test]
fn apply_refuses_connections_that_the_segment_does_not_have_and_takes_the_right_one() {
    let mut main_device = requested(JunctionMode::Strict);
    let scan = main_device.scan().expect("the segment answers");
    let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
    // Loading again discards the connections that were added before.
    for (wrong, error) in [
        (JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(0), 2), None),
        (JunctionConnection::new(SubDeviceId(2), 1, SubDeviceId(4), 1), Some((2, 3))),
        (JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(4), 3), Some((4, 3))),
    ] {
        main_device.load(declaration.clone()).expect("it is what was found");
        main_device.add_junction_connection(wrong).expect("it looks as it should");
        let (got, back) = refused(main_device.apply());
        let expected = match error {
            Some((subdevice, port)) => {
                JunctionError::NoSuchPort { connection: wrong, subdevice: SubDeviceId(subdevice), port }
            }
            None => JunctionError::NotBehind(wrong),
        };
        assert_eq!(got, ActivateError::Junction(expected));
        main_device = back;
    }
    // The ports alone allow this connection; apply closes them for a moment to see whether the cable exists.
    let wrong = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);
    main_device.load(declaration.clone()).expect("it is what was found");
    main_device.add_junction_connection(wrong).expect("it looks as it should");
    let (got, mut main_device) = refused(main_device.apply());
    assert!(
        matches!(got, ActivateError::Junction(JunctionError::NotThere { connection, .. }) if connection == wrong),
        "{got:?}"
    );
    let text = got.to_string();
    assert!(text.contains("SubDevice 3 port 1 does not lead back to SubDevice 1 port 1"), "{text}");
    main_device.load(declaration).expect("it is what was found");
    main_device.add_junction_connection(GOOD).expect("it fits");
    let mut application = main_device.apply().expect("it fits");
    for _ in 0..1_000 {
        application.cycle(|_| ());
    }
    assert!(application.all_settled());
    assert!(matches!(application.engine_mut().load(Declaration::default()), Err(ActivateError::NotPermitted(_))));
}

// covers: junctions
#[test]
fn breaks_of_rings_behind_junctions_are_described_in_words() {
    let names = Names(vec!["head".into(), "junction".into(), "first".into(), "second".into()]);
    let port = |node, port| PortOf::new(Position(node as u16), port);
    let words = |event| describe(&TimedEvent::new(Instant(0), event), &names);
    // The places of the scan are not those of the declaration.
    let changed = |broken, breaks| Event::JunctionChanged {
        near: Some(port(5, 1)),
        far: port(6, 0),
        station: Some(StationAddress(0x1004)),
        declared: [Some(SubDeviceId(2)), Some(SubDeviceId(3))],
        broken,
        breaks,
    };
    let place = "between SubDevice 5 \"first\" port 1 and SubDevice 6 \"second\" port 0 (0x1004)";
    assert!(words(changed(true, 1)).starts_with(&format!("Line break {place}")));
    assert_eq!(words(changed(false, 0)), format!("Line is fixed {place}"));
    assert!(words(changed(true, 2)).contains("2 cables"));
    let learned = Event::JunctionLearned { closing: Closing { head: port(1, 1), tail: port(3, 1) } };
    // A scan has no declaration.
    assert!(words(learned).contains("from SubDevice 3 port 1 back to SubDevice 1 port 1"));
    let blocked = |breaks| words(Event::JunctionsBlocked { blocked: true, breaks });
    assert!(blocked(1).contains("no frame comes back while a ring behind a junction is open"));
    assert!(blocked(0).contains("no frame comes back: two rings behind junctions broke at once"));
    assert!(words(Event::JunctionUnknown { rings: 1 }).starts_with("1 rings behind junctions closed"));
}
