//! Write protection (protocol 3.2).

use super::*;

// covers: 3.2, sim-controller
#[test]
fn protected_registers_need_the_enable_in_the_same_frame() {
    let mut bench = Bench::new();
    bench.write(0x0021, &[1]);
    assert_eq!(bench.write(0x0010, &[5, 0]), 0);
    let bwr = |address, data: &'static [u8]| (Command::Bwr, 0, address, data);
    let answers = bench.exchange(&[bwr(0x0010, &[6, 0]), bwr(0x0020, &[0]), bwr(0x0010, &[7, 0])]);
    assert_eq!([answers[0].1, answers[1].1, answers[2].1], [0, 1, 1]);
    assert_eq!(bench.register(0x0010), [7, 0]);
    assert_eq!(bench.write(0x0010, &[5, 0]), 0);
    // The protection does not cover memory from 0x0F80 on.
    assert_eq!((bench.write(0x0F7F, &[1]), bench.write(0x0F80, &[1]), bench.write(0x1000, &[1])), (0, 1, 1));
}

// covers: 3.2, sim-controller
#[test]
fn esc_protection_covers_all_memory() {
    let mut bench = Bench::new();
    bench.write(0x0031, &[1]);
    assert_eq!((bench.write(0x0010, &[5, 0]), bench.write(0x0F80, &[1]), bench.write(0x1000, &[1])), (0, 0, 0));
    assert_eq!(bench.read(0x0000, 1).1, 1);
    let bwr = |address, data: &'static [u8]| (Command::Bwr, 0, address, data);
    let answers = bench.exchange(&[bwr(0x0030, &[0]), bwr(0x1000, &[6]), bwr(0x0031, &[0])]);
    assert!(answers.iter().all(|answer| answer.1 == 1));
    assert_eq!((bench.register(0x1000), bench.write(0x1000, &[1])), ([6], 1));
}
