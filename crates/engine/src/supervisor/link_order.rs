//! What a procedure asks of the link layer itself, which is outside: to take a link down, and to bring it back.
//!
//! The runtime fetches the order ([`super::Supervisor::take_link_order`]), carries it out where it can, and says whether
//! it could. Nobody has to: an order that nobody fetches counts as refused.

use core::time::Duration;

use super::Bus;
use crate::link::Link;

/// Pause between two looks for the answer.
const PAUSE: Duration = Duration::from_micros(100);
/// So long the runtime may take.
const LIMIT: Duration = Duration::from_secs(1);

/// The order under way, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum LinkOrder {
    #[default]
    None,
    /// Nobody has fetched it yet.
    Given { link: Link, disconnect: bool },
    /// It is being carried out.
    Fetched,
    /// It was carried out or refused.
    Answered(bool),
}

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
