//! Datagrams that are sent in one frame whatever else is queued, and again in one frame if the frame is lost.

use super::*;

/// The loop settings of three SubDevices.
fn writes() -> Vec<(Command, Target, Vec<u8>)> {
    let write = |station| (Command::Fpwr, Target::Station(StationAddress(station), map::DL_CONTROL), vec![0; 2]);
    vec![write(1), write(2), write(3)]
}

/// The number of writes of [`writes`] in each frame that has any, from `sent`.
fn in_frames(sent: &[(Link, Vec<u8>)]) -> Vec<usize> {
    let of_frame = |(_, frame): &(Link, Vec<u8>)| {
        let frame = Frame::parse(frame).expect("it was built here");
        frame
            .datagrams()
            .filter(|datagram| datagram.header.command == Command::Fpwr && datagram.data.len() == 2)
            .count()
    };
    sent.iter().map(of_frame).filter(|writes| *writes > 0).collect()
}

/// A MainDevice that has queued other datagrams before those of [`writes`]: `urgent` ones, and one of `long` bytes.
fn loaded(urgent: u16, long: usize, together: bool) -> Bench {
    let mut bench = Bench::new(LinkSet::Single);
    for station in 0..urgent {
        let bus = bench.supervisor.bus();
        bench.start(async move { bus.fpwr_first(StationAddress(100 + station), map::ECAT_EVENT_MASK, &[0; 4]).await });
    }
    if long > 0 {
        let bus = bench.supervisor.bus();
        bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, long).await });
    }
    let bus = bench.supervisor.bus();
    bench.start(async move {
        match together {
            true => bus.transfer_together(writes(), Some(Wkc(1))).await,
            false => bus.transfer_all(writes(), Some(Wkc(1))).await,
        }
    });
    bench.supervisor.poll(bench.now);
    bench
}

/// Sends frames in windows of this many bytes until all datagrams are sent.
fn send(bench: &mut Bench, window: usize) {
    for _ in 0..50 {
        let sent = &mut bench.sent;
        bench.supervisor.transmit(bench.now, window, &mut |link, frame| sent.push((link, frame.to_vec())));
        bench.pass(Duration::from_millis(1));
    }
}

// covers: registers
#[test]
fn grouped_writes_are_sent_in_one_frame_whatever_else_is_queued() {
    let mut split = 0;
    for urgent in 0..60 {
        for long in [0, 1400, 1430, 1440, 1450, 1460, 1480] {
            for window in [60, 70, 90, 200, 1514, 4000] {
                let mut bench = loaded(urgent, long, true);
                send(&mut bench, window);
                assert_eq!(in_frames(&bench.sent), [3], "{urgent} urgent, {long} bytes, windows of {window}");
                let mut apart = loaded(urgent, long, false);
                send(&mut apart, window);
                split += usize::from(in_frames(&apart.sent).len() > 1);
            }
        }
    }
    assert!(split > 100, "other datagrams are split here: {split}");
}

// covers: registers
#[test]
fn grouped_writes_of_a_lost_frame_are_sent_again_in_one_frame() {
    for window in [60, 70, 90, 1514] {
        let mut bench = loaded(0, 0, true);
        send(&mut bench, window);
        for _ in 0..3 {
            assert_eq!(in_frames(&bench.sent), [3], "windows of {window}");
            bench.sent.clear();
            bench.pass(Duration::from_millis(200));
            // Another datagram is queued when the loss is detected.
            let bus = bench.supervisor.bus();
            bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, 1470).await });
            bench.supervisor.poll(bench.now);
            send(&mut bench, window);
        }
    }
}

#[test]
fn the_send_window_applies_again_after_an_abandoned_group() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.within(Duration::ZERO, bus.transfer_together(writes(), Some(Wkc(1)))).await });
    bench.supervisor.poll(bench.now);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fpwr_first(STATION, map::PROCESS_RAM, &[0; 100]).await });
    bench.supervisor.poll(bench.now);
    let sent = &mut bench.sent;
    bench.supervisor.transmit(bench.now, 100, &mut |link, frame| sent.push((link, frame.to_vec())));
    assert_eq!(sent.len(), 0);
}

// covers: registers
#[test]
fn of_more_writes_than_a_frame_may_have_each_frame_but_the_last_is_full() {
    let mut bench = Bench::new(LinkSet::Single);
    bench.supervisor.set_max_datagrams(2);
    let bus = bench.supervisor.bus();
    let all = writes().into_iter().chain(writes()).take(5).collect::<Vec<_>>();
    bench.start(async move { bus.transfer_together(all, Some(Wkc(1))).await });
    bench.supervisor.poll(bench.now);
    send(&mut bench, 1514);
    assert_eq!(in_frames(&bench.sent), [2, 2, 1]);
}

/// In a ring the first copy may answer one of a group, and the second one be lost.
// covers: registers
#[test]
fn after_a_part_of_a_group_others_do_not_exceed_the_window() {
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.transfer_together(writes(), Some(Wkc(1))).await });
    bench.step();
    let mut copy = answered(&bench.sent[0].1, 0, 0);
    let end = copy.len();
    // The last of the three writes was executed.
    let last = HEADER_LEN + 2 + 2;
    let wkc_at = 16 + 3 * last - 2;
    assert!(wkc_at + 2 <= end);
    copy[wkc_at..wkc_at + 2].copy_from_slice(&1u16.to_le_bytes());
    bench.supervisor.receive(Link::Main, &copy, bench.now);
    // Its frame is lost, and the redundant link not silent yet.
    bench.pass(Duration::from_millis(20));
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fpwr_first(STATION, map::PROCESS_RAM, &[0; 400]).await });
    bench.supervisor.poll(bench.now);
    bench.sent.clear();
    send(&mut bench, 120);
    assert_eq!(in_frames(&bench.sent)[..1], [2], "{:?}", in_frames(&bench.sent));
    assert!(bench.sent[0].1.len() <= 120, "{}", bench.sent[0].1.len());
}
