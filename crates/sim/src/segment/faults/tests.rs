use std::path::Path;

use ringcat_wire::address::RegisterAddress;

use crate::cable::DeviceIndex;
use crate::network::Network;
use crate::segment::Segment;
use crate::time::SimTime;

// covers: sim-files, sim-faults
#[test]
fn faults_of_a_file_happen_at_their_times() {
    let text = r#"
        [segment]
        ring = true
        link_down_delay_us = 0

        [[device]]
        type = "coupler"

        [[device]]
        type = "digital-output-8"
        name = "lamps"

        [[fault]]
        at_ms = 2
        cut = 1

        [[fault]]
        at_ms = 3.5
        heal = 1

        [[fault]]
        at_ms = 5
        power_off = "lamps"

        [[fault]]
        at_ms = 6
        power_on = "lamps"
        "#;
    let segment = Segment::from_toml(text, Path::new("nowhere")).unwrap();
    let mut network = Network::from_description(segment).unwrap();
    let mut linked = |us| {
        network.advance(SimTime::from_micros(us));
        // DL status 0x0110: bit 5 is the link of port 1.
        network.device(DeviceIndex(0)).controller.register(RegisterAddress(0x0110), 1)[0] & 1 << 5 != 0
    };
    let seen = [1_999, 2_001, 3_499, 3_600, 4_999, 5_001, 5_999, 6_100].map(&mut linked);
    assert_eq!(seen, [true, false, false, true, true, false, false, true]);
}
