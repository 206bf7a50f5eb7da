//! From the tables of a file to cables.

use core::fmt::Display;
use core::ops::Range;
use core::time::Duration;

use ringcat_wire::register::PortKind;
use toml::Value;

use super::SegmentError;
use super::devices::PlannedDevice;
use super::format::{DeviceEntry, File, line};
use crate::cable::{CableSpec, DEFAULT_CABLE_DELAY, DeviceIndex, Endpoint, HostLink};
use crate::frame::Port;

/// Ports for further devices, in the order of the search for a free port: OUT of a two-port device first, then the
/// order in which frames pass ports.
const FURTHER: [Port; 3] = [Port::B, Port::D, Port::C];

/// A key of the file, for errors.
#[derive(Clone, Debug)]
struct Key {
    name: &'static str,
    span: Range<usize>,
}

/// The cables planned so far.
struct Plan<'a> {
    text: &'a str,
    devices: &'a [PlannedDevice],
    cables: Vec<CableSpec>,
}

/// All cables of the file.
pub(super) fn plug(file: &File, text: &str, devices: &[PlannedDevice]) -> Result<Vec<CableSpec>, SegmentError> {
    let delay = |given: Option<u64>| given.or(file.segment.cable_ns).map_or(DEFAULT_CABLE_DELAY, Duration::from_nanos);
    // Listed cables first: devices attached without a port use a free one.
    let mut plan = Plan { text, devices, cables: Vec::new() };
    for cable in &file.cable {
        let cable = cable.get_ref();
        let keys = [("from", &cable.from), ("to", &cable.to)].map(|(name, end)| Key { name, span: end.span() });
        let from = plan.endpoint(cable.from.get_ref(), &keys[0])?;
        let to = plan.endpoint(cable.to.get_ref(), &keys[1])?;
        plan.join([from, to], delay(cable.delay_ns), &keys)?;
    }
    let listed = plan.cables.len();
    for (index, device) in devices.iter().enumerate() {
        let spanned = &file.device[device.entry];
        plan.attach(index, spanned.get_ref(), &spanned.span(), delay(spanned.get_ref().cable_ns))?;
    }
    if let Some(ring) = &file.segment.ring {
        plan.close(ring.get_ref(), &Key { name: "ring", span: ring.span() }, delay(None))?;
    }
    plan.cables.rotate_left(listed);
    Ok(plan.cables)
}

impl Plan<'_> {
    fn error(&self, message: impl Display, key: &Key) -> SegmentError {
        SegmentError::new(format!("{}: {message}", key.name)).at_line(line(self.text, &key.span))
    }

    fn name(&self, device: DeviceIndex) -> &str {
        &self.devices[device.0].description.name
    }

    /// Attaches a device to the previous one, or to the endpoint in its table.
    fn attach(
        &mut self,
        index: usize,
        entry: &DeviceEntry,
        span: &Range<usize>,
        delay: Duration,
    ) -> Result<(), SegmentError> {
        let about = |error: SegmentError| error.about(&self.devices[index].description.name);
        let own = entry.port.as_ref().map_or(0, |port| *port.get_ref());
        let port = Key { name: "port", span: entry.port.as_ref().map_or(span.clone(), |port| port.span()) };
        let Some(own) = Port::from_index(own) else {
            return Err(about(self.error(format!("expected 0 to 3, got {own}"), &port)));
        };
        let given = entry.attach.as_ref().filter(|_| self.devices[index].first);
        let place = Key { name: "attach", span: given.map_or(span.clone(), |attach| attach.span()) };
        let to = match (given.map(|attach| attach.get_ref().as_str()), index.checked_sub(1)) {
            (Some("none"), _) => return Ok(()),
            (Some(text), _) => self.endpoint(text, &place),
            (None, Some(previous)) => self.next_free(DeviceIndex(previous), &place),
            (None, None) => Ok(Endpoint::Host(HostLink::Main)),
        };
        let to = to.map_err(about)?;
        self.join([to, Endpoint::Device(DeviceIndex(index), own)], delay, &[place, port])
    }

    /// Closes the ring.
    fn close(&mut self, ring: &Value, key: &Key, delay: Duration) -> Result<(), SegmentError> {
        let end = match (ring, self.devices.len().checked_sub(1)) {
            (Value::Boolean(false), _) => return Ok(()),
            (Value::Boolean(true), Some(last)) => self.next_free(DeviceIndex(last), key)?,
            (Value::Boolean(true), None) => {
                return Err(self.error("expected a device to close the ring at, there is none", key));
            }
            (Value::String(text), _) => self.endpoint(text, key)?,
            (other, _) => {
                let message = format!("expected true, false or \"device.port\", got {other}");
                return Err(self.error(message, key));
            }
        };
        self.join([end, Endpoint::Host(HostLink::Redundant)], delay, &[key.clone(), key.clone()])
    }

    /// Parses "main", "redundant", "device.port", or "device" for its next free port.
    fn endpoint(&self, text: &str, key: &Key) -> Result<Endpoint, SegmentError> {
        match text {
            "main" => return Ok(Endpoint::Host(HostLink::Main)),
            "redundant" => return Ok(Endpoint::Host(HostLink::Redundant)),
            _ => {}
        }
        let (name, port) = text.rsplit_once('.').map_or((text, None), |(name, port)| (name, Some(port)));
        let Some(index) = self.devices.iter().position(|device| device.description.name == name) else {
            let name = name.escape_debug();
            return Err(self.error(format!("expected \"main\", \"redundant\" or a device, got \"{name}\""), key));
        };
        let Some(port) = port else {
            return self.next_free(DeviceIndex(index), key);
        };
        match port.parse().ok().and_then(Port::from_index) {
            Some(port) => Ok(Endpoint::Device(DeviceIndex(index), port)),
            None => Err(self.error(format!("port of \"{name}\": expected 0 to 3, got \"{port}\""), key)),
        }
    }

    fn next_free(&self, device: DeviceIndex, key: &Key) -> Result<Endpoint, SegmentError> {
        let ports = &self.devices[device.0].description.ports;
        let free = FURTHER.into_iter().map(|port| (port, Endpoint::Device(device, port))).find(|(port, endpoint)| {
            ports[port.index()] != PortKind::NotImplemented && self.taken(*endpoint).is_none()
        });
        let message = || format!("device \"{}\" has no free port that leads further", self.name(device));
        free.map(|(_, endpoint)| endpoint).ok_or_else(|| self.error(message(), key))
    }

    /// The endpoint to which this endpoint is connected already.
    fn taken(&self, endpoint: Endpoint) -> Option<Endpoint> {
        self.cables.iter().find_map(|cable| match endpoint {
            _ if cable.a == endpoint => Some(cable.b),
            _ if cable.b == endpoint => Some(cable.a),
            _ => None,
        })
    }

    fn describe(&self, endpoint: Endpoint) -> String {
        match endpoint {
            Endpoint::Host(link) => format!("the {link} link"),
            Endpoint::Device(device, port) => format!("port {} of \"{}\"", port.index(), self.name(device)),
        }
    }

    /// `keys`: those that name the ends.
    fn join(&mut self, [a, b]: [Endpoint; 2], delay: Duration, keys: &[Key; 2]) -> Result<(), SegmentError> {
        if a == b {
            let message = format!("{} cannot be joined to itself", self.describe(a));
            return Err(self.with_device(self.error(message, &keys[0]), a));
        }
        for (end, key) in [a, b].into_iter().zip(keys) {
            if let Some(other) = self.taken(end) {
                let message = format!("{} is joined to {} already", self.describe(end), self.describe(other));
                return Err(self.with_device(self.error(message, key), end));
            }
            if let Endpoint::Device(device, port) = end
                && self.devices[device.0].description.ports[port.index()] == PortKind::NotImplemented
            {
                let message = format!("{} does not exist", self.describe(end));
                return Err(self.with_device(self.error(message, key), end));
            }
        }
        self.cables.push(CableSpec { a, b, delay });
        Ok(())
    }

    fn with_device(&self, error: SegmentError, end: Endpoint) -> SegmentError {
        match end {
            Endpoint::Device(device, _) => error.about(self.name(device)),
            Endpoint::Host(_) => error,
        }
    }
}
