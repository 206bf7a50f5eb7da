//! Lines for events of MainDevice redundancy.

use ringcat_engine::event::{Event, StandbyEvent};
use ringcat_engine::role::MainDeviceRole;
use ringcat_wire::master_frame::{NotReady, VERSION};

use super::names::{Names, address};

pub(super) fn describe(event: &Event, names: &Names) -> Option<String> {
    let Event::Standby(event) = event else { return None };
    Some(match event {
        StandbyEvent::RoleChanged { role: MainDeviceRole::Active, cause } => {
            format!("ACTIVE ({cause}): this MainDevice controls the bus")
        }
        StandbyEvent::RoleChanged { role, cause } => format!("{role} ({cause}): this MainDevice sends nothing"),
        StandbyEvent::TookOver { silence, in_state, is_hot, cut } => {
            let silence = silence.map_or_else(
                || "no frame of another MainDevice has come".to_owned(),
                |time| format!("the last cycle of the other MainDevice was {:.3} ms ago", time.as_secs_f64() * 1e3),
            );
            let cut = cut.map_or_else(String::new, |write| format!("; possibly cut off: {write}"));
            match is_hot {
                true => format!("taken over: {in_state} SubDevices go on as they are; {silence}{cut}"),
                false => format!("taken over: all SubDevices are configured again from INIT on; {silence}{cut}"),
            }
        }
        StandbyEvent::Partner(partner) => format!("the other MainDevice: {partner}"),
        StandbyEvent::Collision { arrived_on, source } => {
            format!("collision: another MainDevice sends, too: {} on {arrived_on}", address(*source))
        }
        StandbyEvent::ConfigurationDiffers { what, .. } => {
            format!("the other MainDevice has another configuration: {what}")
        }
        StandbyEvent::OtherVersion { got, least } => format!(
            "the other MainDevice has master frames of version {got}, this one of version {VERSION}; from version \
             {least} on they work with each other: update {}",
            if *got > VERSION { "this one" } else { "the other one" }
        ),
        StandbyEvent::Readiness(reasons) => match *reasons == NotReady::NOTHING {
            true => "ready: either MainDevice can fail".to_owned(),
            false => format!("not ready: {reasons}"),
        },
        StandbyEvent::HandOverRefused(partner) => {
            format!("the role was not handed over: the other MainDevice is {partner}")
        }
        StandbyEvent::KnowledgeTooLong { bytes, room } => format!(
            "the other MainDevice cannot follow: the knowledge of the segment has {bytes} bytes, at most {room}"
        ),
        StandbyEvent::NoActive { silence } => format!(
            "ALARM: no process data of an ACTIVE for {:.3} ms, and this MainDevice does not take over",
            silence.as_secs_f64() * 1e3
        ),
        StandbyEvent::WatchdogTooShort { subdevice, watchdog, needed } => format!(
            "{}: its watchdog of {:.1} ms is too short: a takeover may last {:.1} ms, and the SubDevice then leaves OP",
            names.of(*subdevice),
            watchdog.as_secs_f64() * 1e3,
            needed.as_secs_f64() * 1e3
        ),
        StandbyEvent::ActiveIsBack => "an ACTIVE sends process data again".to_owned(),
        StandbyEvent::RoleRefused(write) => {
            format!("the role does not change: {write}; a forced request would cut that off")
        }
        _ => return None,
    })
}
