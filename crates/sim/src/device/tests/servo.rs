//! Tests of the drive through its process image: power states, modes, homing, limits, physics of motor and load.

mod homing;
mod limits;
mod modes;
mod physics;
mod power;

use core::time::Duration;

use ringcat_wire::al::AlState;

use super::client::Client;
use crate::catalogue::{self, parts};
use crate::description::{DeviceDescription, data_type};

/// State bits of the statusword.
const STATE: u16 = 0x006F;
const SWITCH_ON_DISABLED: u16 = 0x0040;
const READY_TO_SWITCH_ON: u16 = 0x0021;
const SWITCHED_ON: u16 = 0x0023;
const OPERATION_ENABLED: u16 = 0x0027;
const QUICK_STOP_ACTIVE: u16 = 0x0007;
const FAULT_REACTION_ACTIVE: u16 = 0x000F;
const FAULT: u16 = 0x0008;

const TARGET_REACHED: u16 = 0x0400;
const INTERNAL_LIMIT: u16 = 0x0800;
const BIT_12: u16 = 0x1000;
const BIT_13: u16 = 0x2000;

const ENABLE: u16 = 0x000F;
const QUICK_STOP: u16 = 0x0002;
const SHUTDOWN: u16 = 0x0006;
const SWITCH_ON: u16 = 0x0007;
const NEW_SET_POINT: u16 = 0x0010;
const HALT: u16 = 0x0100;

/// Values of the inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Feedback {
    status: u16,
    position: i32,
    machine: i32,
    velocity: i32,
    torque: i16,
    following_error: i32,
    mode: i8,
    brake: u8,
    error: u16,
}

impl Feedback {
    fn state(&self) -> u16 {
        self.status & STATE
    }

    fn has(&self, bits: u16) -> bool {
        self.status & bits == bits
    }
}

/// A drive in OP, a cycle of 1 ms, and the outputs of the next cycle.
struct Axis {
    client: Client,
    control: u16,
    mode: i8,
    position: i32,
    velocity: i32,
    torque: i16,
    last: Feedback,
}

/// The drive with process data for all values that the tests check.
fn described() -> DeviceDescription {
    use data_type::{I8, I16, I32, U8, U16};
    let mut described = catalogue::by_name("servo").unwrap();
    let entry = |index, sub_index, kind, bits| parts::entry(index, sub_index, "", kind, bits);
    described.pdos[0].entries = vec![
        entry(0x6040, 0, U16, 16),
        entry(0x607A, 0, I32, 32),
        entry(0x60FF, 0, I32, 32),
        entry(0x6071, 0, I16, 16),
        entry(0x6060, 0, I8, 8),
    ];
    described.pdos[2].entries = vec![
        entry(0x6041, 0, U16, 16),
        entry(0x6064, 0, I32, 32),
        entry(0x6063, 0, I32, 32),
        entry(0x606C, 0, I32, 32),
        entry(0x6077, 0, I16, 16),
        entry(0x60F4, 0, I32, 32),
        entry(0x6061, 0, I8, 8),
        entry(0x60FE, 1, U8, 8),
        entry(0x603F, 0, U16, 16),
    ];
    for number in [2, 3] {
        described.sync_managers[usize::from(number)].length = described.default_length(number);
    }
    described
}

impl Axis {
    /// A drive in OP that is not enabled, with these objects set in PREOP.
    fn with(objects: &[(u16, u8, i64, usize)]) -> Axis {
        let mut client = Client::of(described(), AlState::PreOp);
        for (index, sub_index, value, length) in objects {
            let done = client.download(*index, *sub_index, &value.to_le_bytes()[..*length]);
            assert_eq!(done, Ok(Vec::new()), "{index:#06x}:{sub_index}");
        }
        client.bench.set_process_data();
        client.bench.request(AlState::SafeOp);
        client.bench.write_outputs();
        assert_eq!(client.bench.request(AlState::Op).0.bits(), 0x0008);
        Axis { client, control: 0, mode: 0, position: 0, velocity: 0, torque: 0, last: Feedback::default() }
    }

    /// The same drive, enabled in a mode at its position.
    fn enabled(mode: i8, objects: &[(u16, u8, i64, usize)]) -> Axis {
        let mut axis = Axis::with(objects);
        axis.mode = mode;
        axis.enable();
        axis
    }

    fn enable(&mut self) {
        for control in [SHUTDOWN, SWITCH_ON, ENABLE] {
            self.control = control;
            self.cycle();
        }
        assert_eq!(self.cycle().state(), OPERATION_ENABLED);
    }

    /// One cycle: outputs, 1 ms, inputs as of the time of the outputs.
    fn cycle(&mut self) -> Feedback {
        let mut data = self.control.to_le_bytes().to_vec();
        data.extend(self.position.to_le_bytes());
        data.extend(self.velocity.to_le_bytes());
        data.extend(self.torque.to_le_bytes());
        data.extend(self.mode.to_le_bytes());
        self.client.bench.output(&data);
        // The two datagrams take 40 us of the cycle.
        self.client.bench.pass(Duration::from_micros(960));
        self.look()
    }

    fn look(&mut self) -> Feedback {
        let bytes = self.client.bench.input();
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let long = |at: usize| i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        self.last = Feedback {
            status: word(0),
            position: long(2),
            machine: long(6),
            velocity: long(10),
            torque: word(14) as i16,
            following_error: long(16),
            mode: bytes[20] as i8,
            brake: bytes[21],
            error: word(22),
        };
        self.last
    }

    /// A number of cycles with the same outputs; returns the inputs of each.
    fn run(&mut self, cycles: usize) -> Vec<Feedback> {
        (0..cycles).map(|_| self.cycle()).collect()
    }

    /// Runs cycles until a condition holds; panics after `most`.
    fn until(&mut self, most: usize, what: &str, holds: impl Fn(&Feedback) -> bool) -> Vec<Feedback> {
        let mut seen = Vec::new();
        for _ in 0..most {
            seen.push(self.cycle());
            if holds(&self.last) {
                return seen;
            }
        }
        panic!("not {what} after {most} ms: {:?}", self.last);
    }

    /// Moves in CSV until the motor has this speed.
    fn at_speed(velocity: i32, objects: &[(u16, u8, i64, usize)]) -> Axis {
        let mut axis = Axis::enabled(crate::application::servo::MODE_CSV, objects);
        axis.velocity = velocity;
        axis.until(500, "at speed", |seen| (seen.velocity - velocity).abs() < 100);
        axis
    }
}

/// Lowest and highest value.
fn bounds(seen: &[Feedback], value: impl Fn(&Feedback) -> i32) -> (i32, i32) {
    let values = || seen.iter().map(&value);
    (values().min().unwrap(), values().max().unwrap())
}
