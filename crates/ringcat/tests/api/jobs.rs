//! One service in all forms: before activation, polled beside cycles, from any thread, as a job.

use std::future::Future;
use std::ops::ControlFlow;
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll, Wake, Waker};
use std::thread::{Thread, current, park};
use std::time::{Duration, Instant};

use ringcat::Position;
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::wire::address::RegisterAddress;
use ringcat::{
    AlState, Error, LastOutputs, MainDevice, Options, SubDeviceId, SupervisorThread, TransferLimits, automatic,
};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const TRANSFER: TransferLimits = TransferLimits::new(Duration::from_secs(5), Duration::from_secs(10));
/// Type, revision and build of a controller.
const TYPE: RegisterAddress = RegisterAddress(0x0000);
/// An object that takes many segments.
const LARGE: u16 = 0x2002;
const MAILBOX_DEVICE: SubDeviceId = SubDeviceId(1);

fn supervisor() -> Result<(SupervisorThread, SharedSegment), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new("."))?;
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment)?);
    Ok((SupervisorThread::start(acyclic, &Options::default(), || ())?, cyclic))
}

/// Wakes a thread that is parked.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// An executor of one future.
fn block_on<T>(future: impl Future<Output = T>) -> T {
    let waker = Waker::from(Arc::new(Unpark(current())));
    let mut future = pin!(future);
    loop {
        match future.as_mut().poll(&mut Context::from_waker(&waker)) {
            Poll::Ready(result) => return result,
            Poll::Pending => park(),
        }
    }
}

// covers: jobs
#[test]
fn one_service_works_before_activation_beside_cycles_and_from_any_thread() -> Result<(), Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    let found = main_device.scan()?;
    let expected = main_device.subdevice(Position(1)).register_read_bytes(TYPE, 3)?;
    assert!(main_device.subdevice(Position(99)).register_read_bytes(TYPE, 3).is_err(), "there is no such SubDevice");

    let mut application = main_device.activate(automatic(&found.subdevices, PERIOD))?;
    let mut read = application.subdevice(MAILBOX_DEVICE).register_read_bytes(TYPE, 3);
    let mut cycles = 0;
    let polled = loop {
        if let Some(result) = read.take() {
            break result;
        }
        assert!(cycles < 1_000 && read.is_running(), "no result after {cycles} cycles");
        application.cycle(|_| ());
        cycles += 1;
    };
    assert_eq!(polled.as_ref(), Ok(&expected));
    assert!(cycles > 0, "frames have to come and go");

    let (supervisor, _cyclic) = supervisor()?;
    supervisor.scan()?;
    assert_eq!(supervisor.subdevice(Position(1)).register_read_bytes(TYPE, 3)?, expected);
    assert_eq!(supervisor.background().subdevice(Position(1)).register_read_bytes(TYPE, 3).finish()?, expected);
    let failed = supervisor.background().subdevice(Position(99)).register_read_bytes(TYPE, 3).finish();
    let failed = failed.expect_err("there is no such SubDevice").to_string();
    assert!(failed.contains("the scan found no such position"), "{failed}");
    Ok(())
}

// covers: jobs
#[test]
fn a_job_is_waited_for_with_a_limit_polled_and_awaited() -> Result<(), Error> {
    let (supervisor, _cyclic) = supervisor()?;
    supervisor.scan()?;
    let mailbox_device = supervisor.background().subdevice(Position(1)).limits(TRANSFER.with_bytes(200_000));
    let start = || mailbox_device.sdo_read::<Vec<u8>>(LARGE, 0);

    let mut limited = start();
    assert!(limited.wait_for(Duration::ZERO).is_none(), "segments take time");
    let value = limited.wait_for(Duration::MAX).expect("no limit is reached")?.expect("it is there");
    assert_eq!(value.len(), 100_000);
    assert!(matches!(limited.take(), Some(Err(Error::Gone))), "the result comes once");

    let mut polled = start();
    let end = Instant::now() + LIMIT;
    let value = loop {
        assert!(Instant::now() < end, "it comes to its end");
        if let Some(result) = polled.take() {
            break result?.expect("it is there");
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(value.len(), 100_000);

    assert_eq!(block_on(start())?.expect("it is there").len(), 100_000);
    Ok(())
}

// covers: jobs
#[test]
fn a_stop_ends_jobs_and_an_abort_leaves_the_mailbox_free() -> Result<(), Error> {
    let (supervisor, cyclic) = supervisor()?;
    let found = supervisor.scan()?;
    let application = supervisor.activate(automatic(&found.subdevices, PERIOD), cyclic)?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    let end = Instant::now() + LIMIT;
    while !cycles.supervisor().all_settled() {
        assert!(Instant::now() < end, "all are in OP");
        std::thread::sleep(Duration::from_millis(1));
    }
    let supervisor = cycles.supervisor().clone();
    let mailbox_device = supervisor.background().subdevice(MAILBOX_DEVICE).limits(TRANSFER.with_bytes(200_000));
    let start = || mailbox_device.sdo_read::<Vec<u8>>(LARGE, 0);
    start().abort()?;
    drop(start());
    assert_eq!(supervisor.subdevice(MAILBOX_DEVICE).sdo_read::<Vec<u8>>(0x2001, 7)?.len(), 2);

    // Never ready: only the stop ends it.
    let endless = supervisor.start_job(|_| std::future::pending::<()>());
    let mut open = supervisor.start_job(|_| std::future::pending::<()>());
    assert!(open.wait_for(Duration::from_millis(20)).is_none(), "it goes on");
    let supervisor = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?.supervisor;
    assert!(matches!(endless.wait(), Err(Error::Gone)));
    assert!(matches!(block_on(open), Err(Error::Gone)));
    // Beside a thread that goes on, a result that is not wanted any more is no obstacle.
    drop(supervisor.start_job(|_| async { 7 }));
    assert_eq!(supervisor.run(|_| async { 7 })?, 7);
    Ok(())
}
