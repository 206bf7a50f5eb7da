//! Disconnects a link for a procedure, and reconnects it.

use core::time::Duration;

use super::Bus;
use crate::link::Link;
use crate::supervisor::link_order::LinkOrder;

/// Pause between two polls for the answer.
const PAUSE: Duration = Duration::from_micros(100);
/// Time limit of the runtime.
const LIMIT: Duration = Duration::from_secs(1);

impl Bus {
    /// Disconnects or reconnects a link. False if the link layer cannot do that. The procedure that disconnected a link
    /// must reconnect it. For one procedure at a time.
    pub async fn force_disconnect(&self, link: Link, disconnect: bool) -> bool {
        self.shared.borrow_mut().link_order = LinkOrder::Given { link, disconnect };
        let until = self.now() + LIMIT;
        while self.now() < until {
            self.sleep(PAUSE).await;
            let order = self.shared.borrow().link_order;
            if let LinkOrder::Answered(done) = order {
                self.shared.borrow_mut().link_order = LinkOrder::None;
                return done;
            }
        }
        // The order was fetched but not answered: it may still be carried out, and its answer is dropped.
        self.shared.borrow_mut().link_order = LinkOrder::None;
        false
    }
}
