//! The latency as a picture in SVG: how many wake-ups were how late. Both axes are logarithmic, so that a single late
//! wake-up among many shows.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::histogram::Histogram;

use super::latency::Latency;
use crate::svg;

/// Size of the picture and of the margin for words, in pixels.
const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 400.0;
const MARGIN: f64 = 64.0;
/// The shortest time of the picture, in nanoseconds; shorter ones are drawn there.
const SHORTEST_NS: f64 = 100.0;
/// The picture ends here at least, in nanoseconds.
const LEAST_END_NS: f64 = 1e6;
/// Quantiles that are marked, in parts per million, with their names.
const MARKS: [(u32, &str); 3] = [(500_000, "median"), (999_000, "99.9 %"), (1_000_000, "max")];
/// Lines of words at the marks, so that marks that are close do not cover each other.
const MARK_LINE: f64 = 13.0;

/// Axes.
#[derive(Clone, Copy)]
struct Scale {
    end_ns: f64,
    most: f64,
}

impl Scale {
    fn x(self, ns: f64) -> f64 {
        let share = (ns.max(SHORTEST_NS) / SHORTEST_NS).log10() / (self.end_ns / SHORTEST_NS).log10();
        MARGIN + share.min(1.0) * (WIDTH - 2.0 * MARGIN)
    }

    /// 0.5 wake-ups are at the bottom, so that one has a height.
    fn y(self, count: f64) -> f64 {
        let share = (count.max(0.5) / 0.5).log10() / (self.most / 0.5).log10();
        HEIGHT - MARGIN - share.min(1.0) * (HEIGHT - 2.0 * MARGIN)
    }
}

/// The picture.
pub fn draw(latency: &Latency) -> String {
    let delays = &latency.delays;
    let most = delays.buckets().map(|bucket| bucket.count).max().unwrap_or(0) as f64;
    let longest = ns(delays.longest()).max(1.0);
    let scale = Scale { end_ns: power_above(longest).max(LEAST_END_NS), most: power_above(most.max(1.0)) };
    let title = format!("{} wake-ups on a grid of 1 ms: how late they came ({})", delays.count(), latency.settings());
    let mut picture = svg::begin([WIDTH, HEIGHT], MARGIN, &title);
    grid(&mut picture, scale);
    for bucket in delays.buckets() {
        let (left, right) = (scale.x(ns(bucket.begin)), scale.x(ns(bucket.end)));
        let (top, bottom) = (scale.y(bucket.count as f64), HEIGHT - MARGIN);
        // Writing into a String cannot fail.
        let _ = writeln!(
            picture,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#256bb1\"><title>{} to {}: {}\
             </title></rect>",
            (right - left - 0.5).max(1.0),
            bottom - top,
            in_words(ns(bucket.begin)),
            in_words(ns(bucket.end)),
            bucket.count
        );
    }
    marks(&mut picture, delays, scale);
    picture.push_str(svg::END);
    picture
}

fn ns(time: Duration) -> f64 {
    time.as_nanos() as f64
}

/// The power of ten that is larger.
fn power_above(value: f64) -> f64 {
    10f64.powf(value.log10().floor() + 1.0)
}

/// A time with a unit that gives few digits.
fn in_words(ns: f64) -> String {
    let (value, unit) = match ns {
        _ if ns >= 1e9 => (ns / 1e9, "s"),
        _ if ns >= 1e6 => (ns / 1e6, "ms"),
        _ if ns >= 1e3 => (ns / 1e3, "us"),
        _ => (ns, "ns"),
    };
    let text = format!("{value:.1}");
    format!("{} {unit}", text.trim_end_matches(".0"))
}

/// Lines for powers of ten, with what they mean.
fn grid(picture: &mut String, scale: Scale) {
    let (right, top, bottom) = (WIDTH - MARGIN, MARGIN, HEIGHT - MARGIN);
    let powers = |from: f64, to: f64| {
        std::iter::successors(Some(from), |at| Some(at * 10.0)).take_while(move |at| *at <= to * 1.01)
    };
    for time in powers(SHORTEST_NS, scale.end_ns) {
        let (at, text) = (scale.x(time), bottom + 16.0);
        let _ = writeln!(
            picture,
            "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#e4e4e4\"/>\
             <text x=\"{at:.1}\" y=\"{text}\" text-anchor=\"middle\">{}</text>",
            in_words(time)
        );
    }
    for count in powers(1.0, scale.most) {
        let (at, to) = (scale.y(count), MARGIN - 6.0);
        let text = at + 4.0;
        let _ = writeln!(
            picture,
            "<path d=\"M{MARGIN} {at:.1}H{right}\" stroke=\"#e4e4e4\"/>\
             <text x=\"{to}\" y=\"{text:.1}\" text-anchor=\"end\">{count:.0}</text>"
        );
    }
}

/// Lines at some quantiles.
fn marks(picture: &mut String, delays: &Histogram, scale: Scale) {
    if delays.count() == 0 {
        return;
    }
    let (bottom, begin) = (HEIGHT - MARGIN, MARGIN - MARK_LINE * MARKS.len() as f64);
    for (number, (part, name)) in MARKS.into_iter().enumerate() {
        let time = ns(delays.quantile(part));
        let (at, text) = (scale.x(time), begin + MARK_LINE * (number as f64 + 0.8) + 6.0);
        let _ = writeln!(
            picture,
            "<path d=\"M{at:.1} {text:.1}V{bottom}\" stroke=\"#b12525\" stroke-dasharray=\"3 3\"/>\
             <text x=\"{:.1}\" y=\"{text:.1}\" fill=\"#b12525\">{name} {}</text>",
            at + 4.0,
            in_words(time)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::latency::tests::measured;
    use super::*;

    /// Numbers of an attribute.
    fn values(picture: &str, name: &str) -> Vec<f64> {
        let marked = format!(" {name}=\"");
        let texts = picture.split(&marked).skip(1).filter_map(|rest| rest.split('"').next());
        texts.filter_map(|text| text.parse().ok()).collect()
    }

    // covers: bench
    #[test]
    fn every_bar_is_inside_the_picture_whatever_was_measured() {
        let all: [&[(u64, u64)]; 4] =
            [&[], &[(0, 1)], &[(3, 9_000), (80, 2)], &[(0, 5), (1, 1), (18_000_000_000_000_000, 1)]];
        for delays in all {
            let picture = draw(&measured(delays));
            assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
            assert!(!picture.contains("NaN") && !picture.contains("inf"), "{picture}");
            assert_eq!(picture.matches("<title>").count(), delays.len(), "a bar for each");
            assert!(values(&picture, "x").iter().all(|x| (0.0..=WIDTH).contains(x)));
            assert!(values(&picture, "y").iter().all(|y| (0.0..=HEIGHT).contains(y)));
            assert!(values(&picture, "height").iter().all(|height| (1.0..=HEIGHT).contains(height)), "{picture}");
            assert_eq!(picture.contains(">max "), !delays.is_empty());
        }
    }
}
