//! A hundred drives with fifty objects each: from activation to OP (see [`scenarios::start_lists`]).

use std::process::ExitCode;
use std::time::Duration;

use scenarios::figures::{Figures, verdict};
use scenarios::start_lists::{Cost, Lists};

const DRIVES: usize = 100;
const OBJECTS: u32 = 50;
/// Maximum, as a multiple of the larger of one drive's time and the wire time of the mail.
const BAR: f64 = 1.5;
/// Bytes of a mailbox, ms of a cycle.
const CASES: [(u16, u64); 4] = [(128, 1), (128, 4), (1024, 1), (1024, 4)];

pub fn main() -> ExitCode {
    let mut met = true;
    for (mailbox, period_ms) in CASES {
        let title = format!("{DRIVES} drives, {OBJECTS} objects each, {mailbox}-byte mailboxes, {period_ms} ms cycle");
        let mut figures = Figures::new(&title);
        let all = Lists { drives: DRIVES, objects: OBJECTS, mailbox, period: Duration::from_millis(period_ms) };
        let nothing = Lists { objects: 0, ..all }.start();
        let one = Lists { drives: 1, ..all }.start();
        let (cost, alone) = (all.start(), all.mail_alone());
        show(&mut figures, "all of them without objects", &nothing);
        show(&mut figures, "one drive", &one);
        show(&mut figures, "all", &cost);
        figures.show("wire time of the mail", ms(alone));
        let ratio = cost.time.as_secs_f64() / one.time.max(alone).as_secs_f64();
        figures.at_most("all, against the larger of one drive and the wire time of the mail", ratio, BAR, "x");
        met &= figures.print();
    }
    verdict(met)
}

fn ms(time: Duration) -> String {
    format!("{:.1} ms", time.as_secs_f64() * 1e3)
}

fn show(figures: &mut Figures, name: &str, cost: &Cost) {
    let Cost { time, acyclic, cyclic, mail } = cost;
    let (acyclic, cyclic) = (ms(*acyclic), ms(*cyclic));
    figures.show(name, ms(*time));
    figures.show("      wire time of acyclic and cyclic frames", format!("{acyclic}, {cyclic}"));
    figures.show("      empty reads, looks", format!("{}, {}", mail.empty_reads, mail.polls));
}
