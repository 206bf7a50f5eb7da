//! Frames of one sender on interfaces where they are not expected.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::thread;
use std::time::Duration;

use ringcat_link::listener::{Listener, ReceivedFrame, Sender};

use crate::bench::{Bench, ethercat};

/// The source address of [`ethercat`].
const SENDER: Sender = Sender { address: [0x02, 0, 0, 0, 0, 1], mask: [0, 0, 0, 0xff, 0xff, 0xff] };
/// Longer than any expected wait; a longer wait means that the machine stalls.
const PATIENCE: Duration = Duration::from_millis(500);

/// The first frame that a listener in the near namespace receives when `frames` are sent at the far end.
fn received(bench: &Bench, except: &[&str], frames: &[Vec<u8>]) -> Option<ReceivedFrame> {
    let listener = bench.near.run(|| Listener::open(SENDER, except)).expect("a socket");
    let (end, mut stop) = UnixStream::pair().expect("two sockets");
    let mut far = bench.far_socket();
    frames.iter().for_each(|frame| assert!(far.send(frame)));
    thread::scope(|scope| {
        let receiver = scope.spawn(|| bench.near.run(|| listener.receive(&end)));
        for _ in 0..PATIENCE.as_millis() / 10 {
            if receiver.is_finished() {
                break;
            }
            thread::sleep(Duration::from_millis(10));
        }
        stop.write_all(b"end").expect("the other side is open");
        receiver.join().expect("no panic")
    })
}

// covers: stray-ring-cable
#[test]
fn a_frame_of_the_sender_is_received_with_the_name_of_its_interface() {
    let Some(bench) = Bench::make() else { return };
    let mut other = ethercat(0, 1);
    other[11] ^= 1;
    assert_eq!(received(&bench, &[], &[other.clone()]), None);
    let ours = ethercat(0x85, 2);
    let expected = ReceivedFrame { interface: "near".to_owned(), bytes: ours.clone() };
    assert_eq!(received(&bench, &[], &[other, ours]), Some(expected));
}

#[test]
fn interfaces_that_are_left_out_deliver_no_frames() {
    let Some(bench) = Bench::make() else { return };
    assert_eq!(received(&bench, &["near"], &[ethercat(0, 1)]), None);
}
