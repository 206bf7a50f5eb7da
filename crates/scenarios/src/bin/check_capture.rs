//! Checks a capture of RingCAT: `check_capture FILE.pcapng [CYCLE_US]`. The checks are listed in
//! [`scenarios::capture`].

use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(path) = arguments.next() else {
        eprintln!("usage: check_capture FILE.pcapng [CYCLE_US]");
        return ExitCode::from(2);
    };
    let cycle = arguments.next().and_then(|text| text.parse().ok()).map(Duration::from_micros);
    let read = std::fs::read(&path).map_err(|error| error.to_string());
    match read.and_then(|bytes| scenarios::capture::evaluate(&bytes, cycle)) {
        Ok(verdict) => {
            print!("{verdict}");
            if verdict.broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("{path}: {error}");
            ExitCode::from(2)
        }
    }
}
