//! SyncManagers from both sides (protocol 3.5, 3.11).

use super::*;

/// SM0 as mailbox out, SM1 as mailbox in, 16 bytes each.
fn mailboxes() -> Bench {
    let mut bench = Bench::new();
    bench.write(0x0800, &[0x00, 0x10, 16, 0, 0x26, 0, 1, 0]);
    bench.write(0x0808, &[0x80, 0x10, 16, 0, 0x22, 0, 1, 0]);
    bench.controller.al_control(bench.now);
    assert!(bench.pdi_read(0x0806, 1).is_some());
    bench
}

/// SM2 as outputs, SM3 as inputs, 4 bytes each, three buffers.
fn buffers() -> Bench {
    let mut bench = Bench::new();
    bench.write(0x0810, &[0x00, 0x11, 4, 0, 0x24, 0, 1, 0]);
    bench.write(0x0818, &[0x80, 0x11, 4, 0, 0x20, 0, 1, 0]);
    bench
}

// covers: 3.11, sim-controller
#[test]
fn a_mailbox_is_full_after_the_write_and_empty_after_the_read() {
    let mut bench = mailboxes();
    assert_eq!(bench.pdi_read(0x1000, 16), None);
    assert_eq!(bench.write(0x1000, &[1; 16]), 1);
    assert_eq!(bench.register(0x0805), [0x09]);
    assert_eq!(bench.controller.al_event(), 0x0000_0100);
    assert_eq!(bench.write(0x1000, &[2; 16]), 0);
    assert_eq!(bench.pdi_read(0x1000, 16), Some(vec![1; 16]));
    assert_eq!((bench.register(0x0805), bench.controller.al_event()), ([0x02], 0));
    assert_eq!(bench.write(0x1000, &[2; 16]), 1);
}

// covers: 3.11
#[test]
fn reading_an_empty_mailbox_counts_nothing_and_changes_no_data() {
    let mut bench = mailboxes();
    assert_eq!(bench.one((Command::Aprd, 0, 0x1080, &[0xEE; 16])), (vec![0xEE; 16], 0));
    assert!(bench.pdi_write(0x1080, &[7; 16]));
    assert!(!bench.pdi_write(0x1080, &[8; 16]));
    assert_eq!(bench.register(0x080D), [0x09]);
    assert_eq!(bench.read(0x1080, 16), (vec![7; 16], 1));
    assert_eq!((bench.register(0x080D), bench.controller.al_event()), ([0x02], 0x0000_0200));
    assert_eq!(bench.read(0x1080, 16).1, 0);
}

// covers: 3.11
#[test]
fn a_mailbox_write_has_to_reach_the_last_byte() {
    let mut bench = mailboxes();
    assert_eq!(bench.write(0x1000, &[1; 8]), 1);
    assert_eq!(bench.register(0x0805), [0x80]);
    assert_eq!(bench.write(0x100F, &[9]), 1);
    assert_eq!(bench.register(0x0805), [0x09]);
    // No access, because it does not begin at the first byte.
    bench.pdi_read(0x1000, 16);
    assert_eq!(bench.write(0x1004, &[1; 12]), 0);
    assert_eq!(bench.register(0x0805), [0x02]);
}

// covers: 2.5
#[test]
fn a_bad_fcs_neither_fills_nor_empties_a_mailbox() {
    let mut bench = mailboxes();
    assert_eq!(bench.damaged(&[(Command::Apwr, 0, 0x1000, &[1; 16])])[0].1, 1);
    assert_eq!(bench.register(0x0805), [0x00]);
    assert_eq!(bench.pdi_read(0x1000, 16), None);
    bench.pdi_write(0x1080, &[7; 16]);
    assert_eq!(bench.damaged(&[(Command::Aprd, 0, 0x1080, &[0; 16])])[0].1, 1);
    assert_eq!(bench.register(0x080D), [0x09]);
    assert_eq!(bench.read(0x1080, 16), (vec![7; 16], 1));
}

// covers: 3.11
#[test]
fn each_side_has_its_direction() {
    let mut bench = mailboxes();
    bench.write(0x1000, &[1; 16]);
    assert_eq!(bench.read(0x1000, 16).1, 0);
    assert!(!bench.pdi_write(0x1000, &[1; 16]));
    assert_eq!(bench.write(0x1080, &[1; 16]), 0);
}

// covers: 3.11, sim-controller
#[test]
fn the_reader_always_gets_the_last_complete_buffer() {
    let mut bench = buffers();
    assert_eq!(bench.pdi_read(0x1100, 4), None);
    for value in 1..=5 {
        assert_eq!(bench.write(0x1100, &[value; 4]), 1);
        // Damaged or incomplete data is never read.
        bench.damaged(&[(Command::Apwr, 0, 0x1100, &[0xBB; 4])]);
        assert_eq!(bench.write(0x1100, &[0xCC; 3]), 1);
        assert_eq!(bench.pdi_read(0x1100, 4), Some(vec![value; 4]));
        assert_eq!(bench.pdi_read(0x1100, 4), Some(vec![value; 4]));
    }
    assert!(bench.pdi_write(0x1180, &[1, 2, 3, 4]) && bench.pdi_write(0x1180, &[5, 6, 7, 8]));
    assert_eq!(bench.read(0x1180, 4), (vec![5, 6, 7, 8], 1));
    assert_eq!(bench.read(0x1180, 4), (vec![5, 6, 7, 8], 1));
}

// covers: 3.1, 3.11, sim-controller
#[test]
fn sequential_mode_is_no_feature_and_its_bit_changes_nothing() {
    let mut bench = buffers();
    let [features] = bench.register(0x0009);
    assert_eq!(features & 0x10, 0, "the feature is not declared");
    bench.write(0x0814, &[0xA4]);
    bench.write(0x081C, &[0xA0]);
    assert_eq!((bench.register(0x0814), bench.register(0x081C)), ([0xA4], [0xA0]));
    for value in 1..=5 {
        assert_eq!(bench.write(0x1100, &[value; 4]), 1);
        assert_eq!(bench.write(0x1100, &[value + 10; 4]), 1);
        assert_eq!(bench.pdi_read(0x1100, 4), Some(vec![value + 10; 4]), "the last value, independent of reads");
        assert!(bench.pdi_write(0x1180, &[value; 4]) && bench.pdi_write(0x1180, &[value + 20; 4]));
        assert_eq!(bench.read(0x1180, 4), (vec![value + 20; 4], 1));
    }
}

// covers: 3.11
#[test]
fn inputs_that_were_never_written_cannot_be_read() {
    let mut bench = buffers();
    assert_eq!(bench.register(0x081D), [0x30]);
    assert_eq!(bench.read(0x1180, 4).1, 0);
    bench.pdi_write(0x1180, &[1; 4]);
    assert_eq!(bench.register(0x081D), [0x01]);
    assert_eq!(bench.read(0x1180, 4).1, 1);
}

// covers: 3.11
#[test]
fn the_other_two_buffers_are_not_addressable() {
    let mut bench = buffers();
    assert_eq!((bench.write(0x1104, &[1; 8]), bench.write(0x110C, &[1; 4])), (0, 1));
}

// covers: 3.11, sim-controller
#[test]
fn the_area_of_a_deactivated_sync_manager_is_locked() {
    let mut bench = buffers();
    bench.write(0x1100, &[1; 4]);
    bench.write(0x0816, &[0]);
    assert_eq!((bench.write(0x1100, &[2; 4]), bench.read(0x1100, 4).1), (0, 0));
    assert_eq!(bench.pdi_read(0x1100, 4), None);
    // After activation it is empty.
    bench.write(0x0816, &[1]);
    assert_eq!(bench.pdi_read(0x1100, 4), None);
    assert!(bench.pdi_write(0x0817, &[1]));
    assert_eq!(bench.write(0x1100, &[2; 4]), 0);
    assert!(bench.pdi_write(0x0817, &[0]));
    assert_eq!(bench.write(0x1100, &[2; 4]), 1);
}

// covers: 3.13, sim-controller
#[test]
fn without_a_sync_manager_process_ram_is_accessed_directly() {
    let mut bench = Bench::new();
    assert_eq!(bench.write(0x1234, &[1, 2, 3]), 1);
    assert_eq!(bench.read(0x1233, 5), (vec![0, 1, 2, 3, 0], 1));
    assert_eq!(bench.pdi_read(0x1235, 1), Some(vec![2]));
}

// covers: 3.11
#[test]
fn start_and_length_are_writable_only_while_disabled() {
    let mut bench = buffers();
    assert_eq!(bench.write(0x0810, &[0x00, 0x12, 8, 0]), 1);
    assert_eq!(bench.register(0x0810), [0x00, 0x11, 4, 0]);
    bench.write(0x0816, &[0]);
    bench.write(0x0810, &[0x00, 0x12, 8, 0]);
    assert_eq!(bench.register(0x0810), [0x00, 0x12, 8, 0]);
    // Status and PDI control cannot be written.
    assert_eq!((bench.write(0x0815, &[0xFF]), bench.write(0x0817, &[0xFF])), (0, 0));
}

// covers: 3.11
#[test]
fn a_length_of_one_has_a_single_buffer_that_can_be_read_back() {
    let mut bench = Bench::new();
    bench.write(0x0800, &[0x00, 0x0F, 1, 0, 0x44, 0, 1, 0]);
    assert_eq!(bench.write(0x0F00, &[0xA5]), 1);
    assert_eq!((bench.read(0x0F00, 1), bench.pdi_read(0x0F00, 1)), ((vec![0xA5], 1), Some(vec![0xA5])));
    assert_eq!(bench.controller.digital_outputs(), Some([0xA5, 0, 0, 0]));
}

// covers: 3.5
#[test]
fn an_activation_change_is_an_al_event_until_the_pdi_reads_the_register() {
    let mut bench = mailboxes();
    // The repeat request is in the same register.
    bench.write(0x080E, &[0x03]);
    assert_eq!(bench.controller.al_event(), 0x10);
    assert_eq!(bench.pdi_read(0x080E, 1), Some(vec![0x03]));
    assert_eq!(bench.controller.al_event(), 0);
    bench.write(0x080E, &[0x03]);
    assert_eq!(bench.controller.al_event(), 0);
    assert!(bench.pdi_write(0x080F, &[0x02]));
    assert_eq!(bench.register(0x080F), [0x02]);
}

// covers: 6.2, sim-controller
#[test]
fn toggling_repeat_keeps_the_content_of_the_mailbox() {
    let mut bench = mailboxes();
    bench.pdi_write(0x1080, &[7; 16]);
    bench.write(0x080E, &[0x03]);
    assert_eq!(bench.read(0x1080, 16), (vec![7; 16], 1));
}

// covers: 3.5, sim-controller
#[test]
fn ecat_events_mirror_sync_managers_that_enable_them() {
    let mut bench = Bench::new();
    bench.write(0x0808, &[0x80, 0x10, 16, 0, 0x12, 0, 1, 0]);
    bench.read(0x0110, 2);
    bench.pdi_write(0x1080, &[7; 16]);
    assert_eq!(bench.register(0x0210), [0x20, 0x00]);
    assert_eq!(bench.controller.al_event() & 0x200, 0);
    bench.read(0x1080, 16);
    assert_eq!(bench.register(0x0210), [0x00, 0x00]);
}
