//! Mailbox services with both halves in threads of their own, on a simulated segment in real time.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::shared_segment::SharedSegment;
use ringcat::{Error, LastOutputs, Limits, Options, RequestState, SdoAddress, SupervisorThread, automatic};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::al::AlState;

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const LIMITS: Limits = (Duration::from_secs(5), Duration::from_secs(10));

#[test]
fn objects_and_files_are_moved_from_any_thread_and_requests_from_the_cyclic_one() -> Result<(), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    // Before activation, in PREOP.
    supervisor.bring_to(1, AlState::PreOp)?;
    let large = supervisor.sdo_upload(1, SdoAddress::new(0x2002, 0), LIMITS, 200_000)?;
    assert_eq!(large.len(), 100_000);
    let mut request = supervisor.create_sdo_request(1, 4)?;
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    let read = Arc::new(AtomicU32::new(0));
    let seen = read.clone();
    let cycles = application.start_cycles(
        || (),
        move |_| {
            match request.state() {
                RequestState::Success => {
                    let mut value = [0; 4];
                    request.data(&mut value);
                    seen.store(u32::from_le_bytes(value), Ordering::Relaxed);
                    let _ = request.read();
                }
                RequestState::Unused | RequestState::Error => {
                    let _ = request.set_object(0x2001, 7, false);
                    let _ = request.read();
                }
                RequestState::Busy => {}
            }
            ControlFlow::Continue(())
        },
    )?;
    let end = Instant::now() + LIMIT;
    while !cycles.supervisor().all_settled() {
        assert!(Instant::now() < end, "all are in OP");
        sleep(Duration::from_millis(1));
    }
    // During process data, by a handle of its own.
    let handle = cycles.supervisor().clone();
    handle.sdo_download(1, SdoAddress::new(0x2001, 7), vec![0x34, 0x12], LIMITS)?;
    while read.load(Ordering::Relaxed) != 0x1234 {
        assert!(Instant::now() < end, "the cyclic thread reads what another one wrote");
        sleep(Duration::from_millis(1));
    }
    let error = handle.sdo_upload(1, SdoAddress::new(0x7777, 0), LIMITS, 4).expect_err("there is no such object");
    assert!(error.to_string().contains("0x06020000"), "{error}");
    let file = handle.run(|engine| {
        let mailbox = engine.mailbox(1);
        async move {
            let mailbox = mailbox.expect("it is declared");
            let options = FoeOptions { limits: LIMITS, ..FoeOptions::default() };
            foe::write(&mailbox, "recipe", options, &mut Bytes::new(&[7; 3000]), |_| ()).await?;
            let mut sink = Bounded::new(3000);
            foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await?;
            Ok::<_, foe::FoeError>(sink.into_bytes())
        }
    })?;
    assert_eq!(file, Ok(vec![7; 3000]));
    let (supervisor, _) = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    let gone = supervisor.sdo_upload(1, SdoAddress::new(0x2001, 7), LIMITS, 4).expect_err("it is in INIT");
    assert!(gone.to_string().contains("the mailbox is not in use"), "{gone}");
    Ok(())
}
