//! Jumps of the application's time in OP, in segments of all kinds (protocol 7.2, 7.3).

use std::time::Duration;

use ringcat::PulseGrid;
use scenarios::clocks::{EPOCH, config};
use scenarios::pulses::Pulses;

use super::clock_times::{Host, network, with_sync0};

const CYCLE_NS: u64 = 1_000_000;

/// Segments, jumps of the application's time, lost frames per thousand, and how late the host sends, in microseconds.
const SEGMENTS: [(&str, usize, &[i64], u64, u64); 7] = [
    ("line", 1, &[450_000], 0, 0),
    ("line", 10, &[450_000, -330_000, 820_000_000_000_377_123, -5_000_400_777], 0, 0),
    ("tree", 10, &[450_000, -330_000], 0, 0),
    ("ring", 10, &[450_000, -330_000], 0, 0),
    ("tree", 50, &[450_000], 0, 0),
    ("ring", 10, &[450_000], 5, 0),
    ("line", 10, &[450_000], 0, 50),
];
/// A jump is made up after this many cycles of a millisecond.
const MADE_UP: u64 = 3_000;
/// SubDevices pulse apart by up to this, at any time.
const TOGETHER_NS: u64 = 1_000;
/// Pulses of one SubDevice differ from the cycle by up to this: a step, or two where a frame was lost.
const UNEVEN_NS: [u64; 2] = [1_000, 1_600];

/// All SubDevices stay together while pulses slide to their phase in the new time, and no pulse is missing or doubled:
/// seen from inside the SubDevices.
// covers: 7.2, 7.3, dc-reference, dc-sync
#[test]
fn subdevices_pulse_together_while_a_jump_is_made_up_within_3_s() {
    let all = SEGMENTS.iter().flat_map(|(kind, count, all, lost, late_us)| {
        all.iter().map(move |jump| (*kind, *count, *jump, *lost, *late_us))
    });
    for (kind, count, jump, lost, late_us) in all {
        let config = config().with_bus_shift(true).with_pulse_grid(PulseGrid::FirstApplicationTime);
        let mut host = Host { base: EPOCH };
        let mut world = with_sync0(43, network(kind, count), config, &host);
        world.application_mut().links_mut().lose_per_mille(lost, 43);
        world.application_mut().links_mut().send_late(Duration::from_micros(late_us));
        (0..if late_us > 0 { 8_000 } else { 0 }).for_each(|_| host.cycle(&mut world));
        let mark = world.mark();
        let mut pulses = Pulses::new(world.network(), 0..count, CYCLE_NS);
        let begun = host.phase_ns(&world);
        host.base = host.base.wrapping_add_signed(jump);
        let (mut apart, mut off, mut reached) = (0, 0, 0);
        for cycle in 0..MADE_UP + 1_000 {
            host.cycle(&mut world);
            pulses.observe(world.network());
            apart = pulses.apart_ns().expect("all pulse").max(apart);
            let now = (host.phase_ns(&world) - begun + CYCLE_NS as i64 / 2).rem_euclid(CYCLE_NS as i64);
            off = (now - CYCLE_NS as i64 / 2).abs();
            reached = if off > 20_000 { cycle + 1 } else { reached };
            assert!(
                cycle < MADE_UP || off <= 20_000,
                "{kind} of {count}, jump of {jump} ns: {off} ns after {cycle} ms"
            );
        }
        let (worst, fewest, most) = (pulses.worst_ns(), pulses.fewest(), pulses.most());
        let text = format!(
            "{kind} of {count}, jump of {jump} ns, {lost} in 1000 lost, {late_us} us late: at its phase after \
             {reached} ms, then {off} ns off; {apart} ns apart at most, {worst} ns from the cycle, \
             {fewest} to {most} pulses"
        );
        println!("{text}");
        assert!(apart <= TOGETHER_NS && worst <= UNEVEN_NS[usize::from(lost > 0)], "{text}");
        let expected = MADE_UP + 1_000;
        assert!(fewest >= expected - 2 && most <= expected + 2, "{text}");
        assert!(world.all_in_op() && world.left_op(mark).is_empty(), "{text}");
    }
}
