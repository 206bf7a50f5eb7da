//! Network interfaces of EoE of a bus that a daemon has handed over: those of the daemon, which outlast this process.

#[cfg(feature = "eoe")]
pub(super) use with::Ethernet;
#[cfg(not(feature = "eoe"))]
pub(super) use without::Ethernet;

#[cfg(feature = "eoe")]
mod with {
    use std::os::fd::OwnedFd;
    use std::sync::Arc;

    use ringcat_wire::frame::MacAddress;

    use crate::daemon::interfaces::HandedInterfaces;
    use crate::daemon::orders::Orders;
    use crate::eoe::EthernetOptions;
    use crate::error::Error;
    use crate::supervisor_thread::SupervisorThread;

    /// The interfaces, and what moves their frames.
    #[derive(Clone, Debug)]
    pub struct Ethernet {
        handed: Arc<HandedInterfaces>,
        moved: Arc<crate::eoe::Ethernet>,
    }

    impl Ethernet {
        /// Moves frames between the interfaces and the mailboxes of a master, whose main link has this address.
        ///
        /// # Errors
        /// The thread of the acyclic half has ended.
        pub fn start(
            supervisor: &SupervisorThread,
            (master, main): (u32, MacAddress),
            descriptors: Vec<OwnedFd>,
            orders: &Arc<Orders>,
        ) -> Result<Ethernet, Error> {
            let handed = Arc::new(HandedInterfaces::new(descriptors, orders.clone()));
            // A master with a larger number has no network interfaces.
            let options = EthernetOptions::new(u16::try_from(master).unwrap_or(u16::MAX), main.0);
            let found = handed.clone();
            let moved = supervisor.start_lasting_ethernet(options, move |name, mac| found.find(name, mac))?;
            Ok(Ethernet { handed, moved: Arc::new(moved) })
        }

        /// The daemon has made an interface, or not.
        pub fn answered(&self, name: String, made: Result<OwnedFd, String>) {
            self.handed.answered(name, made);
        }

        /// Moves nothing any more.
        pub fn end(&self) {
            self.moved.end();
        }
    }
}

#[cfg(not(feature = "eoe"))]
mod without {
    use std::os::fd::OwnedFd;
    use std::sync::Arc;

    use ringcat_wire::frame::MacAddress;

    use crate::daemon::orders::Orders;
    use crate::error::Error;
    use crate::supervisor_thread::SupervisorThread;

    /// Without the feature `eoe` frames stay where they are.
    #[derive(Clone, Debug)]
    pub struct Ethernet;

    impl Ethernet {
        /// Moves nothing.
        ///
        /// # Errors
        /// None.
        pub fn start(
            _supervisor: &SupervisorThread,
            _of: (u32, MacAddress),
            _descriptors: Vec<OwnedFd>,
            _orders: &Arc<Orders>,
        ) -> Result<Ethernet, Error> {
            Ok(Ethernet)
        }

        /// No interface was ordered, so there is no answer to one.
        pub fn answered(&self, _name: String, _made: Result<OwnedFd, String>) {}

        /// Nothing was moved.
        pub fn end(&self) {}
    }
}
