//! From the first frame to OP of the last SubDevice, at real-time pace, each program right after power-on.
//!
//! Medians count; the longest run is shown beside with what is known about it: how long the simulator was late in it
//! (a stall of the machine delays frames), and how much of it the scan took.

use scenarios::figures::{Figures, of_blocks};

use crate::bench::{MACHINE, Tried, Wire};
use crate::others::Program;
use crate::programs::Pace;

const OURS: Program = Program::ours("busy", false);
const OTHERS: [Program; 2] = [Program::Pysoem { spins: false }, Program::Ethercrab];
/// Time on a machine of 50, as a multiple of the best other.
const BAR: f64 = 0.5;
/// Servos, and milliseconds to OP that are the goal.
const GOALS: [(usize, f64); 4] = [(1, 25.0), (10, 30.0), (50, 35.0), (100, 40.0)];
/// Runs of ours for each number of servos, and with `--full`.
const RUNS: [usize; 2] = [3, 20];
/// ethercrab takes seconds with more SubDevices: those only with `--full`.
const MOST_OF_ETHERCRAB: usize = 1;

/// One start.
#[derive(Clone, Copy)]
struct Start {
    ms: f64,
    scan_ms: Option<f64>,
    simulator_late_ms: f64,
}

impl Wire {
    /// The table.
    pub fn start_up(&self, figures: &mut Figures) -> Tried<()> {
        self.machine(figures)?;
        GOALS.into_iter().try_for_each(|(servos, goal)| self.servos(figures, servos, goal))
    }

    /// A machine of 50 SubDevices, alternating.
    fn machine(&self, figures: &mut Figures) -> Tried<()> {
        let others: Vec<Program> = OTHERS.into_iter().filter(|program| self.others.has(*program)).collect();
        let (mut ours, mut rest) = (Vec::new(), vec![Vec::new(); others.len()]);
        for block in 0..self.blocks() {
            ours.push(self.start(MACHINE, OURS, 50)?.ms);
            let takes_part = |program: &Program| block == 0 || self.full || *program != Program::Ethercrab;
            for (program, times) in others.iter().zip(&mut rest).filter(|(program, _)| takes_part(program)) {
                times.push(self.start(MACHINE, *program, 50)?.ms);
            }
        }
        figures.show(&format!("machine of 50: {}", OURS.title()), of_blocks(&ours, "ms"));
        for (program, times) in others.iter().zip(&rest) {
            figures.show(&format!("machine of 50: {}", program.title()), of_blocks(times, "ms"));
        }
        let best = |block: usize| rest.iter().filter_map(|times| times.get(block).copied()).fold(f64::MAX, f64::min);
        let ratios: Vec<f64> = ours.iter().enumerate().map(|(block, ours)| ours / best(block)).collect();
        if !others.is_empty() {
            figures.at_most_in_blocks("machine of 50: ours against the best of them", &ratios, BAR, "x");
        }
        Ok(())
    }

    /// A line of servos.
    fn servos(&self, figures: &mut Figures, servos: usize, goal: f64) -> Tried<()> {
        let segment = format!("[segment]\nring = false\n[[device]]\ntype = \"servo\"\ncount = {servos}\n");
        let runs = RUNS[usize::from(self.full)];
        let starts: Vec<Start> =
            (0..runs).map(|_| self.start(&segment, OURS, servos)).collect::<Tried<Vec<Start>>>()?;
        let times: Vec<f64> = starts.iter().map(|start| start.ms).collect();
        figures.goal_at_most_in_blocks(&format!("{servos:>3} servos: {}", OURS.title()), &times, goal, "ms");
        if let Some(longest) = starts.iter().copied().max_by(|one, other| one.ms.total_cmp(&other.ms)) {
            let Start { ms, scan_ms, simulator_late_ms } = longest;
            let scan = scan_ms.map_or_else(String::new, |scan| format!(", {scan:.0} of it the scan"));
            figures.show(
                "            longest",
                format!("{ms:.0} ms{scan}; the simulator was late for {simulator_late_ms:.1} ms in it"),
            );
        }
        for program in OTHERS.into_iter().filter(|program| self.others.has(*program)) {
            if program == Program::Ethercrab && servos > MOST_OF_ETHERCRAB && !self.full {
                continue;
            }
            let start = self.start(&segment, program, servos)?;
            figures.show(&format!("{servos:>3} servos: {}", program.title()), format!("{:.0} ms (one run)", start.ms));
        }
        Ok(())
    }

    fn start(&self, segment: &str, program: Program, subdevices: usize) -> Tried<Start> {
        let simulator = self.simulate(segment, Pace::RealTime)?;
        let (ms, scan_ms) = self.to_op(program, subdevices)?;
        Ok(Start { ms, scan_ms, simulator_late_ms: simulator.late_ms()? })
    }
}
