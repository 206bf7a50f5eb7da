//! From the tables of a file to descriptions of devices.

use core::time::Duration;
use std::path::Path;

use ringcat_wire::sii::SiiHeader;

use super::SegmentError;
use super::described::{DescribedDevice, Sources};
use super::file::read_at_most;
use super::format::{DeviceEntry, File, Place, duration, line};
use super::services::services;
use crate::catalogue;
use crate::controller::Wander;
use crate::description::{DcDescription, DeviceDescription, TransitionTimes};
use crate::network::Random;

/// Maximum number of devices of a segment: station addresses are 16 bits wide.
const MAX_DEVICES: usize = 65_535;
/// Bytes of the objects and files of all devices, at most.
const MAX_BYTES: usize = 1 << 30;
/// Bytes of an entry besides its name and its value.
const ENTRY_BYTES: usize = 64;
/// Names with a special meaning as cable ends.
pub(super) const RESERVED: [&str; 3] = ["main", "redundant", "none"];

/// A device, and its table in the file.
pub(super) struct PlannedDevice {
    pub(super) description: DeviceDescription,
    /// Index of the table.
    pub(super) entry: usize,
    /// Whether it is the first device of its table.
    pub(super) first: bool,
}

/// All devices of the file.
pub(super) fn describe(
    file: &File,
    text: &str,
    sources: &Sources<'_>,
    seed: u64,
) -> Result<Vec<PlannedDevice>, SegmentError> {
    let mut plan: Vec<PlannedDevice> = Vec::new();
    let mut random = Random::new(seed);
    let mut bytes = 0_usize;
    for (number, spanned) in file.device.iter().enumerate() {
        let entry = spanned.get_ref();
        let here = line(text, &spanned.span());
        let name = name(entry, number);
        let error = |message: String, at: usize| SegmentError::new(message).about(&name).at_line(at);
        let template = template(entry, &name, sources).map_err(|(message, span)| {
            let at = span.map_or(here, |span| line(text, &span));
            error(message, at)
        })?;
        let count = entry.count.as_ref().map_or(1, |count| *count.get_ref());
        if count == 0 || plan.len().saturating_add(count) > MAX_DEVICES {
            let at = entry.count.as_ref().map_or(here, |count| line(text, &count.span()));
            return Err(error(format!("count: expected 1 to {MAX_DEVICES} devices in all, got {count}"), at));
        }
        bytes = bytes.saturating_add(size(&template).saturating_mul(count));
        if bytes > MAX_BYTES {
            return Err(error(
                format!("expected objects of at most {MAX_BYTES} bytes in all devices, got {bytes}"),
                here,
            ));
        }
        for copy in 0..count {
            let mut description = template.clone();
            description.name_in_sii = Some(name.clone());
            description.name = if count > 1 { format!("{name}-{}", copy + 1) } else { name.clone() };
            check_name(&description.name, &plan)
                .map_err(|message| error(message, entry.name.as_ref().map_or(here, |name| line(text, &name.span()))))?;
            // Clocks of devices that were switched on at different times (protocol 11.3).
            let start = random.next() >> 16;
            description.clock_start_ns = entry.clock_start_ns.unwrap_or(start);
            // Each device has a unique MAC address.
            let [.., high, low] = &mut description.services.eoe.mac;
            [*high, *low] = (plan.len() as u16).wrapping_add(1).to_be_bytes();
            plan.push(PlannedDevice { description, entry: number, first: copy == 0 });
        }
    }
    Ok(plan)
}

/// Bytes of the objects and files of a device.
fn size(description: &DeviceDescription) -> usize {
    let entries = description.objects.iter().chain(&description.described).flat_map(|object| &object.entries);
    let files = description.services.foe.files.iter().map(|(_, data)| data.len());
    entries.map(|entry| ENTRY_BYTES + entry.name.len() + entry.value.len()).sum::<usize>() + files.sum::<usize>()
}

/// Name of a device; generated if the table has none.
fn name(entry: &DeviceEntry, number: usize) -> String {
    let stem =
        entry.kind.as_ref().or(entry.sii.as_ref()).or(entry.esi.as_ref()).map_or("device", |kind| kind.get_ref());
    let stem = Path::new(stem).file_stem().and_then(|stem| stem.to_str()).unwrap_or("device");
    let given = entry.name.as_ref().map(|name| name.get_ref().clone());
    given.unwrap_or_else(|| format!("{}-{}", stem.replace('.', "-"), number + 1))
}

fn check_name(name: &str, plan: &[PlannedDevice]) -> Result<(), String> {
    if name.is_empty() || name.contains('.') || name.contains(char::is_control) || RESERVED.contains(&name) {
        return Err(format!(
            "name: expected one without a dot that is not one of {}, got \"{}\"",
            RESERVED.join(", "),
            name.escape_debug()
        ));
    }
    if let Some(place) = plan.iter().position(|device| device.description.name == name) {
        return Err(format!("name: \"{name}\" is that of device {place} already"));
    }
    Ok(())
}

/// The device of one table.
fn template(entry: &DeviceEntry, name: &str, sources: &Sources<'_>) -> Result<DeviceDescription, (String, Place)> {
    let base_dir = sources.base_dir;
    let mut description = match (&entry.kind, &entry.sii) {
        _ if entry.esi.is_some() => described(entry, name, sources)?,
        (Some(kind), None) => {
            let known = || catalogue::names().collect::<Vec<_>>().join(", ");
            catalogue::by_name(kind.get_ref()).ok_or_else(|| {
                let message = format!("type: expected one of {}, got \"{}\"", known(), kind.get_ref().escape_debug());
                (message, Some(kind.span()))
            })?
        }
        (None, Some(file)) => {
            let path = base_dir.join(file.get_ref());
            let place = || Some(file.span());
            let image = read_at_most(&path, SiiHeader::MAX_EEPROM_BYTES as u64)
                .map_err(|error| (format!("sii: {} {error}", path.display()), place()))?;
            DeviceDescription::from_sii(image, name)
                .map_err(|error| (format!("sii: {}: {error}", path.display()), place()))?
        }
        (Some(_), Some(file)) => return Err(("sii: expected either type or sii, got both".into(), Some(file.span()))),
        (None, None) => return Err(("type: expected a key type or sii, got neither".into(), None)),
    };
    let of_esi = entry.revision.as_ref().map(|it| ("revision", it.span()));
    let of_esi = of_esi.or(entry.product.as_ref().map(|it| ("product", it.span())));
    let of_esi = of_esi.or(entry.modules.first().map(|it| ("modules", it.span())));
    if let (None, Some((key, span))) = (&entry.esi, of_esi) {
        return Err((format!("{key}: expected a device of a description file (key esi)"), Some(span)));
    }
    settings(entry, &mut description)?;
    services(entry, &mut description, base_dir)?;
    Ok(description)
}

/// A device of a description file.
fn described(entry: &DeviceEntry, name: &str, sources: &Sources<'_>) -> Result<DeviceDescription, (String, Place)> {
    if let Some(sii) = &entry.sii {
        return Err(("sii: expected either esi or sii, got both".into(), Some(sii.span())));
    }
    let Some(esi) = &entry.esi else { return Err(("esi: expected a file".into(), None)) };
    let wanted = DescribedDevice {
        path: sources.base_dir.join(esi.get_ref()),
        kind: entry.kind.as_ref().map(|kind| kind.get_ref().clone()),
        revision: entry.revision.as_ref().map(|revision| *revision.get_ref()),
        product: entry.product.as_ref().map(|product| *product.get_ref()),
        modules: entry.modules.iter().map(|module| module.get_ref().clone()).collect(),
    };
    sources.descriptions.device(&wanted, name).map_err(|fault| {
        let span = match fault.key {
            "type" => entry.kind.as_ref().map(|kind| kind.span()),
            "revision" => entry.revision.as_ref().map(|revision| revision.span()),
            "product" => {
                entry.product.as_ref().map(|product| product.span()).or(entry.kind.as_ref().map(|it| it.span()))
            }
            "modules" => entry.modules.first().map(|module| module.span()),
            _ => None,
        };
        (format!("{}: {}", fault.key, fault.message), span.or(Some(esi.span())))
    })
}

/// The other keys of a table.
fn settings(entry: &DeviceEntry, description: &mut DeviceDescription) -> Result<(), (String, Place)> {
    let time =
        |value: &Option<toml::Spanned<f64>>, key: &str, unit: f64| -> Result<Option<Duration>, (String, Place)> {
            let Some(value) = value else {
                return Ok(None);
            };
            duration(value, key, unit).map(Some).map_err(|error| (error.message, Some(value.span())))
        };
    if let Some(alias) = entry.alias {
        description.alias = alias;
    }
    if let Some(serial) = entry.serial {
        description.identity.serial = serial;
    }
    clock(entry, description)?;
    description.processing_delay = entry.processing_ns.map(Duration::from_nanos);
    description.forwarding_delay = entry.forwarding_ns.map(Duration::from_nanos);
    if let Some(eight) = entry.eight_byte_sii {
        description.eight_byte_sii = eight;
    }
    if let Some(busy) = time(&entry.sii_busy_us, "sii_busy_us", 1e-6)? {
        description.sii_busy = busy;
    }
    if let Some(all) = time(&entry.transition_ms, "transition_ms", 1e-3)? {
        description.transitions = TransitionTimes::all(all);
    }
    let times = &mut description.transitions;
    for (value, key, target) in [
        (&entry.to_init_ms, "to_init_ms", &mut times.to_init),
        (&entry.to_preop_ms, "to_preop_ms", &mut times.to_preop),
        (&entry.to_safeop_ms, "to_safeop_ms", &mut times.to_safeop),
        (&entry.to_op_ms, "to_op_ms", &mut times.to_op),
        (&entry.back_ms, "back_ms", &mut times.back),
    ] {
        *target = time(value, key, 1e-3)?.unwrap_or(*target);
    }
    Ok(())
}

/// Keys of the clock.
fn clock(entry: &DeviceEntry, description: &mut DeviceDescription) -> Result<(), (String, Place)> {
    let ppb = |value: &Option<toml::Spanned<f64>>, key: &str, limit: f64| -> Result<Option<i64>, (String, Place)> {
        let Some(given) = value else { return Ok(None) };
        if !(-limit..=limit).contains(given.get_ref()) {
            let message = format!("{key}: expected -{limit} to {limit}, got {}", given.get_ref());
            return Err((message, Some(given.span())));
        }
        Ok(Some((*given.get_ref() * 1e3).round() as i64))
    };
    if let Some(drift) = ppb(&entry.drift_ppm, "drift_ppm", 1e6)? {
        description.clock_drift_ppb = drift;
    }
    if let Some(wander) = ppb(&entry.wander_ppm, "wander_ppm", 1e4)? {
        // Temperature in a cabinet changes within minutes.
        let period = Duration::from_secs(60);
        description.clock_wander = Wander { amplitude_ppb: wander, period };
    }
    for (value, key, unit, target) in [
        (&entry.wander_s, "wander_s", 1.0, &mut description.clock_wander.period),
        (&entry.receive_jitter_ns, "receive_jitter_ns", 1e-9, &mut description.receive_jitter),
    ] {
        if let Some(value) = value {
            *target = duration(value, key, unit).map_err(|error| (error.message, Some(value.span())))?;
        }
    }
    if let Some(only) = entry.latches_processing_only {
        description.latches_processing_only = only;
    }
    if let Some(any) = entry.latches_any_frame {
        description.latches_any_frame = any;
    }
    let Some(bits) = &entry.clock_bits else { return Ok(()) };
    description.dc = match *bits.get_ref() {
        0 => None,
        width @ (32 | 64) => {
            let before = description.dc.take();
            let (modes, minimum_cycle_ns) = before.map_or_else(Default::default, |dc| (dc.modes, dc.minimum_cycle_ns));
            Some(DcDescription { wide: width == 64, modes, minimum_cycle_ns })
        }
        other => return Err((format!("clock_bits: expected 0, 32 or 64, got {other}"), Some(bits.span()))),
    };
    Ok(())
}
