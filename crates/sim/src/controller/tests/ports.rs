//! Ports, loops, DL status, circulation, marks and counters (protocol 2.1 to 2.6).

use super::*;

fn leaves(port: Port, processed: bool) -> Passage {
    Passage::Leaves { port, processed }
}

fn with_links(ports: &[Port]) -> Bench {
    let mut bench = Bench::new();
    bench.link(Port::A, false);
    ports.iter().for_each(|&port| bench.link(port, true));
    bench
}

fn pass(bench: &mut Bench, port: Port) -> Passage {
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
    bench.receive(&mut frame, port)
}

/// A frame that is not EtherCAT.
fn foreign(bench: &mut Bench) -> SimFrame {
    let mut frame = bench.frame(&[(Command::Nop, 0, 0, &[0; 50])]);
    frame.bytes[12..14].copy_from_slice(&[0x08, 0x06]);
    SimFrame::new(frame.id, frame.bytes)
}

// covers: 2.1, sim-frames
#[test]
fn the_order_is_0_epu_3_1_2() {
    use Port::{A, B, C, D};
    let mut bench = with_links(&[A, B, C, D]);
    assert_eq!(pass(&mut bench, A), leaves(D, true));
    assert_eq!(pass(&mut bench, D), leaves(B, false));
    assert_eq!(pass(&mut bench, B), leaves(C, false));
    assert_eq!(pass(&mut bench, C), leaves(A, false));
    let mut bench = with_links(&[A, B]);
    assert_eq!((pass(&mut bench, A), pass(&mut bench, B)), (leaves(B, true), leaves(A, false)));
    assert_eq!(pass(&mut bench, C), Passage::Destroyed);
    let mut bench = with_links(&[A]);
    assert_eq!(pass(&mut bench, A), leaves(A, true));
}

// covers: 2.1
#[test]
fn a_frame_looped_at_closed_port_0_is_processed() {
    let mut bench = with_links(&[Port::B, Port::D]);
    assert_eq!(pass(&mut bench, Port::B), leaves(Port::D, true));
    assert_eq!(pass(&mut bench, Port::D), leaves(Port::B, false));
}

// covers: 1.5
#[test]
fn a_forwarded_frame_is_not_changed() {
    let mut bench = with_links(&[Port::A, Port::B]);
    let mut frame = bench.frame(&[(Command::Bwr, 0, 0x0010, &[1, 0])]);
    let before = frame.clone();
    bench.receive(&mut frame, Port::B);
    assert_eq!((frame, bench.register(0x0010)), (before, [0, 0]));
}

// covers: 2.3, sim-frames
#[test]
fn dl_status_shows_link_loop_and_communication() {
    let high = |ports: &[Port]| with_links(ports).register::<2>(0x0110);
    assert_eq!(high(&[Port::A, Port::B]), [0x37, 0x5A]);
    assert_eq!(high(&[Port::A]), [0x17, 0x56]);
    assert_eq!(high(&[Port::B]), [0x27, 0x59]);
    let mut bench = with_links(&[Port::A, Port::D]);
    bench.write(0x0101, &[0xC0]);
    assert_eq!(bench.register(0x0110), [0x97, 0xD6]);
}

// covers: 2.3, sim-controller
#[test]
fn a_change_of_dl_status_is_an_ecat_event() {
    let mut bench = Bench::new();
    bench.read(0x0110, 2);
    assert_eq!(bench.register(0x0210), [0, 0]);
    bench.link(Port::B, true);
    assert_eq!(bench.register(0x0210), [4, 0]);
}

// covers: 2.2
#[test]
fn auto_close_stays_closed_until_dl_control_is_written_again() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0101, &[0x04]);
    assert_eq!(pass(&mut bench, Port::A), leaves(Port::B, true));
    bench.link(Port::B, false);
    bench.link(Port::B, true);
    assert!(bench.controller.loop_closed(Port::B));
    assert_eq!(pass(&mut bench, Port::A), leaves(Port::A, true));
    bench.write(0x0101, &[0x04]);
    assert!(!bench.controller.loop_closed(Port::B));
}

// covers: 2.2, sim-frames
#[test]
fn auto_close_opens_with_a_valid_frame_on_the_closed_port() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0101, &[0x04]);
    bench.link(Port::B, false);
    bench.link(Port::B, true);
    let mut bad = foreign(&mut bench);
    bad.fcs = Fcs::Bad;
    assert_eq!(bench.receive(&mut bad, Port::B), Passage::Destroyed);
    assert!(bench.controller.loop_closed(Port::B));
    let mut good = foreign(&mut bench);
    assert_eq!(bench.receive(&mut good, Port::B), Passage::Destroyed);
    assert!(!bench.controller.loop_closed(Port::B));
}

// covers: 2.2
#[test]
fn a_forced_open_port_sends_without_link() {
    let mut bench = with_links(&[Port::A]);
    bench.write(0x0101, &[0x08]);
    assert_eq!(pass(&mut bench, Port::A), leaves(Port::B, true));
    assert_eq!(bench.register(0x0110), [0x17, 0x52]);
}

// covers: 2.2
#[test]
fn a_forced_closed_port_accepts_no_frames() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0101, &[0x0C]);
    assert_eq!((pass(&mut bench, Port::A), pass(&mut bench, Port::B)), (leaves(Port::A, true), Passage::Destroyed));
}

// covers: 2.2
#[test]
fn the_frame_that_closes_a_port_still_returns_through_it() {
    let mut bench = with_links(&[Port::A, Port::B]);
    let mut frame = bench.frame(&[(Command::Bwr, 0, 0x0101, &[0x0C])]);
    assert_eq!(bench.receive(&mut frame, Port::A), leaves(Port::B, true));
    assert!(bench.controller.loop_closed(Port::B));
    assert_eq!(bench.receive(&mut frame, Port::B), leaves(Port::A, false));
}

// covers: 2.2, sim-frames
#[test]
fn temporary_loops_end_after_a_second() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0100, &[0x03, 0x0C]);
    bench.wait(Duration::from_millis(999));
    assert!(bench.controller.loop_closed(Port::B));
    bench.wait(Duration::from_millis(1));
    assert!(!bench.controller.loop_closed(Port::B));
    assert_eq!(bench.register(0x0100), [0x01, 0x00, 0x07, 0x00]);
}

// covers: 2.2, sim-frames
#[test]
fn when_all_loops_are_closed_port_0_is_the_return_path() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0101, &[0xFF]);
    assert_eq!(bench.register(0x0110), [0x37, 0x5F]);
    assert_eq!(pass(&mut bench, Port::A), leaves(Port::A, true));
    bench.write(0x0101, &[0x00]);
    assert_eq!(pass(&mut bench, Port::A), leaves(Port::B, true));
}

// covers: 3.1
#[test]
fn a_port_that_does_not_exist_is_closed() {
    let mut bench = Bench::with(ControllerConfig { sii: image(), ..ControllerConfig::default() });
    bench.link(Port::C, true);
    bench.write(0x0101, &[0xA0]);
    assert!(bench.controller.loop_closed(Port::C) && bench.controller.loop_closed(Port::D));
}

// covers: CR-25, 2.4, sim-frames
#[test]
fn auto_closed_port_0_marks_frames_and_destroys_marked_ones() {
    let mut bench = with_links(&[Port::B]);
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0]), (Command::Nop, 0, 0, &[0])]);
    assert_eq!(bench.receive(&mut frame, Port::B), leaves(Port::B, true));
    for place in &frame.datagrams {
        assert_eq!(frame.bytes[usize::from(place.header) + 7] & 0x40, 0x40);
    }
    assert_eq!(returned(&frame, 0).1, 1);
    assert_eq!(bench.receive(&mut frame, Port::B), Passage::Destroyed);
    assert_eq!((bench.register(0x030C), returned(&frame, 0).1), ([1], 1));
}

// covers: 2.4
#[test]
fn port_0_closed_by_force_neither_marks_nor_destroys() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0101, &[0x03]);
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
    for round in 1..=2 {
        assert_eq!(bench.receive(&mut frame, Port::B), leaves(Port::B, true));
        assert_eq!((returned(&frame, 0).1, frame.bytes[23] & 0x40), (round, 0));
    }
}

// covers: SM-06, 2.6, sim-frames
#[test]
fn forwarding_rule_1_marks_ethercat_and_destroys_other_frames() {
    let mut bench = with_links(&[Port::A, Port::B]);
    let mut frame = bench.frame(&[(Command::Nop, 0, 0, &[0])]);
    bench.receive(&mut frame, Port::A);
    assert_eq!(frame.bytes[6], 0x12);
    let mut other = foreign(&mut bench);
    assert_eq!(bench.receive(&mut other, Port::A), Passage::Destroyed);
    assert_eq!(bench.register(0x030C), [1]);
    // Network variables are forwarded; other protocols are forwarded only in the direction without processing unit.
    let mut variables = bench.frame(&[(Command::Nop, 0, 0, &[0])]);
    variables.bytes[15] = 0x40;
    let mut variables = SimFrame::new(variables.id, variables.bytes);
    assert_eq!(bench.receive(&mut variables, Port::A), leaves(Port::B, true));
    let mut other = foreign(&mut bench);
    assert_eq!(bench.receive(&mut other, Port::B), leaves(Port::A, false));
}

// covers: 2.6, sim-frames
#[test]
fn forwarding_rule_0_forwards_all_frames_unmarked() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.write(0x0100, &[0x00]);
    let mut frame = bench.frame(&[(Command::Nop, 0, 0, &[0])]);
    bench.receive(&mut frame, Port::A);
    assert_eq!(frame.bytes[6], 0x10);
    let mut other = foreign(&mut bench);
    let before = other.clone();
    assert_eq!(bench.receive(&mut other, Port::A), leaves(Port::B, true));
    assert_eq!(other, before);
}

// covers: 2.5, sim-counters
#[test]
fn a_symbol_error_in_a_frame_is_counted_once_in_addition_to_the_frame() {
    let (mut first, mut second) = (with_links(&[Port::A, Port::B]), with_links(&[Port::A, Port::B]));
    let mut frame = first.frame(&[(Command::Nop, 0, 0, &[0])]);
    (frame.fcs, frame.symbol_error) = (Fcs::Bad, true);
    first.receive(&mut frame, Port::A);
    second.receive(&mut frame, Port::A);
    // On the return path, another symbol error in a frame that is damaged already.
    frame.symbol_error = true;
    first.receive(&mut frame, Port::B);
    assert_eq!(first.register(0x0300), [1, 1, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0]);
    assert_eq!(second.register(0x0300), [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
}

// covers: 2.5, sim-counters
#[test]
fn the_first_controller_counts_an_invalid_frame_the_next_a_forwarded_error() {
    let (mut first, mut second) = (with_links(&[Port::A, Port::B]), with_links(&[Port::A, Port::B]));
    let mut frame = first.frame(&[(Command::Nop, 0, 0, &[0])]);
    frame.fcs = Fcs::Bad;
    first.receive(&mut frame, Port::A);
    assert_eq!(frame.fcs, Fcs::Marked);
    second.receive(&mut frame, Port::A);
    first.receive(&mut frame, Port::B);
    assert_eq!(first.register(0x0300), [1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0]);
    assert_eq!(second.register(0x0300), [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
    // A write to any counter clears the group and stores nothing.
    assert_eq!(first.write(0x0305, &[0x77]), 1);
    assert_eq!(first.register(0x0300), [0; 12]);
}

// covers: 2.5, sim-counters
#[test]
fn a_lost_link_counts_in_mode_auto_only_and_stops_at_255() {
    let mut bench = with_links(&[Port::A]);
    for _ in 0..300 {
        bench.link(Port::B, true);
        bench.link(Port::B, false);
    }
    assert_eq!(bench.register(0x0310), [1, 0xFF, 0, 0]);
    bench.write(0x0101, &[0x20]);
    bench.link(Port::C, true);
    bench.link(Port::C, false);
    assert_eq!(bench.register(0x0310), [1, 0xFF, 0, 0]);
    bench.write(0x0312, &[1]);
    assert_eq!(bench.register(0x0310), [0; 4]);
}

// covers: 2.5, sim-counters
#[test]
fn groups_of_counters_are_cleared_separately() {
    let mut bench = with_links(&[Port::A]);
    let mut other = foreign(&mut bench);
    bench.receive(&mut other, Port::A);
    bench.write(0x0300, &[0; 8]);
    assert_eq!((bench.register(0x030C), bench.register(0x0310)), ([1], [1, 0, 0, 0]));
    bench.write(0x030C, &[0]);
    assert_eq!((bench.register(0x030C), bench.register(0x0310)), ([0], [1, 0, 0, 0]));
}

// covers: 2.5, sim-counters
#[test]
fn pdi_errors_are_counted_with_their_code_and_any_write_clears_both() {
    let mut bench = with_links(&[Port::A]);
    bench.controller.count_pdi_error(0x04);
    bench.controller.count_pdi_error(0x21);
    assert_eq!(bench.read(0x030D, 2), (vec![2, 0x21], 1));
    bench.write(0x0300, &[0; 13]);
    assert_eq!(bench.register(0x030D), [2, 0x21], "another group");
    bench.write(0x030E, &[0xFF]);
    assert_eq!(bench.register(0x030D), [0, 0]);
    (0..300).for_each(|_| bench.controller.count_pdi_error(0x01));
    assert_eq!(bench.register(0x030D), [0xFF, 0x01]);
}

// covers: 2.8, sim-counters
#[test]
fn dl_status_shows_enhanced_link_detection_of_the_eeprom() {
    for (configuration, shown) in [(0x00, 0), (0x01, 0), (0x02, 4), (0x10, 4), (0x80, 4), (0x0C, 0)] {
        let mut sii = image();
        sii[1] = configuration;
        sign(&mut sii);
        let mut bench = Bench::with(ControllerConfig { sii, ..config() });
        assert_eq!(bench.register(0x0141), [configuration]);
        assert_eq!(bench.register::<1>(0x0110)[0] & 4, shown, "configuration {configuration:#04x}");
        bench.controller.power_on(bench.now);
        assert_eq!(bench.register::<1>(0x0110)[0] & 4, 4, "by default");
        bench.wait(Duration::from_millis(2));
        assert_eq!(bench.register::<1>(0x0110)[0] & 4, shown);
    }
}

// covers: 3.9, sim-counters
#[test]
fn registers_that_are_not_modelled_are_not_accessible() {
    let mut bench = with_links(&[Port::A]);
    assert_eq!(bench.read(0x0510, 12).1, 0, "MII management");
    assert_eq!(bench.write(0x0510, &[0, 1]), 0);
    assert_eq!(bench.register::<1>(0x0502)[0] & 0x20, 0, "no emulated EEPROM");
}

#[test]
fn without_power_frames_are_lost_and_links_are_down() {
    let mut bench = with_links(&[Port::A, Port::B]);
    bench.controller.power_off(bench.now);
    assert_eq!(pass(&mut bench, Port::A), Passage::Destroyed);
    bench.controller.power_on(bench.now);
    assert_eq!(pass(&mut bench, Port::A), Passage::Destroyed);
    assert_eq!(bench.register::<2>(0x0110)[0] & 0xF0, 0);
}

// covers: 2.4
#[test]
fn a_remnant_without_a_c_bit_ends_at_an_auto_closed_port_0() {
    // A cable was cut while the frame passed; in a loop of controllers the remnant would circulate endlessly.
    let mut bench = with_links(&[Port::B, Port::D]);
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
    frame.truncate(20);
    assert_eq!(bench.receive(&mut frame, Port::B), Passage::Destroyed);
    assert_eq!(bench.register(0x030C), [1]);
    let mut bench = with_links(&[Port::A, Port::B]);
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
    frame.truncate(20);
    assert_eq!(bench.receive(&mut frame, Port::A), leaves(Port::B, true));
}
