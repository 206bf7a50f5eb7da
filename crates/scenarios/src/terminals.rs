//! Segments of many plain terminals for figures of the start: a full SII of 512 bytes, 500 us per EEPROM command, 5
//! ms per state change, a selectable time per hop.

use std::time::Duration;

use ringcat_sim::description::{DeviceDescription, TransitionTimes};
use ringcat_sim::device::Device;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::sii::Sii;

use crate::segments::describe;

/// Bytes of SII.
pub const SII_BYTES: usize = 512;
/// Time of an EEPROM command.
pub const SII_BUSY: Duration = Duration::from_micros(500);
/// Time of a state change.
pub const STATE_CHANGE: Duration = Duration::from_millis(5);
/// Delay from one device to the next in the bars.
pub const HOP: Duration = Duration::from_micros(1);

/// How the terminals are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Links {
    /// A line on the main link.
    One,
    /// A closed ring.
    Two,
}

/// This many terminals, every second one with outputs.
///
/// # Panics
/// When the segment cannot be built.
pub fn segment(count: usize, eight_byte_sii: bool, links: Links, hop: Duration) -> Network {
    let kinds = ["digital-output-8", "digital-input-8"].map(|kind| terminal(kind, eight_byte_sii));
    let devices = (0..count).map(|at| Device::new(kinds[at % kinds.len()].clone())).collect();
    let builder = match links {
        Links::One => SegmentBuilder::line(devices),
        Links::Two => SegmentBuilder::ring(devices),
    };
    let options = NetworkOptions::default().with_hop_delay(hop);
    builder.cable_delay(Duration::ZERO).options(options).build().expect("terminals make a segment")
}

/// A terminal with a full SII: the name of its group fills the remaining space.
fn terminal(kind: &str, eight_byte_sii: bool) -> DeviceDescription {
    let mut description = describe(kind, kind);
    description.sii_size_bytes = SII_BYTES;
    description.sii_busy = SII_BUSY;
    description.eight_byte_sii = eight_byte_sii;
    description.transitions = TransitionTimes::all(STATE_CHANGE);
    let room = SII_BYTES.saturating_sub(sii_bytes_used(&Device::new(description.clone())));
    description.group.extend(std::iter::repeat_n('x', room));
    description
}

/// Bytes of a device's SII up to the end of its categories.
pub fn sii_bytes_used(device: &Device) -> usize {
    Sii::parse(&device.controller.config().sii).map_or(0, |sii| sii.used())
}
