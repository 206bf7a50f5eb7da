//! Mailbox services with both halves in threads of their own, on a simulated segment in real time.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::shared_segment::SharedSegment;
use ringcat::{
    Error, LastOutputs, Limits, Options, RawDatagram, RequestState, SdoAddress, Services, SubDeviceId,
    SupervisorThread, TransferLimits, automatic,
};
use ringcat_engine::mail::coe;
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{LoopControl, map};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const MAILBOX_DEVICE: SubDeviceId = SubDeviceId(1);
/// Memory that nothing uses.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);
const LIMITS: Limits = Limits::new(Duration::from_secs(5), Duration::from_secs(10));
const TRANSFER: TransferLimits = TransferLimits::new(LIMITS.request, LIMITS.answer);

// covers: jobs
#[test]
fn objects_and_files_are_moved_from_any_thread_and_requests_from_the_cyclic_one() -> Result<(), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    // Before activation, in PREOP.
    let mailbox_device = supervisor.subdevice(Position(1)).limits(TRANSFER.with_bytes(200_000));
    assert_eq!(mailbox_device.sdo_read::<Vec<u8>>(0x2002, 0)?.len(), 100_000);
    let mut request = supervisor.create_sdo_request(MAILBOX_DEVICE, 4)?;
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
    cycles.supervisor().wait_until_op(LIMIT)?;
    // During process data, by a handle of its own.
    let handle = cycles.supervisor().clone();
    let mailbox_device = handle.subdevice(MAILBOX_DEVICE).limits(TRANSFER);
    mailbox_device.sdo_write(0x2001, 7, 0x1234u16)?;
    let end = Instant::now() + LIMIT;
    while read.load(Ordering::Relaxed) != 0x1234 {
        assert!(Instant::now() < end, "the cyclic thread reads what another one wrote");
        sleep(Duration::from_millis(1));
    }
    let error = mailbox_device.sdo_read::<u32>(0x7777, 0).expect_err("there is no such object");
    assert!(error.to_string().contains("0x06020000"), "{error}");
    assert_eq!(file_there_and_back(&handle)?, vec![7; 3000]);
    let supervisor = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?.supervisor;
    let gone = supervisor.subdevice(MAILBOX_DEVICE).sdo_read::<u16>(0x2001, 7).expect_err("nothing is active");
    assert!(gone.to_string().contains("no declaration is active"), "{gone}");
    Ok(())
}

/// A file written and read by functions of the engine that run in its thread.
fn file_there_and_back(handle: &SupervisorThread) -> Result<Vec<u8>, Error> {
    let file = handle.run(|engine| {
        let mailbox = engine.mailbox(MAILBOX_DEVICE);
        async move {
            let mailbox = mailbox.expect("it is declared");
            let options = FoeOptions::default().with_limits(LIMITS);
            foe::write(&mailbox, "recipe", options, &mut Bytes::new(&[7; 3000]), |_| ()).await?;
            let mut sink = Bounded::new(3000);
            foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await?;
            Ok::<_, foe::FoeError>(sink.into_bytes())
        }
    })?;
    Ok(file.expect("the file is transferred"))
}

// covers: jobs, registers, rescan
#[test]
fn services_on_single_subdevices_and_jobs_work_from_any_thread() -> Result<(), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    // Before activation.
    let mailbox_device = supervisor.subdevice(Position(1));
    mailbox_device.register_write(USER_RAM, vec![1, 2, 3])?;
    assert_eq!(mailbox_device.register_read_bytes(USER_RAM, 3)?, [1, 2, 3]);
    let image = mailbox_device.sii_read()?;
    assert!(mailbox_device.sii_write(image[..64].to_vec(), false).is_err(), "no image");
    assert_eq!(mailbox_device.sii_write(image, false)?.written, 0);
    assert_eq!(supervisor.statistics(MAILBOX_DEVICE)?, None);
    assert!(!supervisor.force_topology_change()?);
    assert!(supervisor.rescan(LIMIT).is_err(), "nothing is declared");
    let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    cycles.supervisor().wait_until_op(LIMIT)?;
    let handle = cycles.supervisor().clone();
    assert_eq!(handle.subdevice(MAILBOX_DEVICE).read_statistics()?.readings, 1);
    handle.subdevice(MAILBOX_DEVICE).clear_statistics()?;
    assert_eq!(handle.subdevice(MAILBOX_DEVICE).port(0)?, LoopControl::Auto);
    let rescan = handle.rescan(LIMIT)?;
    assert!(rescan.is_complete() && rescan.subdevices.len() == 2 && rescan.missing.is_empty(), "{rescan:?}");
    let read = RawDatagram::new(Command::Brd, Target::Broadcast(map::TYPE), vec![0]).with_resend(true);
    let replies = handle.datagrams(vec![read.clone(), read])?;
    assert!(replies.iter().all(|reply| reply.as_ref().is_ok_and(|reply| reply.wkc().0 == 2)), "{replies:?}");
    // Jobs: one that is waited for, one that is aborted, and one that is dropped.
    let start = |object: SdoAddress| {
        handle.start_job(move |engine| {
            let mailbox = engine.mailbox(SubDeviceId(1)).expect("it is declared");
            async move { coe::read(&mailbox, object, LIMITS, 200_000).await }
        })
    };
    let [large, small] = [SdoAddress::new(0x2002, 0), SdoAddress::new(0x2001, 7)];
    start(large).abort()?;
    drop(start(large));
    assert_eq!(start(small).wait()?.map(|value| value.len()), Ok(2));
    assert_eq!(start(large).wait()?.map(|value| value.len()), Ok(100_000));
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
