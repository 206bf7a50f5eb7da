//! Network interfaces of the host, from the side of the MainDevice.

use ringcat_link::tap::TapInterface;

/// A network interface of the host, from the side of the MainDevice.
pub trait HostInterface: Send {
    /// Copies the oldest frame that the host sent into `room`. Returns its length in bytes; `None` if there is no
    /// frame.
    fn receive(&mut self, room: &mut [u8]) -> Option<usize>;

    /// Passes a frame to the host; false if the host does not accept it.
    fn send(&mut self, frame: &[u8]) -> bool;

    /// Sets whether the interface has a carrier, so that frames can pass.
    fn set_carrier(&mut self, carrier: bool);

    /// Whether the interface still exists on the host.
    fn exists(&self) -> bool {
        true
    }

    /// Whether it may have a carrier from before it was made here.
    fn may_have_carrier(&self) -> bool {
        false
    }
}

impl HostInterface for TapInterface {
    fn receive(&mut self, room: &mut [u8]) -> Option<usize> {
        TapInterface::receive(self, room)
    }

    fn send(&mut self, frame: &[u8]) -> bool {
        TapInterface::send(self, frame)
    }

    fn set_carrier(&mut self, carrier: bool) {
        // A kernel without support for this always shows a carrier; frames are then dropped.
        TapInterface::set_carrier(self, carrier);
    }

    fn exists(&self) -> bool {
        TapInterface::exists(self)
    }
}

/// An interface that outlasts this MainDevice.
pub(super) struct Lasting(pub TapInterface);

impl HostInterface for Lasting {
    fn receive(&mut self, room: &mut [u8]) -> Option<usize> {
        self.0.receive(room)
    }

    fn send(&mut self, frame: &[u8]) -> bool {
        self.0.send(frame)
    }

    fn set_carrier(&mut self, carrier: bool) {
        self.0.set_carrier(carrier);
    }

    fn exists(&self) -> bool {
        self.0.exists()
    }

    fn may_have_carrier(&self) -> bool {
        true
    }
}
