//! The differences of clocks over time, as a picture in SVG.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::ClockStatus;

/// Samples that are kept; beyond, each second one is dropped, so that a long watch does not grow without bound.
const MOST_SAMPLES: usize = 4_000;
/// Size of the picture and of the margin for words, in pixels.
const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 480.0;
const MARGIN: f64 = 64.0;
/// Differences are drawn on a scale that is linear up to so much and logarithmic beyond, in nanoseconds.
const LINEAR_NS: f64 = 100.0;
/// Lines of the grid, in nanoseconds to either side.
const GRID: [(f64, &str); 5] = [(100.0, "100 ns"), (1e3, "1 us"), (1e4, "10 us"), (1e5, "100 us"), (1e6, "1 ms")];

/// What was seen, sample by sample.
#[derive(Debug, Default)]
pub struct Course {
    samples: Vec<(Duration, Vec<Option<i32>>)>,
    every: usize,
    skipped: usize,
}

impl Course {
    /// Notes the differences at a time.
    pub fn note(&mut self, at: Duration, clocks: &[ClockStatus]) {
        self.skipped += 1;
        if self.skipped < self.every.max(1) {
            return;
        }
        self.skipped = 0;
        if self.samples.len() >= MOST_SAMPLES {
            let mut number = 0;
            self.samples.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.every = self.every.max(1) * 2;
        }
        self.samples.push((at, clocks.iter().map(|clock| clock.difference_ns).collect()));
    }
}

/// Where a difference is drawn: -1 is the bottom, 1 the top.
fn height(ns: f64) -> f64 {
    let size = ns.abs();
    let scaled = if size <= LINEAR_NS { size / LINEAR_NS } else { 1.0 + (size / LINEAR_NS).log10() };
    (scaled / 5.0).min(1.0) * ns.signum()
}

/// The picture.
pub fn plot(course: &Course, clocks: &[ClockStatus]) -> String {
    let first = course.samples.first().map_or(0.0, |(at, _)| at.as_secs_f64());
    let last = course.samples.last().map_or(first + 1.0, |(at, _)| at.as_secs_f64()).max(first + 1e-3);
    let x = |seconds: f64| MARGIN + (seconds - first) / (last - first) * (WIDTH - 2.0 * MARGIN);
    let y = |ns: f64| HEIGHT / 2.0 - height(ns) * (HEIGHT / 2.0 - MARGIN / 2.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut rule = |ns: f64, label: &str| {
        let (at, right) = (y(ns), WIDTH - MARGIN);
        let _ = writeln!(
            svg,
            "<path d=\"M{MARGIN} {at:.1}H{right}\" stroke=\"#ddd\"/><text x=\"4\" y=\"{:.1}\">{label}</text>",
            at + 4.0
        );
    };
    rule(0.0, "0");
    for (ns, label) in GRID {
        rule(ns, &format!("+{label}"));
        rule(-ns, &format!("-{label}"));
    }
    for (number, clock) in clocks.iter().enumerate() {
        let mut path = String::new();
        for (at, differences) in &course.samples {
            if let Some(ns) = differences.get(number).copied().flatten() {
                let command = if path.is_empty() { 'M' } else { 'L' };
                let _ = write!(path, "{command}{:.1} {:.1}", x(at.as_secs_f64()), y(f64::from(ns)));
            }
        }
        let hue = number * 47 % 360;
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" fill=\"none\" stroke=\"hsl({hue},70%,45%)\"><title>position {}</title></path>",
            clock.position
        );
    }
    let bottom = HEIGHT - 6.0;
    let _ = writeln!(svg, "<text x=\"{MARGIN}\" y=\"{bottom}\">{first:.2} s</text>");
    let _ =
        writeln!(svg, "<text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{last:.2} s</text>\n</svg>", WIDTH - MARGIN);
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::address::StationAddress;

    fn clock(difference_ns: Option<i32>) -> ClockStatus {
        ClockStatus {
            position: 0,
            station: StationAddress(0x1001),
            subdevice: None,
            is_reference: false,
            delay_ns: 0,
            offset_ns: 0,
            drift_ppb: 0,
            difference_ns,
            worst_ns: 0,
            is_locked: false,
        }
    }

    #[test]
    fn every_clock_has_a_line_and_any_difference_is_inside_the_picture() {
        let mut course = Course::default();
        for (ms, ns) in [(0, None), (10, Some(i32::MIN)), (20, Some(i32::MAX)), (30, Some(0))] {
            course.note(Duration::from_millis(ms), &[clock(ns), clock(Some(5))]);
        }
        let svg = plot(&course, &[clock(None), clock(None)]);
        assert_eq!(svg.matches("<title>").count(), 2);
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert!(height(-2e9) >= -1.0 && height(2e9) <= 1.0);
        assert!(!plot(&Course::default(), &[]).contains("NaN"));
    }

    #[test]
    fn a_long_watch_keeps_a_bounded_number_of_samples() {
        let mut course = Course::default();
        for ms in 0..50_000 {
            course.note(Duration::from_millis(ms), &[clock(Some(1))]);
        }
        assert!(course.samples.len() <= MOST_SAMPLES);
        assert!(course.samples.last().is_some_and(|(at, _)| at.as_secs() >= 49));
    }
}
