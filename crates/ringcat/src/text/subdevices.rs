//! Lines for states, configuration and messages of SubDevices.

use ringcat_engine::event::{Event, StartupSource};
use ringcat_engine::ring_status::Occupant;

use super::names::Names;

pub(super) fn describe(event: &Event, names: &Names, ends: [Option<Occupant>; 2]) -> Option<String> {
    Some(match event {
        Event::StateReached { subdevice, state } => format!("{}: {state}", names.of(*subdevice)),
        Event::StateError { subdevice, requested: Some(state), status, code } => {
            format!("{}: refused {state}: {status}, {code}", names.of(*subdevice))
        }
        Event::StateError { subdevice, requested: None, status, code } => {
            format!("{}: changed to {status} by itself: {code}", names.of(*subdevice))
        }
        Event::UndeclaredFailed { position, reason } => {
            format!("{}: did not reach its requested state: {reason}", names.at(*position, ends[0]))
        }
        Event::UndeclaredState { position, status, code } => {
            format!("{}: changed to {status} by itself: {code}", names.at(*position, ends[0]))
        }
        Event::Lost { subdevice } => format!("{}: no longer answers", names.of(*subdevice)),
        Event::Returned { subdevice } => format!("{}: answers again", names.of(*subdevice)),
        Event::Missing { subdevice, optional: true } => format!("{}: absent, which is allowed", names.of(*subdevice)),
        Event::Missing { subdevice, optional: false } => format!("{}: missing", names.of(*subdevice)),
        Event::Moved { subdevice, from, to } => {
            format!("{}: moved from position {from} to position {to}", names.of(*subdevice))
        }
        Event::GroupJoined { group } => format!("hot connect group {group}: all SubDevices are in their states"),
        Event::GroupLeft { group } => {
            format!("hot connect group {group}: not all SubDevices are in their states any more")
        }
        Event::ConfigurationFailed { subdevice, reason } => {
            format!("{}: configuration failed: {reason}", names.of(*subdevice))
        }
        Event::DeclarationWarning { subdevice, what } => format!("{}: {what}", names.of(*subdevice)),
        Event::Unexpected { position, identity } => format!(
            "{}: not declared: vendor {:#010x}, product {:#010x}",
            names.at(*position, ends[0]),
            identity.vendor_id,
            identity.product_code
        ),
        Event::Mismatch { subdevice, position, field, expected, got } => {
            let (name, place) = (names.of(*subdevice), names.at(*position, ends[0]));
            format!("{name}: expected {field} {expected:#010x}, {place} has {got:#010x}: it is not configured")
        }
        Event::StartupRead { subdevice, number, source, comment, data } => {
            let comment = comment.as_ref().map_or_else(String::new, |comment| format!(" \"{comment}\""));
            let contents = match source {
                StartupSource::File { .. } => format!("{} bytes", data.len()),
                _ => hex(data),
            };
            format!("{}: start-up command {number}{comment} read {source}: {contents}", names.of(*subdevice))
        }
        Event::Emergency { subdevice, emergency } => {
            let (code, register) = (emergency.error_code, emergency.error_register);
            let (name, data) = (names.at_address(*subdevice), hex(&emergency.data));
            let class = emergency.class_name().map(|class| format!(" ({class})")).unwrap_or_default();
            format!("{name}: emergency {code:#06x}{class}, error register {register:#04x}, data {data}")
        }
        _ => return None,
    })
}

/// Bytes in hexadecimal, separated by blanks.
fn hex(data: &[u8]) -> String {
    let bytes: Vec<String> = data.iter().map(|byte| format!("{byte:02x}")).collect();
    bytes.join(" ")
}
