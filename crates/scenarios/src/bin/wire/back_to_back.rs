//! Cycles back to back with 1, 10 and 50 servos: ours in all modes beside others, each with its receive mode,
//! processor time, and the host's share of a cycle.
//!
//! The host's share is the median time of a cycle less the median time of a frame in the simulator, which the
//! simulator records. It is from one cycle's begin to the next, with nothing but the exchange of others and, of ours,
//! an output that follows an input. With one servo each stack sends one frame per cycle,
//! and so do RingCAT and SOEM with 50; ethercrab sends several with 10 and 50, so its share there has more than one
//! frame in it. Ratios compare programs that wait alike.

use scenarios::figures::{Figures, NOISY, median, noise, of_blocks};

use crate::bench::{Tried, Wire};
use crate::others::Program;
use crate::programs::{Cycles, Pace};

const SIZES: [usize; 3] = [1, 10, 50];
const OURS: [Program; 6] = [
    Program::ours("busy", false),
    Program::ours("busy", true),
    Program::ours("hybrid", false),
    Program::ours("hybrid", true),
    Program::ours("block", false),
    Program::ours("block", true),
];
const UNDER_WAY: [Program; 2] = [
    Program::Ours { receive: "busy", one_thread: false, under_way: 2 },
    Program::Ours { receive: "busy", one_thread: false, under_way: 3 },
];
const OTHERS: [Program; 3] = [Program::Pysoem { spins: true }, Program::Pysoem { spins: false }, Program::Ethercrab];
/// Our host's share while spinning, as a multiple of the best other that spins: bar and goal.
const SPINNING: (f64, f64) = (1.25, 0.8);
/// Our cycle while blocking, as a multiple of the best other that blocks: it is the kernel's wake-up.
const BLOCKING: (f64, f64) = (1.25, 1.03);

/// Blocks of one program.
struct Series {
    program: Program,
    cycles: Vec<Cycles>,
    /// Cycle time less residence.
    shares_us: Vec<f64>,
}

impl Series {
    fn of(&self, figure: impl Fn(&Cycles) -> f64) -> Vec<f64> {
        self.cycles.iter().map(figure).collect()
    }

    fn cycle_us(&self) -> Vec<f64> {
        self.of(|cycles| cycles.median_us)
    }

    /// The longest block as a multiple of the shortest.
    fn spread(&self) -> f64 {
        noise(&self.cycle_us())
    }
}

impl Wire {
    /// The table.
    pub fn back_to_back(&self, figures: &mut Figures) -> Tried<()> {
        SIZES.into_iter().try_for_each(|size| self.one_size(figures, size))
    }

    fn one_size(&self, figures: &mut Figures, servos: usize) -> Tried<()> {
        let several: &[Program] = if servos == 50 && self.full { &UNDER_WAY } else { &[] };
        let programs = [&OURS[..], several, &OTHERS].concat();
        let series = |program| Series { program, cycles: Vec::new(), shares_us: Vec::new() };
        let here = programs.into_iter().filter(|program| self.others.has(*program));
        let mut all: Vec<Series> = here.map(series).collect();
        let segment = format!("[segment]\nring = false\n[[device]]\ntype = \"servo\"\ncount = {servos}\n");
        for block in 0..self.blocks() {
            let simulator = self.simulate(&segment, Pace::Fast)?;
            // ethercrab takes seconds to OP with more SubDevices than one.
            let takes_part =
                |series: &&mut Series| block == 0 || servos == 1 || self.full || series.program != Program::Ethercrab;
            for series in all.iter_mut().filter(takes_part) {
                let cycles = self.cycles(series.program, servos)?;
                series.shares_us.push(cycles.median_us - simulator.residence_us()?);
                series.cycles.push(cycles);
            }
        }
        for series in &all {
            let rate = median(&series.of(|cycles| cycles.rate));
            let name = format!("{servos:>2}: {}", series.program.title());
            let cpu = median(&series.of(|cycles| cycles.cpu_us));
            let percent = median(&series.of(|cycles| cycles.cpu_percent()));
            let share = match series.program {
                // Frames of several cycles are in the simulator at once.
                Program::Ours { under_way: 2.., .. } => "     -".to_owned(),
                _ => format!("{:>6.2}", median(&series.shares_us)),
            };
            let cycle = median(&series.cycle_us());
            figures.show(
                &name,
                format!(
                    "{cycle:>7.2} us, {rate:>6.0}/s, host's share {share} us, CPU {cpu:>6.2} us ({percent:>3.0} %)"
                ),
            );
        }
        ratios(figures, servos, &all);
        Ok(())
    }
}

/// Ours against the best other that waits alike, block by block.
fn ratios(figures: &mut Figures, servos: usize, all: &[Series]) {
    let compared = |name: &str, ours: Program, others: &[Program], figure: &dyn Fn(&Series) -> Vec<f64>| {
        let ours = all.iter().find(|series| series.program == ours)?;
        let others: Vec<&Series> = all.iter().filter(|series| others.contains(&series.program)).collect();
        let best = |block: usize| {
            others.iter().filter_map(|series| figure(series).get(block).copied()).fold(f64::MAX, f64::min)
        };
        let noise = others.iter().map(|series| series.spread()).fold(ours.spread(), f64::max);
        let ratios: Vec<f64> = figure(ours).iter().enumerate().map(|(block, ours)| ours / best(block)).collect();
        (!others.is_empty()).then(|| (format!("{servos:>2}: {name}"), ratios, noise))
    };
    let (spinning, blocking) = (Program::ours("busy", false), Program::ours("block", false));
    let one_thread = Program::ours("block", true);
    let alike = [Program::Pysoem { spins: false }, Program::Ethercrab];
    let rows = [
        (compared("both spinning, host's share", spinning, &OTHERS[..1], &|it| it.shares_us.clone()), SPINNING),
        (compared("both blocking, cycle, two threads", blocking, &alike, &Series::cycle_us), BLOCKING),
        (compared("both blocking, cycle, one thread", one_thread, &alike, &Series::cycle_us), BLOCKING),
    ];
    for (row, limits) in rows {
        match row {
            Some((name, ratios, noise)) if noise > NOISY => {
                let reason = format!("not evaluated: blocks of one program differ by {noise:.1} x");
                figures.show(&name, format!("{} {reason}", of_blocks(&ratios, "x")));
            }
            Some((name, ratios, _)) => figures.at_most_in_blocks_towards(&name, &ratios, limits, "x"),
            None => {}
        }
    }
}
