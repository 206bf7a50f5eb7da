//! A link that a procedure has taken down, and brought back.

use core::time::Duration;

use super::Bus;
use crate::link::Link;
use crate::supervisor::link_order::LinkOrder;

/// Pause between two looks for the answer.
const PAUSE: Duration = Duration::from_micros(100);
/// So long the runtime may take.
const LIMIT: Duration = Duration::from_secs(1);

impl Bus {
    /// Has a link forcibly disconnected, or connected again. False where the link layer cannot do that; whoever has
    /// disconnected one has to connect it again. For one procedure at a time.
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
        // Fetched and not answered: it may still be carried out, and the answer is for nobody.
        self.shared.borrow_mut().link_order = LinkOrder::None;
        false
    }
}
