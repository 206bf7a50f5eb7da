//! How many bytes leave at a time.

use super::*;

// covers: byte-budget
#[test]
fn the_budget_counts_the_padding_of_a_short_frame() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.supervisor.poll(bench.now);
    let mut sizes = Vec::new();
    bench.supervisor.transmit(bench.now, 59, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, []);
    bench.supervisor.transmit(bench.now, 60, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, [60]);
}

#[test]
fn the_byte_budget_and_the_window_are_kept() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.supervisor.spawn(async move {
        let read = |bus: Bus, n| async move { bus.fprd(StationAddress(n), map::PROCESS_RAM, 1000).await };
        bus.gather(0..200u16, read).await;
    });
    bench.supervisor.poll(bench.now);
    let mut sizes = Vec::new();
    bench.supervisor.transmit(bench.now, 2500, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, vec![1028, 1028]);
    bench.supervisor.transmit(bench.now, usize::MAX, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes.len(), 32);
}

#[test]
fn a_datagram_too_long_for_every_window_is_sent_after_10_ms() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, 1000).await });
    bench.supervisor.poll(bench.now);
    let mut sent = 0;
    for _ in 0..10 {
        bench.supervisor.transmit(bench.now, 500, &mut |_, _| sent += 1);
        assert_eq!(sent, 0);
        bench.pass(Duration::from_millis(1));
    }
    bench.supervisor.transmit(bench.now, 500, &mut |_, _| sent += 1);
    assert_eq!(sent, 1);
}

#[test]
fn a_datagram_longer_than_a_frame_fails_at_once() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, 1487).await });
    bench.step();
    bench.step();
    assert!(bench.sent.is_empty());
    assert!(matches!(*result.borrow(), Some(Err(BusError::TooLong { length: 1487, .. }))));
}
