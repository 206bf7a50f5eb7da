//! The program `ethercat`: see `ethercat --help`.

use std::io::{self, BufWriter, Write};
use std::process::ExitCode;

use ethercat::failure::Failure;
use ringcat_control::visible;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let mut output = BufWriter::new(io::stdout().lock());
    let mut errors = io::stderr().lock();
    let is_good = ethercat::run(&arguments, &ethercat::session::socket(), &mut output, &mut errors);
    let written = output.flush().map_err(Failure::from);
    if let (true, Err(failure)) = (is_good, &written) {
        // Nothing can be reported where the standard error is closed.
        let _ = errors.write_all(visible(&failure.text()).as_bytes());
    }
    if is_good && written.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
