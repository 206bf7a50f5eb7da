//! Faults of a segment file, at given times.

use core::ops::Range;
use core::time::Duration;

use toml::Spanned;

use super::SegmentError;
use super::devices::PlannedDevice;
use super::format::{FaultEntry, File, duration, line};
use crate::cable::{CableId, DeviceIndex};
use crate::fault::Fault;

/// Limit of the time of a fault.
const YEAR: Duration = Duration::from_secs(365 * 86_400);

/// All faults of the file, with the time since the beginning of the simulation.
pub(super) fn planned(
    file: &File,
    text: &str,
    devices: &[PlannedDevice],
    cables: usize,
) -> Result<Vec<(Duration, Fault)>, SegmentError> {
    let plan = Plan { text, devices, cables };
    file.fault.iter().map(|entry| plan.fault(entry)).collect()
}

struct Plan<'a> {
    text: &'a str,
    devices: &'a [PlannedDevice],
    cables: usize,
}

impl Plan<'_> {
    fn fault(&self, entry: &Spanned<FaultEntry>) -> Result<(Duration, Fault), SegmentError> {
        let FaultEntry { at_ms, cut, heal, power_off, power_on } = entry.get_ref();
        let at_line = |error: SegmentError, place: &Range<usize>| error.at_line(line(self.text, place));
        let at = duration(at_ms, "at_ms", 1e-3).map_err(|error| at_line(error, &at_ms.span()))?;
        if at > YEAR {
            let message =
                format!("at_ms: expected at most {}, which is a year, got {}", YEAR.as_millis(), at_ms.get_ref());
            return Err(at_line(SegmentError::new(message), &at_ms.span()));
        }
        let fault = match (cut, heal, power_off, power_on) {
            (Some(cable), None, None, None) => Fault::Cut(self.cable("cut", cable)?),
            (None, Some(cable), None, None) => Fault::Heal(self.cable("heal", cable)?),
            (None, None, Some(device), None) => Fault::PowerOff(self.device("power_off", device)?),
            (None, None, None, Some(device)) => Fault::PowerOn(self.device("power_on", device)?),
            _ => {
                let message = "[[fault]]: expected one of cut, heal, power_off and power_on";
                return Err(at_line(SegmentError::new(message), &entry.span()));
            }
        };
        Ok((at, fault))
    }

    fn cable(&self, key: &str, number: &Spanned<u64>) -> Result<CableId, SegmentError> {
        let given = *number.get_ref();
        match usize::try_from(given).ok().filter(|number| *number < self.cables) {
            Some(number) => Ok(CableId(number)),
            None => {
                let message = match self.cables.checked_sub(1) {
                    Some(last) => format!("{key}: expected the number of a cable, 0 to {last}, got {given}"),
                    None => format!("{key}: expected the number of a cable, got {given}, and there is none"),
                };
                Err(SegmentError::new(message).at_line(line(self.text, &number.span())))
            }
        }
    }

    fn device(&self, key: &str, name: &Spanned<String>) -> Result<DeviceIndex, SegmentError> {
        let given = name.get_ref();
        let index = self.devices.iter().position(|device| device.description.name == *given);
        index.map(DeviceIndex).ok_or_else(|| {
            let message = format!("{key}: expected the name of a device, got \"{}\"", given.escape_debug());
            SegmentError::new(message).at_line(line(self.text, &name.span()))
        })
    }
}

#[cfg(test)]
mod tests;
