//! The ring, break and branch vectors of protocol 2.9 and the junction geometry of protocol 9.4, literally.

use ringcat_sim::cable::HostLink::{Main, Redundant};

use crate::wiring::{Journey, cut, journey, ring, segment, travel};

const RING: &str = "main-1.0 1.1-2.0 2.1-3.0 3.1-4.0 4.1-red";

/// The paths of the MAIN and the RED copy after these cuts.
fn copies(cables: &str, cuts: &[&str]) -> [Option<Journey>; 2] {
    let mut network = segment(cables);
    for place in cuts {
        cut(&mut network, place);
    }
    [travel(&mut network, Main), travel(&mut network, Redundant)]
}

// covers: CR-02, CR-03, sim-frames
#[test]
fn an_intact_ring_is_processed_once_and_crossed_once() {
    let [main, red] = copies(RING, &[]);
    assert_eq!(main, journey(Redundant, &[1, 2, 3, 4], 0x02, false));
    assert_eq!(red, journey(Main, &[], 0x08, false));
}

#[test]
fn a_break_in_the_middle_returns_each_copy_with_its_half() {
    let [main, red] = copies(RING, &["2.1"]);
    assert_eq!(main, journey(Main, &[1, 2], 0x02, false));
    assert_eq!(red, journey(Redundant, &[3, 4], 0x0A, true));
}

#[test]
fn a_break_at_the_main_link_leaves_all_subdevices_to_the_red_copy() {
    let [main, red] = copies(RING, &["main"]);
    assert_eq!(main, None);
    assert_eq!(red, journey(Redundant, &[1, 2, 3, 4], 0x0A, true));
}

#[test]
fn a_break_at_the_redundant_link_leaves_all_subdevices_to_the_main_copy() {
    let [main, red] = copies(RING, &["red"]);
    assert_eq!(main, journey(Main, &[1, 2, 3, 4], 0x02, false));
    assert_eq!(red, None);
}

#[test]
fn two_breaks_isolate_the_subdevices_between_them() {
    let [main, red] = copies(RING, &["2.1", "3.1"]);
    assert_eq!(main, journey(Main, &[1, 2], 0x02, false));
    assert_eq!(red, journey(Redundant, &[4], 0x0A, true));
}

#[test]
fn the_main_copy_processes_a_branch_on_port_3() {
    let [main, red] = copies(&format!("{RING} 2.3-5.0"), &[]);
    assert_eq!(main, journey(Redundant, &[1, 2, 5, 3, 4], 0x02, false));
    assert_eq!(red, journey(Main, &[], 0x08, false));
}

// covers: sim-frames
#[test]
fn the_red_copy_processes_a_branch_on_port_2() {
    let branched = format!("{RING} 2.2-5.0");
    let [main, red] = copies(&branched, &[]);
    assert_eq!(main, journey(Redundant, &[1, 2, 3, 4], 0x02, false));
    assert_eq!(red, journey(Main, &[5], 0x0A, false));
    let [main, red] = copies(&branched, &["3.1"]);
    assert_eq!(main, journey(Main, &[1, 2, 3, 5], 0x02, false));
    assert_eq!(red, journey(Redundant, &[4], 0x0A, true));
    let [main, red] = copies(&branched, &["1.1"]);
    assert_eq!(main, journey(Main, &[1], 0x02, false));
    assert_eq!(red, journey(Redundant, &[5, 2, 3, 4], 0x0A, true));
}

// covers: sim-frames
#[test]
fn the_red_copy_processes_a_device_cabled_backwards() {
    let crossed = "main-1.0 1.1-2.0 2.1-3.1 3.0-4.0 4.1-red";
    let [main, red] = copies(crossed, &[]);
    assert_eq!(main, journey(Redundant, &[1, 2, 4], 0x02, false));
    assert_eq!(red, journey(Main, &[3], 0x0A, false));
    let [main, red] = copies("main-1.0 1.1-2.0 2.1-3.1 3.0-4.0", &[]);
    assert_eq!(main, journey(Main, &[1, 2, 4, 3], 0x02, false));
    assert_eq!(red, None);
}

#[test]
fn a_line_that_ends_in_an_unconnected_port_0_sets_the_c_bit() {
    let [main, _] = copies("main-1.0 1.1-2.1 2.0-3.1", &[]);
    assert_eq!(main, journey(Main, &[1, 3, 2], 0x02, true));
}

// covers: CR-02, CR-03, sim-frames
#[test]
fn every_single_break_divides_the_devices_between_the_copies() {
    for count in [1, 2, 5, 16] {
        let mut network = segment(&ring(count));
        for cable in 0..=count {
            let cable = ringcat_sim::cable::CableId(cable);
            network.cut(cable);
            network.advance_by(crate::wiring::SETTLE);
            let processed_by =
                [Main, Redundant].map(|link| travel(&mut network, link).map_or(Vec::new(), |back| back.processed_by));
            let expected: Vec<u16> = (1..=count as u16).collect();
            assert_eq!(processed_by.concat(), expected, "{count} devices, cable {cable:?}");
            network.heal(cable);
            network.advance_by(crate::wiring::SETTLE);
            let [main, red] = [travel(&mut network, Main), travel(&mut network, Redundant)];
            assert_eq!(main, journey(Redundant, &expected, 0x02, false));
            assert_eq!(red, journey(Main, &[], 0x08, false));
        }
    }
}

/// Device 1, then junction 2 with a local ring of 3, 4, 5 from port `start` back to port `back`.
fn junction(start: u8, back: u8) -> String {
    format!("main-1.0 1.1-2.0 2.{start}-3.0 3.1-4.0 4.1-5.0 5.1-2.{back}")
}

#[test]
fn a_local_ring_from_an_earlier_to_a_later_port_is_always_processed() {
    for (start, back) in [(3, 1), (3, 2), (1, 2)] {
        let cables = junction(start, back);
        let all = [1, 2, 3, 4, 5];
        let main = |cuts: &[&str]| copies(&cables, cuts)[0].clone();
        assert_eq!(main(&[]), journey(Main, &all, 0x02, false), "{start} -> {back}");
        for place in ["3.1", "3.0"] {
            assert_eq!(main(&[place]), journey(Main, &all, 0x02, true), "{start} -> {back} cut at {place}");
        }
        // The closing cable: no port 0 is unconnected.
        assert_eq!(main(&["5.1"]), journey(Main, &all, 0x02, false), "{start} -> {back} cut at the end");
    }
}

#[test]
fn a_local_ring_from_a_later_to_an_earlier_port_runs_in_reverse_until_it_breaks() {
    for (start, back) in [(2, 1), (2, 3), (1, 3)] {
        let cables = junction(start, back);
        let main = |cuts: &[&str]| copies(&cables, cuts)[0].clone();
        assert_eq!(main(&[]), journey(Main, &[1, 2], 0x02, false), "{start} -> {back}");
        let broken = main(&["3.1"]).unwrap();
        assert!(broken.circulating);
        let mut processed_by = broken.processed_by.clone();
        processed_by.sort_unstable();
        assert_eq!(processed_by, [1, 2, 3, 4, 5], "{start} -> {back}");
    }
}

// covers: sim-frames
#[test]
fn a_second_broken_local_ring_loses_every_frame() {
    // protocol 9.4, JR-02: two junctions (1 and 2), each with a ring of two from port 1 to port 2.
    let cables = "main-1.0 1.1-3.0 3.1-4.0 4.1-1.2 1.3-2.0 2.1-5.0 5.1-6.0 6.1-2.2";
    let intact = copies(cables, &[])[0].clone();
    assert_eq!(intact, journey(Main, &[1, 2, 5, 6, 3, 4], 0x02, false));
    let once = copies(cables, &["3.1"])[0].clone();
    assert_eq!(once, journey(Main, &[1, 2, 5, 6, 3, 4], 0x02, true));
    assert_eq!(copies(cables, &["3.1", "5.1"])[0], None);
}
