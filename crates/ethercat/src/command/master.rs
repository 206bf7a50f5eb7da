//! `master`: masters with links, frames and clocks.

use std::fs;

use ringcat_control::client::ClientError;
use ringcat_control::message::MasterState;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{LinkReport, MasterReport, ToolAnswer, ToolQuery, Traffic, TrafficRate};

use crate::failure::{Failure, unexpected};
use crate::session::Session;
use crate::shape::Command;

/// Bytes of a KByte.
const KILO: f64 = 1024.0;
/// Seconds of a day.
const DAY: u64 = 86_400;
/// Days from 1970-01-01 to 2000-01-01.
const YEAR_2000: u64 = 10_957;

/// The command.
pub const COMMAND: Command = Command {
    name: "master",
    summary: "Show master and Ethernet device information.",
    forms: &[""],
    help: "Phase, number of slaves, frames and rates of the link devices over 1, 10
and 60 seconds, distributed clocks. A frame counts as received on the
device that sent it.
",
    options: "",
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        let report = match session.tool(master.master, ToolQuery::Master) {
            Ok(ToolAnswer::Master(report)) => Some(report),
            Ok(_) => return Err(unexpected()),
            // Its interface is not there: it waits.
            Err(Failure::Asked(ClientError::Refused(Refusal::Fault { .. }))) => None,
            Err(failure) => return Err(failure),
        };
        session.write(text(&master, report.as_deref(), transmit_errors).as_bytes())?;
    }
    Ok(())
}

/// Names of the link devices; none of a simulated segment.
fn interfaces(links: &str) -> Vec<&str> {
    if links.starts_with("sim:") { Vec::new() } else { links.split(',').collect() }
}

/// Frames that the kernel could not send.
fn transmit_errors(interface: &str) -> u64 {
    let is_name = !interface.is_empty() && !interface.contains(['/', '\0']) && !interface.starts_with('.');
    let file = format!("/sys/class/net/{interface}/statistics/tx_errors");
    let text = if is_name { fs::read_to_string(file).unwrap_or_default() } else { String::new() };
    text.trim().parse().unwrap_or(0)
}

fn text(master: &MasterState, report: Option<&MasterReport>, errors: impl Fn(&str) -> u64) -> String {
    let names = interfaces(&master.links);
    let mut text = format!("Master{}\n", master.master);
    let waiting = MasterReport { is_orphaned: true, ..MasterReport::default() };
    let known = report.unwrap_or(&waiting);
    let phase = match (known.is_active, known.is_orphaned) {
        (true, _) => "Operation",
        (false, true) => "Waiting for device(s)...",
        (false, false) => "Idle",
    };
    let active = if known.is_active { "yes" } else { "no" };
    text += &format!("  Phase: {phase}\n  Active: {active}\n  Slaves: {}\n  Ethernet devices:\n", known.subdevices);
    let titles = ["Main", "Backup"];
    if report.is_none() {
        for (title, name) in titles.iter().zip(&names) {
            text += &format!("    {title}: {name} (waiting...)\n");
        }
        return text;
    }
    for (at, link) in known.links.iter().enumerate() {
        text += &device(titles[at.min(1)], link, names.get(at).map_or(0, |name| errors(name)));
    }
    let all: Vec<&Traffic> = known.links.iter().map(|link| &link.traffic).collect();
    text + &common(&sum(&all)) + &clocks(known)
}

fn device(title: &str, link: &LinkReport, errors: u64) -> String {
    let mac = link.mac.map(|byte| format!("{byte:02x}")).join(":");
    let state = if link.carrier == Some(false) { "DOWN" } else { "UP" };
    let mut text = format!("    {title}: {mac} (attached)\n      Link: {state}\n");
    text += &counters(&link.traffic);
    text += &format!("      Tx errors:   {errors}\n");
    text + &rates(&link.traffic)
}

fn counters(traffic: &Traffic) -> String {
    let (received, received_bytes) = (traffic.frames.saturating_sub(traffic.lost), received_bytes(traffic));
    format!(
        "      Tx frames:   {}\n      Tx bytes:    {}\n{}",
        traffic.frames,
        traffic.bytes,
        format_args!("      Rx frames:   {received}\n      Rx bytes:    {received_bytes}\n")
    )
}

fn received_bytes(traffic: &Traffic) -> u64 {
    traffic.bytes.saturating_sub(traffic.lost_bytes)
}

fn common(all: &Traffic) -> String {
    let mut text = "    Common:\n".to_owned() + &counters(all);
    text += &format!("      Lost frames: {}\n", all.lost);
    text += &rates(all);
    text += &row("Loss rate [1/s]:", all, |rate| format!("{:.0}", rate.lost_per_s));
    text + &row("Frame loss [%]:", all, |rate| {
        let share = if rate.frames_per_s > 0.0 { rate.lost_per_s / rate.frames_per_s } else { 0.0 };
        format!("{:.1}", 100.0 * share.min(1.0))
    })
}

fn rates(traffic: &Traffic) -> String {
    let number = |value: f64| format!("{:.0}", value.max(0.0));
    let kilobytes = |value: f64| format!("{:.1}", value.max(0.0) / KILO);
    row("Tx frame rate [1/s]:", traffic, |rate| number(rate.frames_per_s))
        + &row("Tx rate [KByte/s]:", traffic, |rate| kilobytes(rate.bytes_per_s))
        + &row("Rx frame rate [1/s]:", traffic, |rate| number(rate.frames_per_s - rate.lost_per_s))
        + &row("Rx rate [KByte/s]:", traffic, |rate| kilobytes(rate.bytes_per_s - rate.lost_bytes_per_s))
}

fn row(title: &str, traffic: &Traffic, value: impl Fn(&TrafficRate) -> String) -> String {
    let values = traffic.rates.each_ref().map(|rate| format!(" {:>6}", value(rate)));
    format!("      {title:<20}{}\n", values.concat())
}

/// The traffic of all links together.
fn sum(all: &[&Traffic]) -> Traffic {
    let mut sum = Traffic::default();
    for one in all {
        sum.frames += one.frames;
        sum.bytes += one.bytes;
        sum.lost += one.lost;
        sum.lost_bytes += one.lost_bytes;
        for (sum, one) in sum.rates.iter_mut().zip(&one.rates) {
            sum.frames_per_s += one.frames_per_s;
            sum.bytes_per_s += one.bytes_per_s;
            sum.lost_per_s += one.lost_per_s;
            sum.lost_bytes_per_s += one.lost_bytes_per_s;
        }
    }
    sum
}

fn clocks(report: &MasterReport) -> String {
    let reference = report.reference.map_or("None".to_owned(), |position| format!("Slave {position}"));
    let mut text = format!("  Distributed clocks:\n    Reference clock:   {reference}\n");
    text += &format!("    DC reference time: {}\n", report.reference_time_ns);
    text += &format!("    Application time:  {}\n", report.application_time_ns);
    text + &format!("                       {}\n", date(report.application_time_ns))
}

/// Date and time in UTC of nanoseconds since 2000-01-01.
fn date(time_ns: u64) -> String {
    let (seconds, fraction) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
    let (year, month, day) = civil(seconds / DAY + YEAR_2000);
    let (hour, minute, second) = (seconds % DAY / 3600, seconds % 3600 / 60, seconds % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}.{fraction:09}")
}

/// Year, month and day of a number of days since 1970-01-01.
fn civil(days: u64) -> (u64, u64, u64) {
    // Years begin in March, so that a leap day is the last one; 400 of them have 146,097 days.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    (400 * era + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn times_are_dates_from_2000_on() {
        assert_eq!(date(0), "2000-01-01 00:00:00.000000000");
        assert_eq!(date(848_524_769_134_958_000), "2026-11-20 21:19:29.134958000");
        assert_eq!(date(DAY * 59 * 1_000_000_000), "2000-02-29 00:00:00.000000000");
        assert_eq!(date(u64::MAX).len(), 29);
    }

    // covers: daemon
    #[test]
    fn frames_and_rates_stand_in_columns_and_common_is_their_sum() {
        let rate = TrafficRate { frames_per_s: 124.2, bytes_per_s: 7475.2, lost_per_s: 62.1, lost_bytes_per_s: 0.0 };
        let traffic = Traffic { frames: 9477, bytes: 568_620, lost: 7, lost_bytes: 420, rates: [rate; 3] };
        let link = LinkReport { mac: [0, 0x1B, 0x21, 0xAB, 0xCD, 0xEF], carrier: None, traffic };
        let report = MasterReport { links: vec![link.clone(), link], reference: Some(3), ..MasterReport::default() };
        let master = MasterState { master: 0, links: "eth1,eth2".to_owned(), owner: None, fault: None };
        let text = text(&master, Some(&report), |name| if name == "eth2" { 5 } else { 0 });
        for part in [
            "  Phase: Idle\n  Active: no\n  Slaves: 0\n  Ethernet devices:\n    Main: 00:1b:21:ab:cd:ef (attached)\n",
            "    Backup: 00:1b:21:ab:cd:ef (attached)\n      Link: UP\n      Tx frames:   9477\n",
            "      Rx frames:   9470\n      Rx bytes:    568200\n      Tx errors:   5\n",
            "      Tx frame rate [1/s]:    124    124    124\n      Tx rate [KByte/s]:      7.3    7.3    7.3\n",
            "    Common:\n      Tx frames:   18954\n",
            "      Lost frames: 14\n      Tx frame rate [1/s]:    248    248    248\n",
            "      Loss rate [1/s]:        124    124    124\n      Frame loss [%]:        50.0   50.0   50.0\n",
            "    Reference clock:   Slave 3\n",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
    }

    // covers: daemon
    #[test]
    fn a_master_without_its_interface_waits_for_it() {
        let master = MasterState { master: 1, links: "eth1,eth2".to_owned(), owner: None, fault: None };
        let wanted = "Master1\n  Phase: Waiting for device(s)...\n  Active: no\n  Slaves: 0\n  Ethernet devices:\n    \
                      Main: eth1 (waiting...)\n    Backup: eth2 (waiting...)\n";
        assert_eq!(text(&master, None, |_| 0), wanted);
    }
}
