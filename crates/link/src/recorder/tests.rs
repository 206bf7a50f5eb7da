use std::fs;
use std::sync::atomic::AtomicU32;

use super::*;

/// A file that is removed when it is dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Scratch {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        Scratch(std::env::temp_dir().join(format!("ringcat-recorder-{}-{number}.pcapng", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

/// Kind and body of each block of a file.
fn blocks(path: &Path) -> Vec<(u32, Vec<u8>)> {
    blocks_of(&fs::read(path).expect("the capture exists"))
}

fn blocks_of(mut rest: &[u8]) -> Vec<(u32, Vec<u8>)> {
    let mut blocks = Vec::new();
    while !rest.is_empty() {
        let length = word(rest, 4) as usize;
        blocks.push((word(rest, 0), rest[8..length - 4].to_vec()));
        rest = &rest[length..];
    }
    blocks
}

/// Interface, time and first byte of each frame.
fn frames(blocks: &[(u32, Vec<u8>)]) -> Vec<(u32, u64, u8)> {
    let packets = blocks.iter().filter(|(kind, _)| *kind == 6);
    packets
        .map(|(_, body)| (word(body, 0), u64::from(word(body, 4)) << 32 | u64::from(word(body, 8)), body[20]))
        .collect()
}

// covers: capture
#[test]
fn frames_of_two_threads_are_in_one_file_in_the_order_of_time() {
    let shared = Arc::new(Shared { lost_by_kernel: Vec::new(), end: AtomicBool::new(false), failure: OnceLock::new() });
    let taps = Taps::new(2);
    let mut producers = [taps.tap_with(4096), taps.tap_with(4096)];
    let writer = Writer::new(Vec::new(), &[("a", ""), ("b", "")]).expect("writing to memory succeeds");
    let reader = taps.read().expect("there is no other");
    let mut scribe = WritingThread { writer, shared, reader, recorded: vec![Recorded::default(); 2] };
    let mut put = |thread: usize, time_ns: u64| {
        producers[thread].record(thread, Direction::Out, time_ns, &[time_ns as u8; 60]);
    };
    let written = |scribe: &WritingThread<Vec<u8>>| scribe.recorded[0].sent + scribe.recorded[1].sent;
    put(0, 10);
    put(0, 30);
    scribe.empty(false, true).expect("writing to memory succeeds");
    assert_eq!(written(&scribe), 0, "another thread may still add an older frame");
    // The thread was preempted between reading the clock and writing to the queue.
    put(1, 20);
    put(1, 40);
    scribe.empty(false, true).expect("writing to memory succeeds");
    assert_eq!(written(&scribe), 3);
    put(0, 35);
    scribe.empty(true, true).expect("writing to memory succeeds");
    let frames = frames(&blocks_of(&scribe.writer.into_inner()));
    assert_eq!(frames, [(0, 10, 10), (1, 20, 20), (0, 30, 30), (0, 35, 35), (1, 40, 40)]);
}

#[test]
fn frames_of_two_threads_at_once_are_all_in_the_file() {
    let scratch = Scratch::new();
    let recorder = Recorder::start(&scratch.0, &[("a", ""), ("b", "")]).expect("a file");
    let taps = [recorder.tap(), recorder.tap()];
    thread::scope(|scope| {
        for (number, mut tap) in taps.into_iter().enumerate() {
            let direction = if number == 0 { Direction::Out } else { Direction::In };
            scope.spawn(move || (0..3000).for_each(|step| tap.record(number, direction, step, &[step as u8; 60])));
        }
    });
    let recorded = recorder.finish().expect("the capture is written");
    assert_eq!(recorded[0], Recorded { sent: 3000, ..Recorded::default() });
    assert_eq!(recorded[1], Recorded { received: 3000, ..Recorded::default() });
    let frames = frames(&blocks(&scratch.0));
    for number in 0..2 {
        let own = frames.iter().filter(|(interface, ..)| *interface == number);
        assert!(own.map(|(_, time, _)| *time).eq(0..3000));
    }
}

// covers: capture
#[test]
fn frames_lost_to_a_full_queue_are_in_the_statistics() {
    let scratch = Scratch::new();
    let recorder = Recorder::start(&scratch.0, &[("a", ""), ("b", "")]).expect("a file");
    let mut tap = recorder.taps.tap_with(1024);
    for length in [60, 1514, 60, 60, 1514] {
        tap.record(1, Direction::Out, 7, &vec![0xEE; length]);
    }
    recorder.set_lost_by_kernel(0, 5);
    let recorded = recorder.finish().expect("the capture is written");
    assert_eq!(recorded[0], Recorded { lost_by_kernel: 5, ..Recorded::default() });
    assert_eq!(recorded[1], Recorded { sent: 3, lost: 2, ..Recorded::default() });
    let blocks = blocks(&scratch.0);
    assert_eq!(frames(&blocks).len() as u64, recorded[1].sent);
    let statistics: Vec<&Vec<u8>> = blocks.iter().filter(|(kind, _)| *kind == 5).map(|(_, body)| body).collect();
    assert_eq!(statistics.len(), 2);
    for (interface, body) in statistics.into_iter().enumerate() {
        assert_eq!(word(body, 0) as usize, interface);
        // Three options of eight bytes after interface and time: seen, lost, lost by the kernel.
        let option = |at: usize| (word(body, 12 + 12 * at), u64::from(word(body, 16 + 12 * at)));
        let of = recorded[interface];
        assert_eq!(option(0), (0x0008_0004, of.received + of.sent + of.lost));
        assert_eq!(option(1), (0x0008_0005, of.lost));
        assert_eq!(option(2), (0x0008_0007, of.lost_by_kernel));
    }
}

#[test]
fn times_of_another_clock_become_unix_time_for_all_taps() {
    let scratch = Scratch::new();
    let recorder = Recorder::start(&scratch.0, &[("a", "")]).expect("a file");
    let mut taps = [recorder.tap(), recorder.tap()];
    let before = unix_now_ns();
    for tap in &mut taps {
        tap.set_clock(1000);
        tap.record(0, Direction::In, 1500, &[1; 60]);
    }
    recorder.finish().expect("the capture is written");
    let frames = frames(&blocks(&scratch.0));
    assert_eq!(frames[0], frames[1]);
    let since = frames[0].1 - before;
    assert!((500..10_000_000_000).contains(&since), "{since} ns");
}

#[test]
fn a_capture_is_complete_when_its_recorder_is_dropped() {
    let scratch = Scratch::new();
    let recorder = Recorder::start(&scratch.0, &[("a", "")]).expect("a file");
    let mut tap = recorder.tap();
    tap.record(0, Direction::In, 0, &[1; 60]);
    drop(recorder);
    let kinds: Vec<u32> = blocks(&scratch.0).iter().map(|(kind, _)| *kind).collect();
    assert_eq!(kinds, [0x0A0D_0D0A, 1, 6, 5]);
    // The writing thread has ended; this must not block a producer.
    tap.record(0, Direction::In, 0, &[1; 60]);
}

// covers: capture
#[test]
fn an_error_of_writing_names_the_file_and_the_remedy() {
    let start = |path: &str| Recorder::start(Path::new(path), &[("a", "")]).expect_err("no file").to_string();
    let missing = start("/nowhere/at/all.pcapng");
    assert!(missing.contains("/nowhere/at/all.pcapng") && missing.ends_with("make its directory first"), "{missing}");
    assert!(start("/").ends_with("name a file in it"));
    let full = start("/dev/full");
    assert!(full.contains("No space left") && full.contains("make room"), "{full}");
}

/// Interface and first byte of the frames that a reader takes.
fn taken(reader: &mut FrameReader) -> Vec<(usize, u8)> {
    let mut taken = Vec::new();
    let all = reader.read_all(|note, frame| {
        taken.push((note.interface, frame[0]));
        Ok::<(), ()>(())
    });
    all.expect("nothing fails");
    taken
}

// covers: capture
#[test]
fn taps_record_while_they_have_a_reader_and_for_one_at_a_time() {
    let taps = Taps::new(2);
    let mut early = taps.tap_with(4096);
    let put = |tap: &mut Tap, interface: usize, byte: u8| {
        tap.record(interface, Direction::In, u64::from(byte), &[byte; 60]);
    };
    put(&mut early, 0, 1);
    let mut reader = taps.read().expect("it is the only one");
    assert_eq!(taps.read().err(), Some(AlreadyRead));
    put(&mut early, 0, 2);
    // A tap of a thread that begins later.
    let mut late = taps.clone().tap_with(4096);
    put(&mut late, 1, 3);
    put(&mut early, 1, 4);
    assert_eq!(taken(&mut reader), [(0, 2), (1, 3), (1, 4)]);
    // The last frames of a tap that is gone, and its losses.
    (0..100).for_each(|_| put(&mut late, 0, 5));
    drop(late);
    let last = taken(&mut reader);
    assert_eq!(last.len() as u64 + reader.lost(0), 100);
    assert!(reader.lost(0) > 0 && taken(&mut reader).is_empty());
    assert_eq!((reader.lost(0) + last.len() as u64, reader.taps()), (100, 1));
    put(&mut early, 0, 6);
    drop(reader);
    put(&mut early, 0, 7);
    let mut again = taps.read().expect("the first one has ended");
    assert_eq!((taken(&mut again), again.lost(0)), (vec![], 0));
    put(&mut early, 0, 8);
    assert_eq!(taken(&mut again), [(0, 8)]);
}

// covers: capture
#[test]
fn two_captures_follow_each_other_on_the_same_taps() {
    let (taps, names) = (Taps::new(1), [("a", "")]);
    let mut tap = taps.tap_with(1 << 16);
    let scratch = [Scratch::new(), Scratch::new()];
    for (number, file) in scratch.iter().enumerate() {
        let recorder = Recorder::of(&taps, &file.0, &names).expect("a file");
        let busy = Recorder::of(&taps, &scratch[1 - number].0, &names).expect_err("it is read");
        assert!(busy.to_string().ends_with("end the other capture first"), "{busy}");
        (0..10).for_each(|at| tap.record(0, Direction::Out, at, &[number as u8; 60]));
        assert_eq!(recorder.finish().expect("it is written")[0].sent, 10);
        tap.record(0, Direction::Out, 99, &[9; 60]);
        assert_eq!(frames(&blocks(&file.0)).iter().filter(|(.., byte)| *byte == number as u8).count(), 10);
    }
}
