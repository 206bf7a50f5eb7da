use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_link::pcapng::Direction;

use super::*;
use crate::record_requests::NoRecord;

struct Place(PathBuf);

impl Place {
    fn new(name: &str) -> Place {
        let path = std::env::temp_dir().join(format!("ringcat-record-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("it can be made");
        Place(path)
    }

    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).expect("it is there").flatten();
        let mut names: Vec<String> = entries.filter_map(|it| it.file_name().into_string().ok()).collect();
        names.sort_unstable();
        names
    }

    fn record(&self, taps: &Taps, files: u32) -> FrameRecord {
        let mut settings = DebugRing::default();
        (settings.directory, settings.files, settings.cycles) = (self.0.clone(), files, 10);
        FrameRecord::start(taps, 0, vec!["eth1".to_owned()], settings).expect("nothing else reads")
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // It is below the directory for temporary files.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn domain(state: DomainState, incomplete: u64) -> Event {
    let mut status = DomainStatus::default();
    status.state = state;
    Event::Domain { domain: DomainId(0), status, incomplete }
}

// covers: daemon, capture
#[test]
fn a_fault_writes_the_frames_before_it_and_shortly_after_it() {
    let place = Place::new("fault");
    let taps = Taps::new(1);
    let (mut tap, mut record) = (taps.tap_with(1 << 16), place.record(&taps, 5));
    let begin = Instant::now();
    tap.record(0, Direction::Out, 1_000, &[0x11; 60]);
    record.take_frames();
    record.take(&Event::Lost { subdevice: SubDeviceId(0) }, begin);
    assert_eq!(record.look(begin, true), []);
    tap.record(0, Direction::In, 2_000, &[0x22; 60]);
    let early = begin + AFTER - Duration::from_millis(1);
    assert_eq!((record.look(early, true), place.files().len()), (Vec::new(), 0));
    assert_eq!(record.look(begin + AFTER, true), []);
    let lines = record.end(begin + AFTER);
    let [(_, text)] = &lines[..] else { panic!("{lines:?}") };
    let [file] = &place.files()[..] else { panic!("{:?}", place.files()) };
    assert!(text.contains("The last 2 frames are in ") && text.contains(file.as_str()), "{text}");
    assert!(file.starts_with("ringcat-0-") && file.ends_with("-lost.pcapng"), "{file}");
    let bytes = std::fs::read(place.0.join(file)).expect("it can be read");
    assert!([[0x11; 60], [0x22; 60]].iter().all(|frame| bytes.windows(60).any(|it| it == frame)));
}

// covers: daemon, capture
#[test]
fn an_interruption_counts_by_cycles_or_time_and_only_after_a_complete_cycle() {
    let place = Place::new("cycles");
    let taps = Taps::new(1);
    let begin = Instant::now();
    let due = |events: &[Event], later: Duration| {
        let mut record = place.record(&taps, 5);
        events.iter().for_each(|event| record.take(event, begin));
        record.look(begin + later, true);
        record.due.map(|(reason, _)| reason)
    };
    let complete = domain(DomainState::Complete, 0);
    let broken = domain(DomainState::Incomplete, 1);
    let late = INTERRUPTION;
    assert_eq!(due(std::slice::from_ref(&broken), late), None, "before the first complete cycle");
    assert_eq!(due(&[complete.clone(), broken.clone()], Duration::ZERO), None);
    assert_eq!(due(&[complete.clone(), broken.clone()], late), Some(RecordReason::WorkingCounter));
    let ended = |cycles| [complete.clone(), broken.clone(), domain(DomainState::Complete, cycles)];
    assert_eq!(due(&ended(9), late), None);
    assert_eq!(due(&ended(10), late), Some(RecordReason::WorkingCounter));
}

// covers: daemon, capture
#[test]
fn there_is_a_largest_number_of_files_and_a_pause_between_them() {
    let place = Place::new("room");
    std::fs::write(place.0.join("ringcat-01-other.pcapng"), []).expect("it can be written");
    let (taps, taps_of_next) = (Taps::new(1), Taps::new(1));
    let mut record = place.record(&taps, 2);
    let mut now = Instant::now();
    for round in 0..4 {
        record.note(RecordReason::LinkDown, now);
        assert_eq!(record.end(now).len(), 1, "{round}");
        record.note(RecordReason::LinkDown, now + Duration::from_secs(1));
        assert_eq!(record.due, None, "a moment after a file");
        let mut next = place.record(&taps_of_next, 2).with_last_written(record.last_written.clone());
        next.note(RecordReason::OwnerLost, now + Duration::from_secs(1));
        assert_eq!(next.due, None, "a moment after a file of the one before");
        now += PAUSE;
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(place.files().len(), 3, "two, and one that is not ours: {:?}", place.files());
}

/// Calls as the bus log does, until a request is answered.
fn answered(record: &mut FrameRecord, mut now: Instant) -> Result<WrittenRecord, NoRecord> {
    let requests = record.requests();
    std::thread::scope(|scope| {
        let waiting = scope.spawn(move || requests.write(Duration::from_secs(60)));
        while !waiting.is_finished() {
            record.look(now, true);
            now += Duration::from_millis(100);
            std::thread::sleep(Duration::from_millis(1));
        }
        waiting.join().expect("no panic")
    })
}

// covers: daemon, capture
#[test]
fn a_request_writes_a_file_at_any_time_and_keeps_none_of_a_fault_from_being_written() {
    let place = Place::new("requested");
    let taps = Taps::new(1);
    let (mut tap, mut record) = (taps.tap_with(1 << 16), place.record(&taps, 3));
    let begin = Instant::now();
    record.note(RecordReason::LinkDown, begin);
    assert_eq!(record.end(begin).len(), 1);
    for _ in 0..4 {
        tap.record(0, Direction::Out, 1_000, &[0x33; 60]);
        let written = answered(&mut record, begin).expect("a file, shortly after that of a fault");
        assert!((written.frames, written.lost) == (1, 0) && written.path.is_file(), "{written:?}");
        assert!(written.path.to_string_lossy().ends_with("-requested.pcapng"), "{written:?}");
    }
    let files = place.files();
    assert!(files.len() == 3 && files[0].ends_with("-link-down.pcapng"), "{files:?}");
    let later = begin + PAUSE;
    answered(&mut record, later).expect("a file");
    record.note(RecordReason::Lost, later);
    assert_eq!(record.due.map(|(reason, _)| reason), Some(RecordReason::Lost), "a fault after a request");
    let written = answered(&mut record, later).expect("the file of the fault");
    assert!(written.path.to_string_lossy().ends_with("-lost.pcapng"), "{written:?}");
    record.due = Some((RecordReason::Requested, later));
    record.note(RecordReason::StateLeft, later + 2 * PAUSE);
    assert_eq!(record.due, Some((RecordReason::StateLeft, later + 2 * PAUSE + AFTER)));
}

// covers: daemon, capture
#[test]
fn a_request_is_told_why_there_is_no_file() {
    let place = Place::new("refused");
    let taps = Taps::new(1);
    let mut record = place.record(&taps, 3);
    record.settings.directory = place.0.join("none");
    let failed = answered(&mut record, Instant::now()).expect_err("there is no such directory");
    assert!(matches!(&failed, NoRecord::Failed(why) if why.contains("cannot be written in ")), "{failed:?}");
    let requests = record.requests();
    drop(record);
    assert_eq!(requests.write(Duration::from_secs(9)), Err(NoRecord::NotKept));
}
