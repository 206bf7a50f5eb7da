//! Disconnects a link for a procedure, and reconnects it.

use core::future::poll_fn;
use core::task::Poll;
use core::time::Duration;

use super::Bus;
use crate::link::Link;
use crate::supervisor::link_order::LinkOrder;

/// Time limit of the runtime.
const LIMIT: Duration = Duration::from_secs(1);

impl Bus {
    /// Disconnects or reconnects a link. False if the link layer cannot do that. The procedure that disconnected a link
    /// must reconnect it. For one procedure at a time.
    pub async fn force_disconnect(&self, link: Link, disconnect: bool) -> bool {
        self.shared.borrow_mut().link_order = LinkOrder::Given { link, disconnect };
        let answered = poll_fn(|_| {
            let shared = &mut *self.shared.borrow_mut();
            if let LinkOrder::Answered(done) = shared.link_order {
                return Poll::Ready(done);
            }
            shared.awaits_link = Some(shared.current);
            Poll::Pending
        });
        // If the order was fetched but not answered, it may still be carried out, and its answer is dropped.
        let done = self.within(LIMIT, answered).await.unwrap_or(false);
        self.shared.borrow_mut().link_order = LinkOrder::None;
        done
    }
}
