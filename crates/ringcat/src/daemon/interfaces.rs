//! Network interfaces of EoE that a daemon has made: they outlast the process that drives the bus.

use std::collections::BTreeMap;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ringcat_control::message::Content;
use ringcat_link::tap::{TapError, TapInterface};

use super::orders::Orders;

/// Interfaces from a daemon.
#[derive(Debug)]
pub(super) struct HandedInterfaces {
    state: Mutex<State>,
    orders: Arc<Orders>,
}

#[derive(Debug, Default)]
struct State {
    there: BTreeMap<String, TapInterface>,
    ordered: BTreeMap<String, Ordered>,
}

/// An interface that the daemon is to make.
#[derive(Debug)]
enum Ordered {
    /// The daemon has not answered.
    Waits,
    /// The daemon does not make it, for this reason.
    Refused(String),
}

impl HandedInterfaces {
    /// The interfaces that came with the bus. A descriptor of another kind is left out: the interface is ordered when
    /// it is needed.
    pub fn new(descriptors: Vec<OwnedFd>, orders: Arc<Orders>) -> HandedInterfaces {
        let taps = descriptors.into_iter().filter_map(|fd| TapInterface::adopt(fd).ok());
        let there = taps.map(|tap| (tap.name().to_owned(), tap)).collect();
        HandedInterfaces { state: Mutex::new(State { there, ordered: BTreeMap::new() }), orders }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A duplicate of the interface with this name; `None` while the daemon makes it.
    ///
    /// # Errors
    /// The daemon does not make it.
    pub fn find(&self, name: &str, mac: [u8; 6]) -> Result<Option<TapInterface>, TapError> {
        let refused = |cause: String| TapError::Refused { name: name.to_owned(), cause };
        let mut state = self.state();
        match state.there.get(name) {
            Some(tap) if tap.exists() => {
                return tap.duplicate().map(Some).map_err(|error| refused(error.to_string()));
            }
            // Another program has removed it.
            Some(_) => _ = state.there.remove(name),
            None => {}
        }
        match state.ordered.remove(name) {
            Some(Ordered::Refused(cause)) => return Err(refused(cause)),
            Some(Ordered::Waits) => {}
            None => {
                let order = Content::MakeInterface { name: name.to_owned(), mac };
                if !self.orders.push(order) {
                    return Ok(None);
                }
            }
        }
        state.ordered.insert(name.to_owned(), Ordered::Waits);
        Ok(None)
    }

    /// The daemon has answered.
    pub fn answered(&self, name: String, made: Result<OwnedFd, String>) {
        let mut state = self.state();
        match made.and_then(|fd| TapInterface::adopt(fd).map_err(|error| error.to_string())) {
            Ok(tap) => {
                state.ordered.remove(&name);
                state.there.insert(name, tap);
            }
            Err(cause) => _ = state.ordered.insert(name, Ordered::Refused(cause)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, eoe-interfaces
    #[test]
    fn an_absent_interface_is_ordered_once_and_a_refusal_is_reported_once() {
        let orders = Orders::new().expect("there are descriptors");
        let handed = HandedInterfaces::new(Vec::new(), orders.clone());
        let mac = [2, 0, 0, 0, 0, 1];
        for _ in 0..3 {
            assert!(matches!(handed.find("eoe0s1", mac), Ok(None)));
        }
        assert_eq!(orders.take(), [Content::MakeInterface { name: "eoe0s1".to_owned(), mac }]);
        handed.answered("eoe0s1".to_owned(), Err("no permission".to_owned()));
        let refused = handed.find("eoe0s1", mac).expect_err("the daemon does not").to_string();
        assert_eq!(refused, "eoe0s1: no permission");
        // A descriptor that is no interface is a refusal, too.
        assert!(matches!(handed.find("eoe0s1", mac), Ok(None)) && orders.take().len() == 1);
        let (_reader, writer) = std::io::pipe().expect("a pipe");
        handed.answered("eoe0s1".to_owned(), Ok(writer.into()));
        assert!(handed.find("eoe0s1", mac).is_err());
    }
}
