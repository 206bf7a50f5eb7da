//! The picture of the README: a cable of a simulated ring is cut and repaired during process data exchange.
//!
//! `cargo run -p scenarios --example ring_picture > docs/ring.svg`
//!
//! All data comes from the run: the working counter of every cycle, the number of SubDevices that respond on each link,
//! the events and their times. Time is virtual, so each run gives the same picture.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{Application, DomainId, Event, Link, MainDevice, Options, automatic};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;

/// SubDevices in the ring.
const DEVICES: usize = 8;
/// The cable behind this position is cut.
const CUT_BEHIND: usize = 4;
/// Cycles before the cut, during the break, and after the repair.
const CYCLES: [usize; 3] = [12, 20, 16];
/// Time from the cut to the next cycle: ports detect the cut after 300 us, so the frames of this cycle are
/// lost.
const BEFORE_THE_CYCLE: Duration = Duration::from_micros(100);
const CYCLE: Duration = Duration::from_millis(1);

/// Events as text, with their cycle.
type Reported = Vec<(usize, String)>;

/// Results of one cycle.
struct Seen {
    wkc: u32,
    expected: u32,
    answering: [u16; 2],
}

fn main() -> Result<(), ringcat::Error> {
    let (cycles, events) = watch()?;
    print!("{}", picture(&cycles, &events));
    Ok(())
}

fn segment() -> String {
    let mut text = "[segment]\nring = true\nlink_down_delay_us = 300\nlink_up_delay_us = 300\n".to_owned();
    for position in 0..DEVICES {
        let kind = if position % 2 == 0 { "digital-output-8" } else { "digital-input-8" };
        let _ = write!(text, "[[device]]\ntype = \"{kind}\"\nname = \"{position}\"\n");
    }
    text
}

/// Runs the ring.
fn watch() -> Result<(Vec<Seen>, Reported), ringcat::Error> {
    let links = SimulatedSegment::from_toml(&segment())?;
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan()?;
    let names = Names(scan.subdevices.iter().map(|info| info.name.clone()).collect());
    let mut application = main_device.activate(automatic(&scan.subdevices, CYCLE))?;
    for _ in 0..2_000 {
        application.cycle(|_| ());
    }
    while application.pop_event().is_some() {}
    let mut cycles = Vec::new();
    let mut events = Vec::new();
    for (stretch, count) in CYCLES.into_iter().enumerate() {
        disturb(&mut application, stretch);
        for _ in 0..count {
            application.cycle(|_| ());
            let status = application.exchange_mut().status(DomainId(0)).expect("it is declared");
            let ring = application.ring_status();
            let answering = [Link::Main, Link::Redundant].map(|link| ring.link(link).answering);
            cycles.push(Seen { wkc: status.wkc, expected: status.expected, answering });
            while let Some(event) = application.pop_event() {
                if let Event::RingOpened { .. } | Event::BreakLocated { .. } | Event::RingClosed { .. } = event.event {
                    events.push((cycles.len() - 1, describe(&event, &names)));
                }
            }
        }
    }
    Ok((cycles, events))
}

/// The second part begins with a cut, the third with the repair.
fn disturb(application: &mut Application<SimulatedSegment>, stretch: usize) {
    let network = application.links_mut().network_mut();
    let cable =
        network.cable_between(DeviceIndex(CUT_BEHIND - 1), DeviceIndex(CUT_BEHIND)).expect("they are neighbours");
    let at = network.now() + (CYCLE - BEFORE_THE_CYCLE);
    match stretch {
        1 => network.schedule(at, Fault::Cut(cable)),
        2 => network.schedule(at, Fault::Heal(cable)),
        _ => {}
    }
}

/// Left edge, width of a cycle, and start of each part, in pixels.
const LEFT: f64 = 150.0;
const STEP: f64 = 16.0;
const WIDTH: f64 = LEFT + STEP * (CYCLES[0] + CYCLES[1] + CYCLES[2]) as f64 + 30.0;
const BARS: f64 = 250.0;
const BAR_HEIGHT: f64 = 70.0;
const ANSWERS: f64 = 300.0;
const ANSWER_HEIGHT: f64 = 70.0;
const NOTES: f64 = 425.0;

/// Colours for light and dark pages.
const STYLE: &str = "<style>text{font:13px sans-serif;fill:#24292f}.l{stroke:#57606a;fill:none;stroke-width:1.5}\
.ok{fill:#2da44e}.bad{fill:#cf222e}.main{stroke:#0969da;fill:none;stroke-width:2.5}\
.red{stroke:#bf5af2;fill:none;stroke-width:2.5}.mt{fill:#0969da}.rt{fill:#8250df}.b{fill:#f6f8fa;stroke:#57606a}\
.cut{stroke:#cf222e;stroke-width:3}\
@media(prefers-color-scheme:dark){text{fill:#e6edf3}.l{stroke:#8d96a0}.b{fill:#21262d;stroke:#8d96a0}\
.mt{fill:#58a6ff}.rt{fill:#d2a8ff}.main{stroke:#58a6ff}.red{stroke:#d2a8ff}}</style>\n";

fn picture(cycles: &[Seen], events: &[(usize, String)]) -> String {
    let height = NOTES + 20.0 * events.len() as f64 + 10.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" \
         aria-label=\"A ring of {DEVICES} SubDevices is cut and repaired while process data goes on\">\n{STYLE}"
    );
    topology(&mut svg, 40.0, "closed", None, cycles[0].answering);
    let broken = &cycles[CYCLES[0] + CYCLES[1] - 1];
    topology(&mut svg, 110.0, "cable cut", Some(CUT_BEHIND), broken.answering);
    counters(&mut svg, cycles);
    answers(&mut svg, cycles);
    for (line, (cycle, text)) in events.iter().enumerate() {
        let y = NOTES + 20.0 * line as f64;
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        let _ = writeln!(svg, "<text x=\"20\" y=\"{y}\">{cycle} ms</text><text x=\"{LEFT}\" y=\"{y}\">{text}</text>");
    }
    svg + "</svg>\n"
}

/// The ring, with the SubDevices that can be reached on each link.
fn topology(svg: &mut String, y: f64, title: &str, cut_behind: Option<usize>, answering: [u16; 2]) {
    let pitch = (WIDTH - LEFT - 150.0) / DEVICES as f64;
    let at = |position: usize| LEFT + 70.0 + pitch * position as f64;
    let end = at(DEVICES) + 4.0;
    let _ = writeln!(svg, "<text x=\"20\" y=\"{}\">{title}</text>", y + 5.0);
    let _ = writeln!(svg, "<path class=\"l\" d=\"M{LEFT} {y}H{end}\"/>");
    let (first, last) = (LEFT, end);
    let _ = writeln!(svg, "<text class=\"mt\" x=\"{first}\" y=\"{}\">MAIN: {}</text>", y - 8.0, answering[0]);
    let _ = writeln!(
        svg,
        "<text class=\"rt\" x=\"{last}\" y=\"{}\" text-anchor=\"end\">REDUNDANT: {}</text>",
        y - 22.0,
        answering[1]
    );
    for position in 0..DEVICES {
        let x = at(position);
        let link = if position < usize::from(answering[0]) { "main" } else { "red" };
        let _ = writeln!(svg, "<rect class=\"b\" x=\"{x}\" y=\"{}\" width=\"34\" height=\"26\" rx=\"4\"/>", y - 13.0);
        let _ = writeln!(svg, "<path class=\"{link}\" d=\"M{x} {}h34\"/>", y + 16.0);
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{position}</text>", x + 17.0, y + 5.0);
    }
    if let Some(behind) = cut_behind {
        let x = (at(behind - 1) + 34.0 + at(behind)) / 2.0;
        let _ = writeln!(svg, "<path class=\"cut\" d=\"M{} {}l12 24m0 -24l-12 24\"/>", x - 6.0, y - 12.0);
    }
}

/// One bar per cycle: its working counter, red if it is not the expected one.
fn counters(svg: &mut String, cycles: &[Seen]) {
    let highest = cycles.iter().map(|cycle| cycle.wkc.max(cycle.expected)).max().unwrap_or(1).max(1);
    let incomplete = cycles.iter().filter(|cycle| cycle.wkc != cycle.expected).count();
    let expected = cycles[0].expected;
    let _ = writeln!(svg, "<text x=\"20\" y=\"{}\">working counter</text>", BARS - 40.0);
    let _ = writeln!(svg, "<text x=\"20\" y=\"{}\">{expected} expected</text>", BARS - 22.0);
    let _ = writeln!(svg, "<text x=\"20\" y=\"{}\">{incomplete} of {} incomplete</text>", BARS - 4.0, cycles.len());
    for (cycle, seen) in cycles.iter().enumerate() {
        let height = BAR_HEIGHT * f64::from(seen.wkc) / f64::from(highest);
        let class = if seen.wkc == seen.expected { "ok" } else { "bad" };
        let height = height.max(2.0);
        let (x, y) = (LEFT + STEP * cycle as f64, BARS - height);
        let _ = writeln!(svg, "<rect class=\"{class}\" x=\"{x}\" y=\"{y:.1}\" width=\"12\" height=\"{height:.1}\"/>");
    }
}

/// Number of SubDevices that respond on each link, as steps over the cycles.
fn answers(svg: &mut String, cycles: &[Seen]) {
    let bottom = ANSWERS + ANSWER_HEIGHT;
    let y = |count: u16| bottom - ANSWER_HEIGHT * f64::from(count) / DEVICES as f64;
    let _ = writeln!(svg, "<text x=\"20\" y=\"{}\">SubDevices</text>", ANSWERS + 10.0);
    let _ = writeln!(svg, "<text class=\"mt\" x=\"20\" y=\"{}\">on MAIN</text>", ANSWERS + 28.0);
    let _ = writeln!(svg, "<text class=\"rt\" x=\"20\" y=\"{}\">on REDUNDANT</text>", ANSWERS + 46.0);
    for (link, class) in ["main", "red"].into_iter().enumerate() {
        let mut path = format!("M{LEFT} {:.1}", y(cycles[0].answering[link]));
        for (cycle, seen) in cycles.iter().enumerate() {
            let _ = write!(path, "V{:.1}H{:.1}", y(seen.answering[link]), LEFT + STEP * (cycle + 1) as f64);
        }
        let _ = writeln!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
    }
    let right = LEFT + STEP * cycles.len() as f64;
    let _ = writeln!(svg, "<path class=\"l\" d=\"M{LEFT} {}H{right}\"/>", bottom + 4.0);
    for cycle in (0..cycles.len()).step_by(8) {
        let x = LEFT + STEP * cycle as f64;
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"{}\">{cycle} ms</text>", bottom + 20.0);
    }
}
