//! Procedures under way, and how they are named.

use alloc::boxed::Box;
use core::future::Future;
use core::pin::Pin;

/// A procedure under way.
pub(crate) type Task = Pin<Box<dyn Future<Output = ()>>>;

/// Place of a task in the table. Places are re-used: waking a place whose task has ended polls another task once more
/// than needed, which every future here tolerates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TaskId(pub u32);
