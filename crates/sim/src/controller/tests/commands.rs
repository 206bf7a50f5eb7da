//! Commands and working counters (protocol 1.4), side effects and a bad FCS (protocol 2.5).

use super::*;

// covers: 1.4
#[test]
fn auto_increment_matches_zero_only_and_counts_up() {
    let mut bench = Bench::new();
    let mut frame = bench.frame(&[(Command::Aprd, 0, 0x0000, &[0xEE]), (Command::Aprd, 0xFFFF, 0x0000, &[0xEE])]);
    bench.receive(&mut frame, Port::A);
    assert_eq!((returned(&frame, 0), returned(&frame, 1)), ((vec![0x11], 1), (vec![0xEE], 0)));
    let adp = |n: usize| {
        let header = usize::from(frame.datagrams[n].header);
        u16::from_le_bytes([frame.bytes[header + 2], frame.bytes[header + 3]])
    };
    assert_eq!((adp(0), adp(1)), (1, 0));
}

// covers: 1.4
#[test]
fn broadcasts_count_up_and_combine_by_or() {
    let mut bench = Bench::new();
    let mut frame = bench.frame(&[(Command::Brd, 7, 0x0000, &[0x40])]);
    bench.receive(&mut frame, Port::A);
    assert_eq!(returned(&frame, 0), (vec![0x51], 1));
    assert_eq!(&frame.bytes[16..20], &[0x07, 0x5A, 0x08, 0x00]);
    assert_eq!(bench.one((Command::Bwr, 3, 0x0010, &[0x01, 0x10])).1, 1);
    assert_eq!(bench.register(0x0010), [0x01, 0x10]);
}

// covers: 1.4
#[test]
fn brw_writes_the_received_data_and_returns_the_or_with_the_old_value() {
    let mut bench = Bench::new();
    bench.write(0x0F80, &[0x0F]);
    assert_eq!(bench.one((Command::Brw, 0, 0x0F80, &[0x30])), (vec![0x3F], 3));
    assert_eq!(bench.register(0x0F80), [0x30]);
}

// covers: 2.7
#[test]
fn station_address_and_enabled_alias_match() {
    let mut bench = Bench::new();
    bench.write(0x0010, &[0x01, 0x10]);
    assert_eq!(bench.one((Command::Fprd, 0x1001, 0x0004, &[0])), (vec![8], 1));
    assert_eq!(bench.one((Command::Fprd, 0x1234, 0x0004, &[0])).1, 0);
    bench.write(0x0103, &[0x01]);
    for command in [Command::Fprd, Command::Fpwr, Command::Fprw, Command::Frmw] {
        let expected = if command == Command::Fprw { 3 } else { 1 };
        assert_eq!(bench.one((command, 0x1234, 0x0F80, &[0])).1, expected, "{command}");
    }
}

// covers: 2.7
#[test]
fn address_0_is_a_station_address_like_others() {
    let mut bench = Bench::new();
    assert_eq!(bench.one((Command::Fprd, 0, 0x0000, &[0])), (vec![0x11], 1));
}

// covers: 1.4, sim-controller
#[test]
fn read_write_takes_the_old_value_and_counts_3() {
    let mut bench = Bench::new();
    bench.write(0x0F90, &[1, 2]);
    assert_eq!(bench.one((Command::Aprw, 0, 0x0F90, &[3, 4])), (vec![1, 2], 3));
    assert_eq!(bench.one((Command::Fprw, 0, 0x0F90, &[5, 6])), (vec![3, 4], 3));
    // Read-only registers increment for the read only, write-only ones for the write only.
    assert_eq!(bench.one((Command::Aprw, 0, 0x0000, &[0x55])), (vec![0x11], 1));
}

// covers: 1.4, sim-controller
#[test]
fn the_physical_offset_moves_the_write_of_read_write_commands() {
    let mut bench = Bench::new();
    bench.write(0x0108, &[0x10, 0x00]);
    bench.one((Command::Fprw, 0, 0x0F90, &[5]));
    assert_eq!((bench.register(0x0F90), bench.register(0x0FA0)), ([0], [5]));
    bench.write(0x0F90, &[9]);
    assert_eq!(bench.register(0x0F90), [9]);
}

// covers: 1.4, sim-controller
#[test]
fn multiple_writes_read_at_the_addressed_and_write_at_the_others() {
    let mut bench = Bench::new();
    bench.write(0x0010, &[0x01, 0x10]);
    bench.write(0x0F80, &[7]);
    assert_eq!(bench.one((Command::Armw, 0, 0x0F80, &[1])), (vec![7], 1));
    assert_eq!(bench.one((Command::Armw, 0xFFF0, 0x0F80, &[2])), (vec![2], 1));
    assert_eq!(bench.one((Command::Frmw, 0x1001, 0x0F80, &[3])), (vec![2], 1));
    assert_eq!(bench.one((Command::Frmw, 0x1002, 0x0F80, &[4])), (vec![4], 1));
    assert_eq!(bench.register(0x0F80), [4]);
}

// covers: 1.4
#[test]
fn nop_and_reserved_commands_change_nothing() {
    let mut bench = Bench::new();
    for command in [Command::Nop, Command::Reserved(15), Command::Reserved(255)] {
        assert_eq!(bench.one((command, 0, 0x0000, &[0xEE])), (vec![0xEE], 0));
    }
}

// covers: 1.4, sim-controller
#[test]
fn bytes_that_do_not_exist_change_nothing_but_the_others_count() {
    let mut bench = Bench::new();
    // 0x000A..0x000F do not exist.
    assert_eq!(bench.one((Command::Aprd, 0, 0x0009, &[0xEE, 0xEE])), (vec![0x00, 0xEE], 1));
    assert_eq!(bench.one((Command::Aprd, 0, 0x000A, &[0xEE, 0xEE])), (vec![0xEE, 0xEE], 0));
    // AL status cannot be written; the station address at the beginning of the second write can.
    assert_eq!(bench.write(0x0130, &[4, 0]), 0);
    assert_eq!(bench.write(0x0010, &[1, 0, 0xAA, 0xAA]), 1);
    assert_eq!(bench.register(0x0010), [1, 0, 0x34, 0x12]);
    // The RAM of 8 KiB ends at 0x2FFF, the address space at 0xFFFF.
    assert_eq!(bench.one((Command::Aprd, 0, 0x2FFF, &[0xEE, 0xEE])), (vec![0x00, 0xEE], 1));
    assert_eq!(bench.one((Command::Aprd, 0, 0xFFFF, &[0xEE, 0xEE])), (vec![0xEE, 0xEE], 0));
}

// covers: 1.4
#[test]
fn lrw_and_brw_do_nothing_if_the_features_exclude_them() {
    let mut config = config();
    (config.features.brw_unsupported, config.features.lrw_unsupported) = (true, true);
    let mut bench = Bench::with(config);
    assert_eq!(bench.one((Command::Aprw, 0, 0x0F80, &[1])), (vec![1], 0));
    bench.write(0x0600, &[0, 0, 1, 0, 1, 0, 0, 7, 0x80, 0x0F, 0, 3, 1]);
    assert_eq!(bench.one((Command::Lrw, 0, 1, &[1])), (vec![1], 0));
    assert_eq!(bench.one((Command::Lwr, 0, 1, &[1])).1, 1);
}

// covers: 1.4
#[test]
fn the_working_counter_wraps() {
    let mut bench = Bench::new();
    let mut frame = bench.frame(&[(Command::Brd, 0, 0, &[0])]);
    let wkc = frame.datagrams[0].wkc();
    frame.bytes[wkc..wkc + 2].fill(0xFF);
    bench.receive(&mut frame, Port::A);
    assert_eq!(returned(&frame, 0).1, 0);
}

// covers: 2.5, sim-controller
#[test]
fn register_writes_take_effect_at_the_end_of_the_frame() {
    let mut bench = Bench::new();
    bench.write(0x0010, &[5, 0]);
    let answers = bench.exchange(&[(Command::Bwr, 0, 0x0010, &[6, 0]), (Command::Brd, 0, 0x0010, &[0, 0])]);
    assert_eq!(answers[1], (vec![5, 0], 1));
    assert_eq!(bench.register(0x0010), [6, 0]);
}

// covers: 2.5, sim-controller
#[test]
fn a_bad_fcs_has_no_side_effects_on_registers_but_on_ram() {
    let mut bench = Bench::new();
    let answers = bench.damaged(&[
        (Command::Bwr, 0, 0x0010, &[5, 0]),
        (Command::Bwr, 0, 0x0F80, &[1]),
        (Command::Bwr, 0, 0x1000, &[2]),
    ]);
    assert!(answers.iter().all(|answer| answer.1 == 1));
    assert_eq!((bench.register(0x0010), bench.register(0x0F80), bench.register(0x1000)), ([0, 0], [1], [2]));
    // The read of DL status must not clear its event.
    assert_eq!(bench.register(0x0210), [0x04, 0x00]);
    bench.damaged(&[(Command::Brd, 0, 0x0110, &[0, 0])]);
    assert_eq!(bench.register(0x0210), [0x04, 0x00]);
    bench.read(0x0110, 2);
    assert_eq!(bench.register(0x0210), [0x00, 0x00]);
}

// covers: 2.5
#[test]
fn a_frame_with_a_datagram_beyond_its_end_is_an_epu_error_without_effects() {
    let mut bench = Bench::new();
    let mut frame = bench.frame(&[(Command::Bwr, 0, 0x0010, &[5, 0]), (Command::Nop, 0, 0, &[0; 30])]);
    let header = usize::from(frame.datagrams[1].header);
    frame.bytes[header + 6] = 0xFF;
    let mut frame = SimFrame::new(frame.id, frame.bytes);
    assert!(frame.malformed);
    assert_ne!(bench.receive(&mut frame, Port::A), Passage::Destroyed);
    assert_eq!((bench.register(0x030C), bench.register(0x0010)), ([1], [0, 0]));
}
