//! Logical addressing (protocol 1.4, 3.10).

use super::*;

const READ: u8 = 1;
const WRITE: u8 = 2;

/// The 16 bytes of an FMMU at logical 0x00010000 plus `logical`.
fn fmmu(logical: u16, length: u16, bits: (u8, u8), physical: (u16, u8), kind: u8) -> [u8; 16] {
    let (l, n, p) = (logical.to_le_bytes(), length.to_le_bytes(), physical.0.to_le_bytes());
    [l[0], l[1], 0x01, 0x00, n[0], n[1], bits.0, bits.1, p[0], p[1], physical.1, kind, 1, 0, 0, 0]
}

// covers: 3.10, sim-controller
#[test]
fn fourteen_output_bits_are_written_to_their_position_only() {
    let mut bench = Bench::new();
    // Logical 0x00010011 bit 3 to 0x0F01 bit 1; the data sheet's example.
    bench.write(0x0600, &[0x11, 0x00, 0x01, 0x00, 3, 0, 3, 0, 0x01, 0x0F, 1, 2, 1]);
    bench.write(0x0F00, &[0xFF, 0x01, 0x80, 0xFF]);
    assert_eq!(bench.one((Command::Lwr, 0x0010, 0x0001, &[0, 0, 0, 0, 0])).1, 1);
    assert_eq!(bench.register(0x0F00), [0xFF, 0x01, 0x80, 0xFF]);
    assert_eq!(bench.one((Command::Lwr, 0x0010, 0x0001, &[0xFF; 5])).1, 1);
    assert_eq!(bench.register(0x0F00), [0xFF, 0xFF, 0xFF, 0xFF]);
    // Bits 3..7 of 0x11, all of 0x12, bit 0 of 0x13: 0b1_0000_0001_10101 to bits 1..14.
    assert_eq!(bench.one((Command::Lwr, 0x0011, 0x0001, &[0b1010_1000, 0x01, 0x01])).1, 1);
    assert_eq!(bench.register(0x0F00), [0xFF, 0b0110_1011, 0b1100_0000, 0xFF]);
}

// covers: 1.4
#[test]
fn reads_change_mapped_bits_only() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[0b0000_0110]);
    bench.write(0x0600, &fmmu(0, 1, (4, 5), (0x1000, 1), READ));
    assert_eq!(bench.one((Command::Lrd, 0, 1, &[0xFF, 0xFF])), (vec![0xFF, 0xFF], 1));
    bench.write(0x1000, &[0b0000_0010]);
    assert_eq!(bench.one((Command::Lrd, 0, 1, &[0xFF, 0xFF])), (vec![0b1101_1111, 0xFF], 1));
    assert_eq!(bench.one((Command::Lrd, 1, 1, &[0xFF, 0xFF])), (vec![0xFF, 0xFF], 0));
}

// covers: 1.4
#[test]
fn lrw_counts_1_and_2_once_per_direction_not_per_fmmu() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[1, 2, 3, 4]);
    bench.write(0x0600, &fmmu(0, 2, (0, 7), (0x1000, 0), READ));
    bench.write(0x0610, &fmmu(4, 2, (0, 7), (0x1002, 0), READ));
    bench.write(0x0620, &fmmu(8, 2, (0, 7), (0x1100, 0), WRITE));
    let data = [9, 9, 9, 9, 9, 9, 9, 9, 7, 8];
    assert_eq!(bench.one((Command::Lrw, 0, 1, &data)), (vec![1, 2, 9, 9, 3, 4, 9, 9, 7, 8], 3));
    assert_eq!(bench.register(0x1100), [7, 8]);
    assert_eq!(bench.one((Command::Lrw, 0, 1, &[0; 4])).1, 1);
    assert_eq!(bench.one((Command::Lrw, 8, 1, &[0; 4])).1, 2);
    assert_eq!((bench.one((Command::Lrd, 0, 1, &data)).1, bench.one((Command::Lwr, 0, 1, &data)).1), (1, 1));
}

// covers: 1.4
#[test]
fn lrw_writes_the_received_data_and_reads_the_old_data() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[1, 2]);
    bench.write(0x0600, &fmmu(0, 2, (0, 7), (0x1000, 0), READ | WRITE));
    assert_eq!(bench.one((Command::Lrw, 0, 1, &[5, 6])), (vec![1, 2], 3));
    assert_eq!(bench.register(0x1000), [5, 6]);
}

// covers: 3.10, sim-controller
#[test]
fn the_lower_numbered_fmmu_takes_precedence() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[1, 2, 3, 4]);
    bench.write(0x0600, &fmmu(1, 1, (0, 7), (0x1003, 0), READ | WRITE));
    bench.write(0x0610, &fmmu(0, 3, (0, 7), (0x1000, 0), READ | WRITE));
    assert_eq!(bench.one((Command::Lrd, 0, 1, &[0; 3])), (vec![1, 4, 3], 1));
    bench.one((Command::Lwr, 0, 1, &[10, 11, 12]));
    assert_eq!(bench.register(0x1000), [10, 2, 12, 11]);
}

// covers: 3.10
#[test]
fn a_switched_off_fmmu_maps_nothing() {
    let mut bench = Bench::new();
    bench.write(0x0600, &fmmu(0, 2, (0, 7), (0x1000, 0), READ));
    assert_eq!(bench.one((Command::Lrd, 0, 1, &[0])).1, 1);
    bench.write(0x060C, &[0]);
    assert_eq!(bench.one((Command::Lrd, 0, 1, &[0])).1, 0);
}

// covers: 3.10
#[test]
fn bitwise_writes_elsewhere_lose_the_unmapped_bits_of_the_byte() {
    let mut bench = Bench::new();
    bench.write(0x1000, &[0xFF]);
    bench.write(0x0600, &fmmu(0, 1, (0, 1), (0x1000, 0), WRITE));
    bench.one((Command::Lwr, 0, 1, &[0x01]));
    assert_eq!(bench.register(0x1000), [0x01]);
}

// covers: 3.10
#[test]
fn two_fmmus_write_their_bits_of_the_digital_outputs_in_one_frame() {
    let mut bench = Bench::new();
    bench.write(0x0600, &fmmu(0, 1, (0, 3), (0x0F00, 0), WRITE));
    bench.write(0x0610, &fmmu(4, 1, (4, 7), (0x0F00, 4), WRITE));
    bench.one((Command::Lwr, 0, 1, &[0x05, 0, 0, 0, 0xA0]));
    assert_eq!(bench.register(0x0F00), [0xA5]);
}

// covers: 3.10, sim-controller
#[test]
fn fmmu_data_obeys_the_sync_manager() {
    let mut bench = Bench::new();
    bench.write(0x0800, &[0x00, 0x10, 4, 0, 0x24, 0, 1, 0]);
    bench.write(0x0600, &fmmu(0, 4, (0, 7), (0x1000, 0), WRITE));
    // Two bytes from the second one on: the buffer was not opened.
    assert_eq!(bench.one((Command::Lwr, 1, 1, &[9, 9])).1, 0);
    assert_eq!(bench.one((Command::Lwr, 0, 1, &[1, 2, 3, 4])).1, 1);
    assert_eq!(bench.pdi_read(0x1000, 4), Some(vec![1, 2, 3, 4]));
}
