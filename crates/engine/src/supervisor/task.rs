//! Running procedures, and their ids.

use alloc::boxed::Box;
use core::future::Future;
use core::pin::Pin;

/// A running procedure.
pub(crate) type Task = Pin<Box<dyn Future<Output = ()>>>;

/// Index of a task in the table. Indices are reused: a late wake-up of an ended task may poll its successor once more
/// than needed, which every future of the engine tolerates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TaskId(pub u32);
