//! The program `ethercat`: see `ethercat --help`.

use std::io::{self, BufWriter, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let mut output = BufWriter::new(io::stdout().lock());
    let mut errors = io::stderr().lock();
    let is_good = ethercat::run(&arguments, &ethercat::session::socket(), &mut output, &mut errors);
    // A reader that has closed its end gets no more.
    let is_written = output.flush().is_ok();
    if is_good && is_written { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
