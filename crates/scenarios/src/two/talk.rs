//! A conversation of both MainDevices of [`Two`] in Ethernet frames.

use super::Two;
use crate::talk::Speaker;

/// Both sides.
#[derive(Debug)]
pub struct Talk {
    /// By controller.
    pub sides: [Speaker; 2],
    starts: u16,
    /// Frames per step of each side.
    frames: usize,
}

impl Talk {
    /// Of so many frames per step in each direction.
    pub fn new(frames: usize) -> Talk {
        Talk { sides: [Speaker::new(0, 0), Speaker::new(1, 0)], starts: 0, frames }
    }

    /// Both sides take what has arrived, and send.
    ///
    /// # Panics
    /// A frame is damaged, comes twice, or comes behind a later one.
    pub fn step(&mut self, two: &mut Two) {
        self.listen(two);
        for (side, controller) in self.sides.iter_mut().zip(&mut two.controllers) {
            if let Some(endpoint) = controller.endpoint.as_mut().filter(|_| !controller.is_dead) {
                side.say(endpoint, self.frames);
            }
        }
    }

    /// Both sides take what has arrived.
    ///
    /// # Panics
    /// As [`Talk::step`].
    pub fn listen(&mut self, two: &mut Two) {
        for (side, controller) in self.sides.iter_mut().zip(&mut two.controllers) {
            if let Some(endpoint) = &mut controller.endpoint {
                side.listen(endpoint);
            }
            assert_eq!(side.fault, None, "{side:?}");
        }
    }

    /// The program of a side was started again.
    pub fn begin_anew(&mut self, number: usize) {
        self.starts += 1;
        self.sides[number] = Speaker::new(number as u8, self.starts);
    }

    /// Frames of each side that have not arrived at the other one.
    pub fn missing(&self) -> [u64; 2] {
        let [first, second] = &self.sides;
        [first.sent - second.received, second.sent - first.received]
    }
}
