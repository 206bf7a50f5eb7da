//! The programs that are measured, each in a process of its own, and the simulator that they all have.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

use scenarios::namespaces::Server;

use crate::bench::{Tried, Wire, after, output};
use crate::others::Program;

const PYSOEM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_client.py");
/// SubDevices, and cycles of a block then: of a program that spins, of others. Clients of other stacks run twice as
/// many: first with outputs that change, which is not measured here.
const CYCLES: [(usize, &str, &str); 3] = [(1, "15000", "4000"), (10, "10000", "4000"), (50, "5000", "3000")];
/// Cycles of a block of ethercrab.
const CYCLES_OF_ETHERCRAB: &str = "1000";

/// How long the simulator takes for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As a real segment.
    RealTime,
    /// As long as it takes to compute the answer.
    Fast,
}

/// Cycles of one program in one block.
#[derive(Clone, Copy, Debug)]
pub struct Cycles {
    /// Median time from one cycle's begin to the next.
    pub median_us: f64,
    /// Cycles per second.
    pub rate: f64,
    /// Processor time per cycle, all threads.
    pub cpu_us: f64,
}

impl Cycles {
    /// Share of a processor, in percent.
    pub fn cpu_percent(self) -> f64 {
        self.cpu_us * self.rate / 1e4
    }
}

/// A simulator; it is gone when this is dropped.
pub struct Simulator {
    _server: Server,
    control: PathBuf,
}

impl Simulator {
    fn status(&self) -> Tried<String> {
        let said = |error: std::io::Error| format!("the simulator's control socket: {error}");
        let mut stream = UnixStream::connect(&self.control).map_err(said)?;
        stream.write_all(b"status\n").map_err(said)?;
        let (mut text, mut piece) = (String::new(), [0; 4096]);
        while !text.ends_with("\nok\n") {
            match stream.read(&mut piece).map_err(said)? {
                0 => return Err(format!("the simulator's status has no end: {text}")),
                length => text.push_str(&String::from_utf8_lossy(&piece[..length])),
            }
        }
        Ok(text)
    }

    /// Median time of the last frames in the simulator.
    pub fn residence_us(&self) -> Tried<f64> {
        after(&self.status()?, "in this simulator: median")
    }

    /// For how long the simulator was late altogether.
    pub fn late_ms(&self) -> Tried<f64> {
        let status = self.status()?;
        let late = status.split_once("late wake-ups of this simulator").map(|(_, rest)| rest).unwrap_or_default();
        after(late, "together")
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // It may be gone with the simulator.
        let _ = std::fs::remove_file(&self.control);
    }
}

impl Wire {
    /// A simulator right after power-on.
    pub fn simulate(&self, segment: &str, pace: Pace) -> Tried<Simulator> {
        let path = |end: &str| std::env::temp_dir().join(format!("ringcat-wire-{}.{end}", std::process::id()));
        let (file, control) = (path("toml"), path("control"));
        std::fs::write(&file, segment).map_err(|error| error.to_string())?;
        let _ = std::fs::remove_file(&control);
        let pace = if pace == Pace::Fast { "as-fast-as-possible" } else { "real-time" };
        let (segment, socket) = (file.display().to_string(), control.display().to_string());
        let arguments = ["sim", "--segment", &segment, "--pace", pace, "--control", &socket];
        let fixed = ["--main", "far0", "--receive", "busy", "--cpu", "1"];
        let is_ready = || UnixStream::connect(&control).is_ok();
        let server = self.namespaces.serve_until(self.ringcat(), &[&arguments[..], &fixed].concat(), &is_ready);
        let removed = std::fs::remove_file(&file).map_err(|error| error.to_string());
        server.and_then(|server| removed.map(|()| Simulator { _server: server, control: control.clone() }))
    }

    /// Cycles back to back, as fast as frames return.
    pub fn cycles(&self, program: Program, subdevices: usize) -> Tried<Cycles> {
        let (_, of_spinning, of_sleeping) =
            CYCLES.into_iter().find(|(most, ..)| subdevices <= *most).unwrap_or(CYCLES[CYCLES.len() - 1]);
        let count = |spins: bool| if spins { of_spinning } else { of_sleeping };
        match program {
            Program::Ours { receive, one_thread, under_way } => {
                let under_way = under_way.to_string();
                let fixed = ["cycles", "--count", count(receive != "block"), "--under-way", &under_way];
                let threads: &[&str] = if one_thread { &["--one-thread"] } else { &[] };
                let said = self.bench_waiting(receive, &[&fixed[..], threads].concat())?;
                let [median_us, rate, cpu_us] = ["cycle median", "cycles per second", "CPU per cycle"];
                let incomplete = after(&said, "incomplete")?;
                if incomplete > 0.0 {
                    println!("  {}: {incomplete} cycles incomplete or skipped", program.title());
                }
                let figure = |name| after(&said, name);
                Ok(Cycles { median_us: figure(median_us)?, rate: figure(rate)?, cpu_us: figure(cpu_us)? })
            }
            Program::Pysoem { spins } => {
                let said = self.foreign(program, subdevices, count(spins))?;
                cycles_of_others(&said)
            }
            Program::Ethercrab => cycles_of_others(&self.foreign(program, subdevices, CYCLES_OF_ETHERCRAB)?),
        }
    }

    /// From the first frame to OP, in milliseconds; of ours also to the end of the scan.
    pub fn to_op(&self, program: Program, subdevices: usize) -> Tried<(f64, Option<f64>)> {
        match program {
            Program::Ours { receive, .. } => {
                let said = self.bench_waiting(receive, &["cycles", "--count", "0"])?;
                Ok((after(&said, "all in OP after")?, Some(after(&said, "scanned after")?)))
            }
            Program::Pysoem { .. } | Program::Ethercrab => {
                Ok((after(&self.foreign(program, subdevices, "10")?, "op_ms")?, None))
            }
        }
    }

    /// The line of a client of others.
    fn foreign(&self, program: Program, subdevices: usize, cycles: &str) -> Tried<String> {
        let subdevices = subdevices.to_string();
        let mut command = match (program, &self.others.python, &self.others.ethercrab) {
            (Program::Pysoem { spins }, Some(python), _) => {
                let mut command = self.namespaces.near("taskset");
                command.args(["-c", "0"]).arg(python).args(["-B", PYSOEM]);
                if let Some(library) = self.others.spinning_recv.as_ref().filter(|_| spins) {
                    command.env("LD_PRELOAD", library);
                }
                command
            }
            // It has two threads: on one processor or both, as scheduled by the system.
            (Program::Ethercrab, _, Some(client)) => self.namespaces.near(client),
            _ => return Err(format!("{} is not here", program.title())),
        };
        command.args(["near0", &subdevices, cycles]);
        output(command)
    }
}

fn cycles_of_others(said: &str) -> Tried<Cycles> {
    let rate = after(said, "per_second")?;
    Ok(Cycles { median_us: after(said, "cycle_us")?, rate, cpu_us: after(said, "cpu_us")? })
}
