//! AL control and status, events, addresses, reset (protocol 2.7, 3.2, 3.4, 3.5).

use super::*;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::RegisterGroup;

// covers: 3.1
#[test]
fn information_registers_show_the_configuration() {
    let mut bench = Bench::new();
    assert_eq!(bench.read(0x0000, 10).0, [0x11, 0, 2, 0, 8, 8, 8, 0xFF, 0xFC, 0x00]);
    assert_eq!(bench.read(0x0100, 4).0, [0x01, 0x00, 0x07, 0x00]);
    assert_eq!((bench.read(0x0120, 2).0, bench.read(0x0130, 2).0), (vec![1, 0], vec![1, 0]));
}

// covers: 3
#[test]
fn ethercat_may_write_the_writable_registers_of_the_table() {
    for info in ringcat_wire::register::table().iter().filter(|info| info.group != RegisterGroup::Mii) {
        let config = ControllerConfig { receive_time_latch_mode: true, ..config() };
        let mut bench = Bench::with(config);
        let data = vec![0; usize::from(info.size).min(64)];
        let wkc = bench.write(info.address.0, &data);
        assert_eq!(wkc == 1, info.ecat.writes(), "{} {}", info.name, info.address);
    }
}

// covers: 3.4
#[test]
fn al_control_is_a_mailbox_to_the_application() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x0120, &[0x02, 0x00]), 1);
    assert_eq!(bench.controller.al_event(), 1);
    bench.write(0x0120, &[0x04, 0x00]);
    assert_eq!(bench.register(0x0120), [0x02, 0x00]);
    assert_eq!(bench.controller.al_control(bench.now).al_state(), Some(AlState::PreOp));
    assert_eq!(bench.controller.al_event(), 0);
    bench.write(0x0120, &[0x04, 0x00]);
    assert_eq!(bench.register(0x0120), [0x04, 0x00]);
}

// covers: 3.4
#[test]
fn al_status_written_by_the_application_is_an_ecat_event_until_read() {
    let mut bench = Bench::new();
    bench.read(0x0110, 2);
    let status = AlStatus::from_bits(0x0014);
    bench.controller.set_al_status(status, AlStatusCode::SYNC_MANAGER_WATCHDOG, bench.now);
    assert_eq!(bench.register(0x0210), [0x08, 0x00]);
    assert_eq!(bench.read(0x0130, 6).0, [0x14, 0, 0, 0, 0x1B, 0]);
    assert_eq!(bench.register(0x0210), [0x00, 0x00]);
    assert!(bench.pdi_write(0x0130, &[0x01, 0x00]));
    assert_eq!(bench.register(0x0210), [0x08, 0x00]);
}

// covers: 3.4, sim-states
#[test]
fn with_device_emulation_al_status_follows_al_control_at_once() {
    let mut sii = image();
    sii[1] |= 1;
    sign(&mut sii);
    let mut bench = Bench::with(ControllerConfig { sii, ..config() });
    bench.write(0x0120, &[0x02, 0x00]);
    assert_eq!((bench.register(0x0130), bench.controller.al_event()), ([0x02, 0x00], 0));
    // The acknowledge bit appears as the error bit.
    bench.write(0x0120, &[0x14, 0x00]);
    assert_eq!(bench.register(0x0130), [0x14, 0x00]);
}

// covers: 1.2, sim-controller
#[test]
fn events_are_written_to_every_datagram_if_the_mask_enables_them() {
    let mut bench = Bench::new();
    let irq = |bench: &mut Bench| {
        let mut frame = bench.frame(&[(Command::Nop, 0, 0, &[0]), (Command::Aprd, 5, 0, &[0])]);
        frame.bytes[24] = 0x01;
        bench.receive(&mut frame, Port::A);
        [16, 29].map(|header| u16::from_le_bytes([frame.bytes[header + 8], frame.bytes[header + 9]]))
    };
    assert_eq!(irq(&mut bench), [0x0001, 0x0000]);
    bench.write(0x0200, &[0x04, 0x00]);
    assert_eq!(irq(&mut bench), [0x0005, 0x0004]);
    bench.read(0x0110, 2);
    assert_eq!(irq(&mut bench), [0x0001, 0x0000]);
}

// covers: 2.7, sim-controller
#[test]
fn the_alias_comes_from_the_first_loading_only() {
    let mut bench = Bench::new();
    assert_eq!(bench.register(0x0012), [0x34, 0x12]);
    bench.controller.sii_image_mut()[8] = 0x77;
    sign(bench.controller.sii_image_mut());
    bench.write(0x0502, &[0x00, 0x04]);
    bench.wait(Duration::from_millis(2));
    assert_eq!(bench.register(0x0012), [0x34, 0x12]);
    bench.controller.power_on(bench.now);
    bench.wait(Duration::from_millis(2));
    assert_eq!(bench.register(0x0012), [0x77, 0x12]);
}

// covers: 3.2, sim-controller
#[test]
fn res_in_three_frames_resets_the_controller() {
    let mut bench = Bench::new();
    bench.write(0x0010, &[5, 0]);
    let starts = bench.controller.starts();
    bench.write(0x0040, b"R");
    assert_eq!(bench.read(0x0040, 1).0, [1]);
    bench.write(0x0040, b"E");
    assert_eq!(bench.read(0x0040, 1).0, [2]);
    bench.write(0x0040, b"S");
    assert_eq!((bench.controller.starts(), bench.register(0x0010)), (starts + 1, [0, 0]));
    assert!(!bench.controller.pdi_operational());
    bench.wait(Duration::from_millis(1));
    assert!(bench.controller.pdi_operational());
    // The links stay.
    assert_eq!(bench.read(0x0040, 1), (vec![0], 1));
}

// covers: 3.2
#[test]
fn res_in_one_frame_or_with_a_wrong_letter_resets_nothing() {
    let mut bench = Bench::new();
    let starts = bench.controller.starts();
    let bwr = |letter: &'static [u8]| (Command::Bwr, 0, 0x0040, letter);
    bench.exchange(&[bwr(b"R"), bwr(b"E"), bwr(b"S")]);
    assert_eq!(bench.register(0x0040), [1]);
    for letter in [b"E", b"R", b"S"] {
        bench.write(0x0040, letter);
    }
    assert_eq!((bench.controller.starts(), bench.register(0x0040)), (starts, [0]));
    // The PDI has its own reset register.
    for letter in [b"R", b"E", b"S"] {
        bench.pdi_write(0x0041, letter);
    }
    assert_eq!(bench.controller.starts(), starts + 1);
}
