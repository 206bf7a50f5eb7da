//! The differences of clocks over time, as a picture in SVG.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::ClockStatus;

use crate::svg;

/// Samples that are kept; beyond, each second one is dropped, so that a long watch does not grow without bound.
const MOST_SAMPLES: usize = 4_000;
/// Size of the picture and of the margin for words, in pixels.
const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 480.0;
const MARGIN: f64 = 64.0;
/// About so many lines for times.
const LINES: f64 = 9.0;
/// Clocks that are named beside the picture.
const LEGEND: usize = 22;
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
    let scale = Scale { first, last };
    let mut svg = svg::begin([WIDTH, HEIGHT], MARGIN, "Difference to the reference clock (0x092C) over time");
    grid(&mut svg, scale);
    for (number, clock) in clocks.iter().enumerate() {
        let path = line(course, number, scale);
        let name = if clock.is_reference { "reference" } else { "position" };
        // Writing into a String cannot fail.
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\" stroke-linejoin=\"round\"><title>\
             {name} {}</title></path>",
            colour(number),
            clock.position
        );
    }
    legend(&mut svg, clocks);
    svg.push_str(svg::END);
    svg
}

/// From the first to the last second.
#[derive(Clone, Copy)]
struct Scale {
    first: f64,
    last: f64,
}

impl Scale {
    fn x(self, seconds: f64) -> f64 {
        MARGIN + (seconds - self.first) / (self.last - self.first) * (WIDTH - 2.0 * MARGIN)
    }

    fn y(self, ns: f64) -> f64 {
        HEIGHT / 2.0 - height(ns) * (HEIGHT / 2.0 - MARGIN)
    }

    /// A step of 1, 2 or 5 times a power of ten seconds that makes a handful of lines.
    fn step(self) -> f64 {
        let wanted = (self.last - self.first) / LINES;
        let power = 10f64.powf(wanted.log10().floor());
        [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= wanted).unwrap_or(power)
    }
}

/// Lines for differences and for times, with what they mean.
fn grid(svg: &mut String, scale: Scale) {
    let (right, top, bottom) = (WIDTH - MARGIN, MARGIN, HEIGHT - MARGIN);
    let mut rule = |ns: f64, label: &str| {
        let (at, colour) = (scale.y(ns), if ns == 0.0 { "#999" } else { "#e4e4e4" });
        let (to, text) = (MARGIN - 6.0, at + 4.0);
        let _ = writeln!(
            svg,
            "<path d=\"M{MARGIN} {at:.1}H{right}\" stroke=\"{colour}\"/>\
             <text x=\"{to}\" y=\"{text:.1}\" text-anchor=\"end\">{label}</text>"
        );
    };
    rule(0.0, "0");
    for (ns, label) in GRID {
        rule(ns, &format!("+{label}"));
        rule(-ns, &format!("-{label}"));
    }
    let step = scale.step();
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let mut number = (scale.first / step).ceil();
    while number * step <= scale.last {
        let (at, text) = (scale.x(number * step), bottom + 16.0);
        let _ = writeln!(
            svg,
            "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#e4e4e4\"/>\
             <text x=\"{at:.1}\" y=\"{text}\" text-anchor=\"middle\">{:.decimals$} s</text>",
            number * step
        );
        number += 1.0;
    }
}

/// The line of one clock.
fn line(course: &Course, number: usize, scale: Scale) -> String {
    let mut path = String::new();
    for (at, differences) in &course.samples {
        if let Some(ns) = differences.get(number).copied().flatten() {
            let command = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(path, "{command}{:.1} {:.1}", scale.x(at.as_secs_f64()), scale.y(f64::from(ns)));
        }
    }
    path
}

/// Neighbours far apart on the colour wheel: by the golden angle. As red, green and blue, which every viewer supports.
fn colour(number: usize) -> String {
    let hue = ((number * 137 + 210) % 360) as f64 / 60.0;
    // Saturation 65 %, lightness 42 %.
    let (low, high) = (0.147, 0.693);
    let channel = |at: f64| {
        let from_peak = ((hue - at + 9.0).rem_euclid(6.0) - 3.0).abs();
        let share = (2.0 - from_peak).clamp(0.0, 1.0);
        ((low + (high - low) * share) * 255.0).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", channel(0.0), channel(2.0), channel(4.0))
}

/// Colours of the clocks, as far as there is room.
fn legend(svg: &mut String, clocks: &[ClockStatus]) {
    let left = WIDTH - MARGIN + 8.0;
    for (number, clock) in clocks.iter().enumerate().take(LEGEND) {
        let at = MARGIN + 6.0 + 15.0 * number as f64;
        let (end, text) = (left + 12.0, at + 4.0);
        let mark = if clock.is_reference { " ref" } else { "" };
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {at}H{end}\" stroke=\"{}\" stroke-width=\"3\"/>\
             <text x=\"{}\" y=\"{text}\">{}{mark}</text>",
            colour(number),
            end + 4.0,
            clock.position
        );
    }
    if clocks.len() > LEGEND {
        let (more, at) = (clocks.len() - LEGEND, MARGIN + 10.0 + 15.0 * LEGEND as f64);
        let _ = writeln!(svg, "<text x=\"{left}\" y=\"{at}\">{more} more</text>");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat::wire::address::StationAddress;

    #[test]
    fn colours_are_written_as_every_viewer_reads_them() {
        assert_eq!(colour(0), "#256bb1");
        let mut all: Vec<String> = (0..200).map(colour).collect();
        assert!(all.iter().all(|it| it.len() == 7 && u32::from_str_radix(&it[1..], 16).is_ok()));
        all.dedup();
        assert_eq!(all.len(), 200);
    }

    fn clock(difference_ns: Option<i32>) -> ClockStatus {
        let mut clock = ClockStatus::default();
        clock.station = StationAddress(0x1001);
        clock.difference_ns = difference_ns;
        clock
    }

    // covers: dc-tools
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
        let empty = plot(&Course::default(), &[]);
        assert!(!empty.contains("NaN") && !empty.contains("inf"));
        let many = vec![clock(None); LEGEND + 3];
        assert!(plot(&course, &many).contains("3 more"));
    }

    // covers: dc-tools
    #[test]
    fn times_have_lines_at_round_numbers() {
        let step = |seconds: f64| Scale { first: 0.3, last: 0.3 + seconds }.step();
        let near = |a: f64, b: f64| (a - b).abs() < b * 1e-9;
        assert!(near(step(8.9), 1.0) && near(step(0.05), 0.01) && near(step(400.0), 50.0) && near(step(13.0), 2.0));
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
