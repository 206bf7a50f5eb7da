//! Plugs in the cables: the outgoing cable of each port, and checks.

use crate::cable::{CableId, CableSpec, Direction, Endpoint, HostLink, LegId};
use crate::device::Device;
use crate::segment::SegmentError;

use ringcat_wire::register::PortKind;

/// The outgoing direction of the cable at each port and at each interface of the MainDevices.
pub(super) struct Outlets {
    pub(super) devices: Vec<[Option<LegId>; 4]>,
    pub(super) hosts: [Option<LegId>; HostLink::COUNT],
}

/// Plugs in all cables.
pub(super) fn plug(devices: &[Device], cables: &[CableSpec]) -> Result<Outlets, SegmentError> {
    let mut outlets = Outlets { devices: vec![[None; 4]; devices.len()], hosts: [None; HostLink::COUNT] };
    for (number, cable) in cables.iter().enumerate() {
        let id = CableId(number);
        for (endpoint, direction) in [(cable.a, Direction::AToB), (cable.b, Direction::BToA)] {
            let outlet = match endpoint {
                Endpoint::Host(link) => &mut outlets.hosts[link as usize],
                Endpoint::Device(device, port) => {
                    let Some(found) = devices.get(device.0) else {
                        return Err(SegmentError::new(format!(
                            "cable {number} ends at device {}, but there are only {} devices",
                            device.0,
                            devices.len()
                        )));
                    };
                    if found.description.ports[port.index()] == PortKind::NotImplemented {
                        let message = format!("cable {number} ends at port {}, which it does not have", port.index());
                        return Err(SegmentError::new(message).about(found.name()));
                    }
                    &mut outlets.devices[device.0][port.index()]
                }
            };
            if let Some(taken) = outlet {
                let message = format!("cable {number} ends where cable {} is plugged in", taken.cable().0);
                let error = SegmentError::new(format!("{message} ({})", describe(endpoint)));
                return Err(match endpoint {
                    Endpoint::Device(device, _) => error.about(devices[device.0].name()),
                    Endpoint::Host(_) => error,
                });
            }
            *outlet = Some(LegId::new(id, direction));
        }
    }
    Ok(outlets)
}

fn describe(endpoint: Endpoint) -> String {
    match endpoint {
        Endpoint::Host(link) => format!("the {link} link of the MainDevice"),
        Endpoint::Device(_, port) => format!("port {}", port.index()),
    }
}
