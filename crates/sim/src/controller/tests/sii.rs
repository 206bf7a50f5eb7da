//! The SII interface and loading (protocol 3.8, 4.7).

use super::*;

const BUSY: Duration = Duration::from_micros(500);

fn status(bench: &mut Bench) -> [u8; 2] {
    bench.read(0x0502, 2).0.try_into().unwrap()
}

// covers: 3.8
#[test]
fn a_read_is_busy_and_then_returns_eight_bytes() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x0502, &[0x00, 0x01, 0x08, 0, 0, 0]), 1);
    assert_eq!(status(&mut bench), [0x40, 0x81]);
    bench.wait(BUSY);
    assert_eq!(status(&mut bench), [0x40, 0x00]);
    assert_eq!(bench.read(0x0508, 8).0, [0x02, 0x00, 0x00, 0x00, 0x52, 0x30, 0xF0, 0x07]);
}

// covers: 3.8
#[test]
fn a_controller_with_short_reads_returns_four_bytes() {
    let mut bench = Bench::with(ControllerConfig { eight_byte_reads: false, ..config() });
    bench.write(0x0502, &[0x00, 0x01, 0x08, 0, 0, 0]);
    bench.wait(BUSY);
    assert_eq!(status(&mut bench), [0x00, 0x00]);
    assert_eq!(bench.read(0x0508, 8).0, [0x02, 0, 0, 0, 0, 0, 0, 0]);
}

// covers: 3.8, sim-controller
#[test]
fn while_busy_the_registers_are_blocked() {
    let mut bench = Bench::new();
    bench.write(0x0502, &[0x00, 0x01, 0x08, 0, 0, 0]);
    assert_eq!((bench.write(0x0504, &[0x0A]), bench.write(0x0502, &[0, 1])), (0, 0));
    bench.wait(BUSY);
    assert_eq!(bench.write(0x0504, &[0x0A]), 1);
}

// covers: 3.8, sim-controller
#[test]
fn a_word_is_written_with_the_enable_in_the_same_frame() {
    let mut bench = Bench::new();
    bench.write(0x0504, &[0x04, 0, 0, 0, 0xCD, 0xAB]);
    bench.write(0x0502, &[0x01, 0x02]);
    assert_eq!(bench.controller.sii_image()[8..10], [0x34, 0x12]);
    bench.wait(BUSY);
    assert_eq!(bench.controller.sii_image()[8..10], [0xCD, 0xAB]);
    assert_eq!(status(&mut bench), [0x40, 0x00]);
}

// covers: 3.8
#[test]
fn a_write_without_enable_is_an_error_until_the_next_command() {
    let mut bench = Bench::new();
    bench.write(0x0502, &[0x01]);
    bench.write(0x0502, &[0x00, 0x02]);
    assert_eq!(status(&mut bench), [0x40, 0x40]);
    bench.write(0x0502, &[0x00, 0x00]);
    assert_eq!(status(&mut bench), [0x40, 0x00]);
    // The enable does not last until the next frame, even if that contains only the command.
    bench.write(0x0502, &[0x01]);
    bench.write(0x0503, &[0x02]);
    assert_eq!(status(&mut bench), [0x40, 0x40]);
}

// covers: 3.8
#[test]
fn unknown_commands_and_writes_beyond_the_end_are_errors() {
    let mut bench = Bench::new();
    bench.write(0x0502, &[0x00, 0x03]);
    assert_eq!(status(&mut bench), [0x40, 0x20]);
    bench.write(0x0502, &[0x01, 0x02, 0xFF, 0xFF, 0xFF, 0xFF]);
    bench.wait(BUSY);
    assert_eq!(status(&mut bench), [0x40, 0x20]);
    bench.write(0x0502, &[0x00, 0x01]);
    bench.wait(BUSY);
    assert_eq!((status(&mut bench), bench.read(0x0508, 8).0), ([0x40, 0x00], vec![0xFF; 8]));
}

// covers: 2.5
#[test]
fn a_damaged_frame_starts_no_command() {
    let mut bench = Bench::new();
    bench.damaged(&[(Command::Apwr, 0, 0x0502, &[0x00, 0x01])]);
    assert_eq!(status(&mut bench), [0x40, 0x00]);
}

// covers: 3.8, sim-controller
#[test]
fn the_pdi_takes_the_offered_eeprom_and_loses_it_by_force() {
    let mut bench = Bench::new();
    bench.pdi_write(0x0501, &[1]);
    assert_eq!(bench.register(0x0501), [0]);
    assert!(!bench.pdi_write(0x0504, &[1]));
    bench.write(0x0500, &[1]);
    assert_eq!(bench.write(0x0504, &[1]), 0);
    bench.pdi_write(0x0501, &[1]);
    assert_eq!(bench.register(0x0501), [1]);
    // The PDI needs no write enable.
    assert!(bench.pdi_write(0x0504, &[0x08, 0, 0, 0, 0x99, 0x99]) && bench.pdi_write(0x0502, &[0x00, 0x02]));
    assert_eq!(bench.controller.next_deadline(), Some(bench.now + BUSY));
    bench.wait(BUSY);
    assert_eq!(bench.controller.sii_image()[16..18], [0x99, 0x99]);
    // Withdrawing the offer has no effect, force has.
    bench.write(0x0500, &[0]);
    assert_eq!(bench.write(0x0504, &[1]), 0);
    bench.write(0x0500, &[2]);
    bench.write(0x0500, &[0]);
    assert_eq!((bench.write(0x0504, &[1]), bench.register(0x0501)), (1, [0]));
}

// covers: 4.7
#[test]
fn loading_applies_the_configuration_area() {
    let bench = Bench::new();
    assert_eq!(bench.register(0x0140), [0x05, 0x0E]);
    assert_eq!((bench.register(0x0150), bench.register(0x0982)), ([0x03, 0x44], [0x64, 0x00]));
    assert_eq!((bench.register::<2>(0x0110)[0] & 1, bench.register(0x0502)), (1, [0x40, 0x00]));
}

// covers: 4.7
#[test]
fn until_it_is_loaded_the_data_link_layer_works_but_process_ram_is_closed() {
    let mut bench = Bench::new();
    bench.controller.power_on(bench.now);
    bench.link(Port::A, true);
    assert_eq!(bench.controller.next_deadline(), Some(bench.now + Duration::from_millis(1)));
    assert_eq!((bench.read(0x0000, 1).1, bench.read(0x1000, 1).1, bench.read(0x0F80, 1).1), (1, 0, 1));
    assert_eq!((status(&mut bench)[1] & 0x80, bench.pdi_read(0x0130, 1)), (0x80, None));
    bench.wait(Duration::from_millis(1));
    assert_eq!((bench.read(0x1000, 1).1, bench.pdi_read(0x0130, 1)), (1, Some(vec![1])));
}

// covers: 4.7, sim-controller
#[test]
fn a_wrong_checksum_keeps_pdi_and_process_ram_closed_until_a_good_reload() {
    let mut sii = image();
    sii[14] ^= 1;
    let mut bench = Bench::with(ControllerConfig { sii, ..config() });
    assert_eq!(status(&mut bench), [0x40, 0x18]);
    assert_eq!((bench.read(0x0110, 1).0[0] & 1, bench.read(0x1000, 1).1), (0, 0));
    assert_eq!(bench.write(0x0010, &[5, 0]), 1);
    bench.controller.sii_image_mut()[14] ^= 1;
    bench.write(0x0502, &[0x00, 0x04]);
    bench.wait(Duration::from_millis(1));
    assert_eq!((status(&mut bench), bench.read(0x1000, 1).1), ([0x40, 0x00], 1));
}

// covers: 4.1
#[test]
fn checksum_88a4_is_accepted_and_no_image_is_not() {
    let mut sii = image();
    sii[14..16].copy_from_slice(&[0xA4, 0x88]);
    assert!(Bench::with(ControllerConfig { sii, ..config() }).controller.pdi_operational());
    assert!(!Bench::with(ControllerConfig { sii: Vec::new(), ..config() }).controller.pdi_operational());
}

// covers: 3.8
#[test]
fn an_image_above_2_kbyte_has_two_address_bytes() {
    let mut sii = image();
    sii.resize(4096, 0xFF);
    let mut bench = Bench::with(ControllerConfig { sii, ..config() });
    assert_eq!(status(&mut bench), [0xC0, 0x00]);
}
