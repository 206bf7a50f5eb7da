//! `master`: masters with links, frames and clocks.

use std::fs;

use ringcat_control::client::ClientError;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{ToolAnswer, ToolQuery};

use crate::append::append;
use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::master::{Device, Frames, Master, Phase, Rate};
use crate::json::values::Link;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Titles of the links.
const TITLES: [&str; 2] = ["Main", "Backup"];
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
    output: Output::Data,
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
        let known = Master::new(master.master, interfaces(&master.links), report.as_deref(), transmit_errors);
        if session.arguments.json {
            json::print(session, &known)?;
        } else {
            session.write_text(&text(&known))?;
        }
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

fn text(master: &Master<'_>) -> String {
    let mut text = format!("Master{}\n", master.master);
    let phase = match master.phase {
        Phase::Operation => "Operation",
        Phase::Waiting => "Waiting for device(s)...",
        Phase::Idle => "Idle",
    };
    let active = if master.active { "yes" } else { "no" };
    append!(text, "  Phase: {phase}\n  Active: {active}\n  Slaves: {}\n  Ethernet devices:\n", master.subdevices);
    let Some(all) = &master.common else {
        for (title, name) in TITLES.iter().zip(&master.awaited_interfaces) {
            append!(text, "    {title}: {name} (waiting...)\n");
        }
        return text;
    };
    master.devices.iter().for_each(|link| text += &device(link));
    text + &common(all) + &clocks(master)
}

fn device(link: &Device) -> String {
    let title = TITLES[usize::from(link.link == Link::Redundant)];
    let state = if link.carrier == Some(false) { "DOWN" } else { "UP" };
    let mut text = format!("    {title}: {} (attached)\n      Link: {state}\n", link.mac_address);
    text += &counters(&link.frames);
    append!(text, "      Tx errors:   {}\n", link.send_errors);
    text + &rates(&link.frames)
}

fn counters(frames: &Frames) -> String {
    format!(
        "      Tx frames:   {}\n      Tx bytes:    {}\n      Rx frames:   {}\n      Rx bytes:    {}\n",
        frames.sent_frames, frames.sent_bytes, frames.received_frames, frames.received_bytes
    )
}

fn common(all: &Frames) -> String {
    let mut text = "    Common:\n".to_owned() + &counters(all);
    append!(text, "      Lost frames: {}\n", all.lost_frames);
    text += &rates(all);
    text += &row("Loss rate [1/s]:", all, |rate| format!("{:.0}", rate.lost_frames_per_s));
    text + &row("Frame loss [%]:", all, |rate| {
        let share = if rate.sent_frames_per_s > 0.0 { rate.lost_frames_per_s / rate.sent_frames_per_s } else { 0.0 };
        format!("{:.1}", 100.0 * share.min(1.0))
    })
}

fn rates(frames: &Frames) -> String {
    let number = |value: f64| format!("{:.0}", value.max(0.0));
    let kilobytes = |value: f64| format!("{:.1}", value.max(0.0) / KILO);
    row("Tx frame rate [1/s]:", frames, |rate| number(rate.sent_frames_per_s))
        + &row("Tx rate [KByte/s]:", frames, |rate| kilobytes(rate.sent_bytes_per_s))
        + &row("Rx frame rate [1/s]:", frames, |rate| number(rate.received_frames_per_s))
        + &row("Rx rate [KByte/s]:", frames, |rate| kilobytes(rate.received_bytes_per_s))
}

fn row(title: &str, frames: &Frames, value: impl Fn(&Rate) -> String) -> String {
    let values = frames.rates.each_ref().map(|rate| format!(" {:>6}", value(rate)));
    format!("      {title:<20}{}\n", values.concat())
}

fn clocks(master: &Master<'_>) -> String {
    let reference = master.reference_clock.map_or("None".to_owned(), |position| format!("Slave {position}"));
    let mut text = format!("  Distributed clocks:\n    Reference clock:   {reference}\n");
    append!(text, "    DC reference time: {}\n", master.reference_time_ns);
    append!(text, "    Application time:  {}\n", master.application_time_ns);
    text + &format!("                       {}\n", date(master.application_time_ns))
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
    use ringcat_control::tool::{LinkReport, MasterReport, Traffic, TrafficRate};

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
        let errors = |name: &str| if name == "eth2" { 5 } else { 0 };
        let text = text(&Master::new(0, interfaces("eth1,eth2"), Some(&report), errors));
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
        let wanted = "Master1\n  Phase: Waiting for device(s)...\n  Active: no\n  Slaves: 0\n  Ethernet devices:\n    \
                      Main: eth1 (waiting...)\n    Backup: eth2 (waiting...)\n";
        assert_eq!(text(&Master::new(1, interfaces("eth1,eth2"), None, |_| 0)), wanted);
    }
}
