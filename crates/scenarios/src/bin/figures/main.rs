//! Figures in virtual time, each with its bar: `figures SUBJECT`, or all subjects. One program for all, which saves
//! link time.

mod clocks;
mod delays;
mod disturbed;
mod ethernet;
mod files;
mod phases;
mod ring;
mod start_lists;
mod startup;

use std::process::ExitCode;

/// A subject and the function that prints its figures.
type Subject = (&'static str, fn() -> ExitCode);

const SUBJECTS: [Subject; 9] = [
    ("ring", ring::main),
    ("startup", startup::main),
    ("phases", phases::main),
    ("disturbed", disturbed::main),
    ("start_lists", start_lists::main),
    ("ethernet", ethernet::main),
    ("files", files::main),
    ("clocks", clocks::main),
    ("delays", delays::main),
];

fn main() -> ExitCode {
    let wanted = std::env::args().nth(1);
    let is_wanted = |subject: &&Subject| wanted.as_deref().is_none_or(|name| name == subject.0);
    let results: Vec<ExitCode> = SUBJECTS.iter().filter(is_wanted).map(|(_, show)| show()).collect();
    if results.is_empty() {
        let names = SUBJECTS.map(|(name, _)| name).join(", ");
        eprintln!("figures: expected one of {names}, got `{}`", wanted.unwrap_or_default());
        return ExitCode::FAILURE;
    }
    results.into_iter().find(|result| *result != ExitCode::SUCCESS).unwrap_or(ExitCode::SUCCESS)
}
