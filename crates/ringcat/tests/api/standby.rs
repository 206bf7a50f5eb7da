//! Simulated segments with links of a second MainDevice, in each form of links: it is INACTIVE and forwards.

use std::time::{Duration, Instant};

use ringcat::piped::PipedLinks;
use ringcat::piped::segment::{PipedSegment, connect};
use ringcat::shared_segment::SharedSegment;
use ringcat::{Link, Links};
use ringcat_sim::cable::Host;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;

const LIMIT: Duration = Duration::from_secs(10);

/// A coupler between two MainDevices.
fn ring_of_two() -> Network {
    let coupler = ringcat_sim::catalogue::by_name("coupler").expect("the catalogue has it");
    SegmentBuilder::ring_of_two(vec![Device::new(coupler)], Host::First).build().expect("the cables fit")
}

/// A BRD of the cyclic class, on the main link; on which link it comes back, and its marks.
fn round_trip(links: &mut impl Links, mut meanwhile: impl FnMut()) -> (Link, u8) {
    let mut frame = [0; 60];
    frame[6..12].copy_from_slice(&[0, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
    frame[12..18].copy_from_slice(&[0x88, 0xA4, 0x0D, 0x10, 7, 0]);
    frame[22] = 1;
    links.send(Link::Main, &frame);
    let end = Instant::now() + LIMIT;
    let mut back = None;
    while back.is_none() {
        assert!(Instant::now() < end, "it comes back");
        meanwhile();
        let until = links.now() + Duration::from_millis(1);
        links.wait(until);
        links.receive(&mut |link, frame| back = Some((link, frame[6] & !0x02)));
    }
    back.expect("it is back")
}

// covers: standby
#[test]
fn the_standby_of_a_shared_segment_forwards() {
    let (mut cyclic, _acyclic) = SharedSegment::halves(ring_of_two());
    assert_eq!(round_trip(&mut cyclic, || ()), (Link::Redundant, 0x04));
}

// covers: standby
#[test]
fn the_standby_of_a_segment_behind_pipes_forwards() {
    let mut segment = PipedSegment::new(ring_of_two());
    let (near, far) = connect(segment.is_ring()).expect("there are descriptors");
    segment.connect(far);
    let mut links = PipedLinks::adopt(near.cyclic.0, near.cyclic.1).expect("they are pipes");
    assert_eq!(round_trip(&mut links, || segment.turn()), (Link::Redundant, 0x04));
}
