//! Distributed clocks: latches and times (protocol 3.12, 7.1).

use super::*;

const FIRST_BIT: u64 = 5_760;

fn drift(ppb: i64) -> ClockErrors {
    ClockErrors { drift_ppb: ppb, ..ClockErrors::default() }
}

fn receive_times(bench: &Bench) -> [u32; 4] {
    let bytes: [u8; 16] = bench.register(0x0900);
    core::array::from_fn(|p| u32::from_le_bytes(bytes[4 * p..4 * p + 4].try_into().unwrap()))
}

fn latch(bench: &mut Bench, command: Command) -> SimFrame {
    bench.frame(&[(command, 0, 0x0900, &[0; 4])])
}

/// Local time at the first bit of a shortest frame whose last bit arrives now.
fn local_first_bit(bench: &Bench) -> u64 {
    bench.controller.local_time(SimTime(bench.now.0 - FIRST_BIT))
}

// covers: 3.12
#[test]
fn a_write_to_0x0900_latches_every_port_at_which_the_frame_arrives() {
    let mut bench = Bench::with(ControllerConfig { clock_start: 0xFFFF_F000, clock_errors: drift(20_000), ..config() });
    bench.link(Port::B, true);
    let mut frame = latch(&mut bench, Command::Bwr);
    bench.receive(&mut frame, Port::A);
    let at_unit = local_first_bit(&bench);
    assert_eq!(receive_times(&bench), [at_unit as u32, 0, 0, 0]);
    bench.receive(&mut frame, Port::B);
    assert_eq!(receive_times(&bench), [at_unit as u32, local_first_bit(&bench) as u32, 0, 0]);
    assert_eq!(bench.register(0x0918), at_unit.to_le_bytes());
    assert!(at_unit > u64::from(u32::MAX));
    // Other frames change nothing.
    let times = receive_times(&bench);
    bench.write(0x0F80, &[1]);
    assert_eq!(receive_times(&bench), times);
}

// covers: 3.12, sim-clocks
#[test]
fn only_bwr_and_fpwr_latch_although_others_increment_the_counter() {
    let mut bench = Bench::new();
    for command in [Command::Apwr, Command::Brw, Command::Aprw, Command::Armw, Command::Frmw, Command::Fprw] {
        let mut frame = latch(&mut bench, command);
        bench.receive(&mut frame, Port::A);
        assert_ne!(returned(&frame, 0).1, 0, "{command}");
        assert_eq!(receive_times(&bench), [0; 4], "{command}");
    }
    assert_eq!(bench.one((Command::Bwr, 0, 0x0901, &[0])).1, 1);
    assert_eq!(receive_times(&bench), [0; 4]);
    bench.one((Command::Fpwr, 0, 0x0900, &[0]));
    assert_ne!(receive_times(&bench)[0], 0);
}

// covers: 2.5
#[test]
fn a_damaged_frame_latches_nothing() {
    let mut bench = Bench::new();
    bench.damaged(&[(Command::Bwr, 0, 0x0900, &[0; 4])]);
    assert_eq!(receive_times(&bench), [0; 4]);
}

// covers: 7.1
#[test]
fn a_frame_entering_at_port_1_is_latched_at_port_1() {
    for (latch_mode, expected) in [(false, true), (true, false)] {
        let mut bench = Bench::with(ControllerConfig { receive_time_latch_mode: latch_mode, ..config() });
        bench.link(Port::A, false);
        bench.link(Port::B, true);
        let mut frame = latch(&mut bench, Command::Bwr);
        bench.receive(&mut frame, Port::B);
        assert_eq!(receive_times(&bench)[1] != 0, expected);
        assert_eq!(bench.register(0x0918), local_first_bit(&bench).to_le_bytes());
        let mut write = bench.frame(&[(Command::Bwr, 0, 0x0936, &[1])]);
        bench.receive(&mut write, Port::B);
        let mut frame = latch(&mut bench, Command::Bwr);
        bench.receive(&mut frame, Port::B);
        assert_eq!(receive_times(&bench)[1], local_first_bit(&bench) as u32);
    }
}

// covers: 3.12
#[test]
fn system_time_is_local_time_plus_offset_at_the_start_of_the_frame() {
    let mut bench = Bench::with(ControllerConfig { clock_errors: drift(-50_000), ..config() });
    bench.write(0x0920, &0x0011_2233_4455_6677u64.to_le_bytes());
    let (data, wkc) = bench.read(0x0910, 8);
    let expected = local_first_bit(&bench) + 0x0011_2233_4455_6677;
    assert_eq!((data, wkc), (expected.to_le_bytes().to_vec(), 1));
    assert_eq!(bench.controller.system_time(SimTime(bench.now.0 - FIRST_BIT)), expected);
    // The PDI reads the time of its read.
    let now = bench.controller.system_time(bench.now);
    assert_eq!(bench.pdi_read(0x0910, 8), Some(now.to_le_bytes().to_vec()));
}

// covers: 3.12
#[test]
fn a_negative_offset_is_in_twos_complement() {
    let mut bench = Bench::new();
    let local = bench.controller.local_time(bench.now);
    bench.write(0x0920, &(-1_000i64).to_le_bytes());
    assert_eq!(bench.controller.system_time(bench.now) - local, 10_000 - 1_000);
}

// covers: 3.12
#[test]
fn a_write_to_system_time_increments_the_counter_and_is_not_stored() {
    let mut bench = Bench::new();
    assert_eq!(bench.one((Command::Frmw, 0x7777, 0x0910, &[9; 8])).1, 1);
    assert_eq!(u64::from_le_bytes(bench.read(0x0910, 8).0.try_into().unwrap()), local_first_bit(&bench));
}

// covers: 3.12, sim-clocks
#[test]
fn a_32_bit_clock_has_four_bytes_and_a_controller_without_clock_none() {
    let mut config = config();
    config.features.dc_64bit = false;
    let mut bench = Bench::with(ControllerConfig { clock_start: 0x1_0000_0000, ..config.clone() });
    let (data, wkc) = bench.one((Command::Aprd, 0, 0x0910, &[0xEE; 8]));
    assert_eq!((&data[4..], wkc), (&[0xEE; 4][..], 1));
    assert_eq!(data[..4], (local_first_bit(&bench) as u32).to_le_bytes());
    config.features.dc = false;
    let mut bench = Bench::with(config);
    assert_eq!((bench.read(0x0910, 8).1, bench.one((Command::Bwr, 0, 0x0900, &[0; 4])).1), (0, 0));
}

// covers: 3.12
#[test]
fn reset_values_of_the_control_loop() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(0x0930, 6).0, [0x00, 0x10, 0x00, 0x00, 0x04, 0x0C]);
}

// covers: 7.2.1, sim-clocks
#[test]
fn the_loop_takes_its_sample_at_the_start_of_a_good_frame() {
    let mut bench = Bench::new();
    bench.write(0x0928, &1_000u32.to_le_bytes());
    bench.now += Duration::from_micros(10);
    let first_bit = SimTime(bench.now.0 + 10_000 - FIRST_BIT);
    let ahead = (bench.controller.local_time(first_bit) as u32).wrapping_sub(1_000 + 1_600);
    let payload = [&ahead.to_le_bytes()[..], &[0xEE; 4]].concat();
    bench.damaged(&[(Command::Frmw, 0x7777, 0x0910, &payload)]);
    assert_eq!(bench.register(0x092C), 0u32.to_le_bytes());
    bench.now.0 -= 10_000;
    assert_eq!(bench.one((Command::Frmw, 0x7777, 0x0910, &payload)).1, 1);
    // 1,600 ns ahead of the received time plus the delay; a sixteenth of it is in the mean.
    assert_eq!(bench.register(0x092C), (0x8000_0000u32 | 100).to_le_bytes());
    bench.write(0x0930, &0x1000u16.to_le_bytes());
    assert_eq!(bench.register(0x092C), [0; 4]);
    assert_eq!(bench.register(0x0932), [0; 2]);
}

// covers: 7.5
#[test]
fn the_addressed_controller_of_a_multiple_write_does_not_correct_itself() {
    let mut bench = Bench::new();
    for _ in 0..50 {
        assert_eq!(bench.one((Command::Armw, 0, 0x0910, &[0; 8])).1, 1);
    }
    assert_eq!((bench.register(0x092C), bench.register(0x0932)), ([0; 4], [0; 2]));
}

// covers: 7.3, sim-clocks
#[test]
fn sync0_occurs_at_its_start_time_in_system_time() {
    for bits64 in [true, false] {
        let mut config = config();
        config.features.dc_64bit = bits64;
        // A 32-bit clock wraps before the start.
        let clock_start = 0xFFFF_FFFF_u64 - 5_000_000;
        let mut bench = Bench::with(ControllerConfig { clock_start, clock_errors: drift(40_000), ..config });
        bench.write(0x0920, &(-500i64).to_le_bytes());
        let start = bench.controller.system_time(bench.now).wrapping_add(10_000_000);
        bench.write(0x0990, &start.to_le_bytes());
        bench.write(0x09A0, &1_000_000u32.to_le_bytes());
        bench.write(0x0981, &[0x03]);
        assert_eq!(bench.register(0x0984), [0x01]);
        assert_eq!(bench.controller.sync0_pulses(bench.now), 0);
        let first = bench.controller.next_sync0(bench.now).unwrap();
        let width = if bits64 { u64::MAX } else { u32::MAX.into() };
        assert_eq!(bench.controller.system_time(first), start & width);
        bench.wait(Duration::from_nanos(12_500_000));
        assert_eq!(bench.controller.sync0_pulses(bench.now), 3);
        let next = u64::from_le_bytes(bench.read(0x0990, 8).0.try_into().unwrap());
        assert_eq!(next & width, start.wrapping_add(3_000_000) & width);
        bench.write(0x0981, &[0x00]);
        assert_eq!((bench.controller.next_sync0(bench.now), bench.register(0x0984)), (None, [0]));
    }
}

// covers: 3.12, sim-clocks
#[test]
fn edges_at_latch_pins_are_time_stamped() {
    let mut bench = Bench::new();
    bench.write(0x09A8, &[0x01]);
    let first = bench.controller.system_time(bench.now);
    bench.controller.latch_edge(LatchPin::Latch0, true, bench.now);
    bench.wait(Duration::from_micros(50));
    // A single event keeps its first time until it is read; the other edge is not limited.
    bench.controller.latch_edge(LatchPin::Latch0, true, bench.now);
    bench.controller.latch_edge(LatchPin::Latch0, false, bench.now);
    let second = bench.controller.system_time(bench.now);
    bench.controller.latch_edge(LatchPin::Latch1, true, bench.now);
    assert_eq!(bench.read(0x09AE, 2).0, [0x03, 0x05]);
    assert_eq!(bench.read(0x09B0, 8).0, first.to_le_bytes());
    assert_eq!(bench.read(0x09C0, 8).0, second.to_le_bytes());
    assert_eq!(bench.read(0x09AE, 2).0, [0x02, 0x04]);
    assert_eq!(bench.read(0x09B8, 8).0, second.to_le_bytes());
}

// covers: 3.12, sim-clocks
#[test]
fn a_sync_signal_without_a_pulse_length_stays_until_the_pdi_has_read_its_status() {
    let mut bench = Bench::new();
    bench.controller.memory.set_u16(RegisterAddress(0x0982), 0);
    let start = bench.controller.system_time(bench.now) + 5_000_000;
    bench.write(0x0990, &start.to_le_bytes());
    bench.write(0x09A0, &[1_000_000u32.to_le_bytes(), 200_000u32.to_le_bytes()].concat());
    bench.write(0x0981, &[0x07]);
    assert_eq!(bench.read(0x098E, 2).0, [0, 0]);
    bench.wait(Duration::from_micros(5_100));
    assert_eq!(bench.read(0x098E, 2).0, [1, 0], "a read by EtherCAT changes nothing");
    assert_eq!(bench.pdi_read(0x098E, 1), Some(vec![1]));
    assert_eq!(bench.pdi_read(0x098E, 1), Some(vec![0]));
    bench.wait(Duration::from_millis(1));
    assert_eq!(bench.read(0x098E, 2).0, [1, 1]);
}

// covers: 3.12, sim-clocks
#[test]
fn a_write_to_the_start_time_activates_a_waiting_sync_unit() {
    for (bits64, activation) in [(true, 0x0A), (true, 0x1A), (false, 0x0A)] {
        let mut config = config();
        config.features.dc_64bit = bits64;
        let mut bench = Bench::with(config);
        bench.write(0x09A0, &1_000_000u32.to_le_bytes());
        bench.write(0x0981, &[activation]);
        assert_eq!((bench.register(0x0984), bench.register(0x0981)), ([0], [activation]));
        let start = bench.controller.system_time(bench.now) + 5_000_000;
        bench.write(0x0990, &start.to_le_bytes()[..4]);
        let whole = bits64 && activation & 0x10 == 0;
        assert_eq!(bench.register(0x0984), [u8::from(!whole)], "half of the start time");
        if whole {
            bench.write(0x0990, &start.to_le_bytes());
        }
        assert_eq!((bench.register(0x0984), bench.register(0x0981)), ([1], [activation | 1]));
        let first = bench.controller.next_sync0(bench.now).expect("SYNC0 is active");
        assert_eq!(bench.controller.system_time(first), start);
    }
}

// covers: 3.12, sim-clocks
#[test]
fn buffer_changes_of_sync_managers_are_time_stamped() {
    let mut bench = Bench::with(ControllerConfig { clock_start: 77, ..config() });
    bench.write(0x0810, &[0x00, 0x11, 4, 0, 0x24, 0, 1, 0]);
    let time = |bench: &Bench, at: u16| u32::from_le_bytes(bench.register(at));
    bench.write(0x1100, &[1; 3]);
    assert_eq!(time(&bench, 0x09F0), 0, "not handed over yet");
    bench.write(0x1100, &[1; 4]);
    assert_eq!(time(&bench, 0x09F0), local_first_bit(&bench) as u32);
    bench.wait(Duration::from_micros(3));
    let opened = bench.controller.local_time(bench.now) as u32;
    assert!(bench.pdi_read(0x1100, 2).is_some());
    assert_eq!((time(&bench, 0x09F8), time(&bench, 0x09FC)), (opened, 0));
    bench.wait(Duration::from_micros(3));
    let closed = bench.controller.local_time(bench.now) as u32;
    assert!(bench.pdi_read(0x1102, 2).is_some());
    assert_eq!((time(&bench, 0x09F8), time(&bench, 0x09FC)), (opened, closed));
}
