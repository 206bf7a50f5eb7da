//! A CiA 402 drive in cyclic synchronous position mode with distributed clocks: it is switched on, moves there and
//! back, and is switched off.
//!
//! `cargo run -p ringcat --example csp_drive` on a simulated segment;
//! `cargo run -p ringcat --example csp_drive -- eth1` (as root) on a network interface with one drive as its first
//! SubDevice, whose PDOs have 0x6040, 0x607A, 0x6060, 0x6041 and 0x6064. The drive moves by two turns.

use std::error::Error;
use std::time::Duration;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{
    AlState, Application, ClockConfig, Declaration, Input, LastOutputs, Links, MainDevice, MapError, Options, Output,
    ProcessData, SubDeviceConfig, SubDeviceId, SyncSignals, Trigger,
};

const PERIOD: Duration = Duration::from_millis(1);
const PERIOD_NS: u32 = 1_000_000;
/// Cycles begin so much after SYNC0: outputs are there well before the next one.
const PHASE_NS: i64 = 300_000;
const LIMIT: Duration = Duration::from_secs(30);
const CYCLIC_POSITION: i8 = 8;
const INCREMENTS: i32 = 2 * 131_072;
/// Increments per cycle.
const SPEED: i32 = 100;

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"servo\"\n";

fn main() -> Result<(), Box<dyn Error>> {
    match std::env::args().nth(1) {
        Some(interface) => run(PacketLinks::open(&interface, None, ReceiveMode::Blocking)?),
        None => run(SimulatedSegment::from_toml(SEGMENT)?),
    }
}

/// The drive's process data.
#[derive(Clone, Copy)]
struct Drive {
    control_word: Output<u16>,
    target: Output<i32>,
    mode: Output<i8>,
    status_word: Input<u16>,
    actual: Input<i32>,
}

impl Drive {
    fn new<L: Links>(application: &Application<L>, drive: SubDeviceId) -> Result<Drive, MapError> {
        Ok(Drive {
            control_word: application.output(drive, 0x6040, 0)?,
            target: application.output(drive, 0x607A, 0)?,
            mode: application.output(drive, 0x6060, 0)?,
            status_word: application.input(drive, 0x6041, 0)?,
            actual: application.input(drive, 0x6064, 0)?,
        })
    }

    /// One step towards "operation enabled" (CiA 402, state machine); true there.
    fn switch_on(self, data: &mut ProcessData<'_>) -> bool {
        let status = data.get(self.status_word);
        let control = match status & 0x6F {
            0x0008 | 0x0028 | 0x0048 | 0x0068 => 0x80, // fault: reset
            0x0021 => 0x07,                            // ready to switch on: switch on
            0x0023 | 0x0027 => 0x0F,                   // switched on: enable operation
            _ => 0x06,                                 // shut down
        };
        data.set(self.control_word, control);
        data.set(self.mode, CYCLIC_POSITION);
        let enabled = status & 0x6F == 0x0027;
        if !enabled {
            // Without this the drive would jump when it is enabled.
            data.set(self.target, data.get(self.actual));
        }
        enabled
    }
}

fn run<L: Links + 'static>(links: L) -> Result<(), Box<dyn Error>> {
    let mut main_device = MainDevice::request(links, &Options::default());
    main_device.scan()?;
    let mut declaration = Declaration::new(PERIOD).with_clocks(ClockConfig::default());
    let config = SubDeviceConfig::at_position(0).sync(SyncSignals::sync0(PERIOD_NS, 0));
    let id = declaration.add(config);
    let mut application = main_device.activate(declaration)?;
    let drive = Drive::new(&application, id)?;

    // Cycles follow the drive's clock.
    application.set_trigger(Trigger::ReferenceClock { phase_ns: PHASE_NS });
    application.wait_until_op_with(LIMIT, |data| data.set(drive.target, data.get(drive.actual)))?;
    println!("in OP, phase error {} ns", application.follower().map_or(0, |follower| follower.error_ns()));

    // In OP the clocks of the SubDevices agree. Cycles come to their phase soon after.
    let end = application.now() + LIMIT;
    while !application.follower().is_some_and(|follower| follower.is_locked()) {
        application.cycle(|data| data.set(drive.target, data.get(drive.actual)));
        if application.now() >= end {
            return Err("cycles do not keep their phase: does this computer wake up late?".into());
        }
    }
    println!("cycles keep their phase");
    while !application.cycle(|data| drive.switch_on(data)) {
        if application.now() >= end {
            return Err("the drive is not enabled: look at its error code (0x603F)".into());
        }
    }
    let start = application.cycle(|data| data.get(drive.actual));
    println!("enabled at {start}");
    let mut worst = 0;
    for step in (0..=INCREMENTS / SPEED).chain((0..INCREMENTS / SPEED).rev()) {
        let following_error = application.cycle(|data| {
            data.set(drive.target, start + step * SPEED);
            start + step * SPEED - data.get(drive.actual)
        });
        worst = worst.max(following_error.abs());
        while let Some(event) = application.pop_event() {
            println!("{}", describe(&event, &Names::default()));
        }
    }
    // It comes to rest.
    let mut actual = start;
    for _ in 0..200 {
        actual = application.cycle(|data| data.get(drive.actual));
    }
    println!("back at {actual}, largest following error {worst} increments");
    for _ in 0..50 {
        application.cycle(|data| data.set(drive.control_word, 0x06));
    }
    application.stop(LastOutputs::Held, AlState::Init, LIMIT)?;
    if (actual - start).abs() > SPEED {
        return Err(format!("the drive is {} increments off", actual - start).into());
    }
    Ok(())
}
