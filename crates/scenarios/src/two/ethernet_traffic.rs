//! Ethernet frames between both MainDevices of [`Two`].

use super::Two;
use crate::ethernet_peer::EthernetPeer;

/// Both sides.
#[derive(Debug)]
pub struct EthernetTraffic {
    /// By controller.
    pub sides: [EthernetPeer; 2],
    starts: u16,
    /// Frames per step of each side.
    frames: usize,
}

impl EthernetTraffic {
    /// Of this number of frames per step in each direction.
    pub fn new(frames: usize) -> EthernetTraffic {
        EthernetTraffic { sides: [EthernetPeer::new(0, 0), EthernetPeer::new(1, 0)], starts: 0, frames }
    }

    /// Both sides take what has arrived, and send.
    ///
    /// # Panics
    /// A frame is damaged, comes twice, or comes behind a later one.
    pub fn step(&mut self, two: &mut Two) {
        self.receive(two);
        for (side, controller) in self.sides.iter_mut().zip(&mut two.controllers) {
            if let Some(endpoint) = controller.endpoint.as_mut().filter(|_| !controller.is_dead) {
                side.send(endpoint, self.frames);
            }
        }
    }

    /// Both sides take what has arrived.
    ///
    /// # Panics
    /// As [`EthernetTraffic::step`].
    pub fn receive(&mut self, two: &mut Two) {
        for (side, controller) in self.sides.iter_mut().zip(&mut two.controllers) {
            if let Some(endpoint) = &mut controller.endpoint {
                side.receive(endpoint);
            }
            assert_eq!(side.fault, None, "{side:?}");
        }
    }

    /// The program of a side was started again.
    pub fn begin_anew(&mut self, number: usize) {
        self.starts += 1;
        self.sides[number] = EthernetPeer::new(number as u8, self.starts);
    }

    /// Frames of each side that have not arrived at the other one.
    pub fn missing(&self) -> [u64; 2] {
        let [first, second] = &self.sides;
        [first.sent - second.received, second.sent - first.received]
    }
}
