//! Variables of a file: outputs that have the values of `--set`, inputs that `--watch` prints.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ringcat::eni::{EniImage, EniVariable, Value};
use ringcat::{Instant, ProcessData};

use crate::json::run;
use crate::output::say;

/// Shortest time between two printed values of a variable.
const PRINT_PERIOD: Duration = Duration::from_secs(1);

/// The work of the cycles over an image, and the variables to print.
pub fn work(image: EniImage, watched: Vec<EniVariable>) -> (Work, Watched) {
    let values: Arc<[AtomicU64]> = watched.iter().map(|_| AtomicU64::new(0)).collect();
    let work = Work { image, watched: watched.clone(), values: values.clone() };
    let printed = vec![None; watched.len()];
    (work, Watched { watched, values, printed, next: Instant(0) })
}

/// The work of each cycle; it neither allocates nor waits.
#[derive(Debug)]
pub struct Work {
    image: EniImage,
    watched: Vec<EniVariable>,
    values: Arc<[AtomicU64]>,
}

impl Work {
    /// One cycle.
    pub fn cycle(&mut self, data: &mut ProcessData<'_>) {
        self.image.take_inputs(data);
        for (variable, value) in self.watched.iter().zip(self.values.iter()) {
            value.store(self.image.read(variable), Ordering::Relaxed);
        }
        self.image.give_outputs(data);
    }

    /// Inputs that the file copies to outputs.
    pub fn copies(&self) -> &[ringcat::CopyRule] {
        self.image.copies()
    }
}

/// Variables that are printed.
#[derive(Debug, Default)]
pub struct Watched {
    watched: Vec<EniVariable>,
    values: Arc<[AtomicU64]>,
    printed: Vec<Option<u64>>,
    next: Instant,
}

impl Watched {
    /// Lines for variables that have changed since the last call, at most once a second.
    pub fn changes(&mut self, now: Instant) -> Vec<String> {
        if now < self.next || self.watched.is_empty() {
            return Vec::new();
        }
        self.next = now + PRINT_PERIOD;
        let mut lines = Vec::new();
        for ((variable, value), printed) in self.watched.iter().zip(self.values.iter()).zip(&mut self.printed) {
            let value = value.load(Ordering::Relaxed);
            if printed.replace(value) != Some(value) {
                lines.push(line(variable, value));
            }
        }
        lines
    }

    /// The last values as keys of JSON.
    pub fn json(&self) -> Vec<run::Variable> {
        let json = |(variable, value): (&EniVariable, &AtomicU64)| run::Variable {
            name: variable.name.clone(),
            value: shown(variable, value.load(Ordering::Relaxed)),
        };
        self.watched.iter().zip(self.values.iter()).map(json).collect()
    }

    /// Prints the last values.
    pub fn account(&self) {
        for (variable, value) in self.watched.iter().zip(self.values.iter()) {
            say!("  {}", line(variable, value.load(Ordering::Relaxed)));
        }
    }
}

fn line(variable: &EniVariable, value: u64) -> String {
    format!("{} = {}", variable.name, shown(variable, value))
}

/// A value as its type writes it.
fn shown(variable: &EniVariable, value: u64) -> String {
    let bits = u16::try_from(variable.bits.min(64)).unwrap_or(64);
    let value: Value = variable.data_type.value(value, bits);
    value.to_string()
}
