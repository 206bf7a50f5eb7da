use std::os::unix::net::UnixStream;
use std::path::Path;

use ringcat::piped::segment::PipedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat_control::Limits;

use super::*;
use crate::owner::for_tests;
use crate::segment_process;

// covers: daemon
#[test]
fn a_thread_that_fails_leaves_the_master_to_the_daemon() {
    let (near, far) = UnixStream::pair().expect("a pair");
    // It ends with the daemon's socket and pipes.
    std::thread::spawn(move || {
        let described = Segment::from_toml("[segment]\n[[device]]\ntype = \"servo\"\n", Path::new("."));
        let network = Network::from_description(described.expect("it is right")).expect("it is right");
        segment_process::serve(&mut PipedSegment::new(network), &far, |_| true).expect("a socket");
    });
    let master = Master::new(0, "test".to_owned(), Wires::to_segment(near).expect("it is right"));
    let (owner, far) = for_tests().expect("a pair");
    let owner = Arc::new(owner);
    let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _tenancy = master.hand_over(&owner).expect("the daemon drives it");
        panic!("expected by the test");
    }));
    assert!(failed.is_err());
    assert!(matches!(owner.ask(Query::State, Vec::new()), Err(Refusal::Changing { .. })));
    let fault = master.state().fault.expect("nothing drives it");
    assert_eq!(fault, FAILED);
    let content = far.receive_with_descriptors(Limits::OWNER, None).expect("the links were sent").0.content;
    assert!(matches!(content, Content::Taken(_)), "{content:?}");
    let content = far.receive(Limits::OWNER, None).expect("it gets a message");
    assert_eq!(content, Content::TakenBack { cause: FAILED.to_owned() }.into());
    master.supervise();
    assert_eq!((master.state().fault, master.state().owner), (None, None));
    master.hand_over(&owner).expect("the daemon drives it").end(End::Ended);
    assert_eq!((master.state().fault, master.state().owner), (None, None));
}
