//! Results of attempts to reach a requested state, for the procedures that wait for them. They are beside the model:
//! their errors contain data that only procedures have, and the model does not depend on them.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use super::configure::ConfigureError;

type AttemptResult = Result<(), ConfigureError>;

/// The number of an attempt that has ended, and its result.
type Ended = Option<(u32, AttemptResult)>;

/// The last attempt of each member that has ended, by index.
#[derive(Clone, Debug, Default)]
pub(crate) struct AttemptResults(Rc<RefCell<Vec<Ended>>>);

impl AttemptResults {
    /// An attempt has ended.
    pub fn end(&self, index: usize, attempt: u32, result: AttemptResult) {
        let mut all = self.0.borrow_mut();
        if all.len() <= index {
            all.resize(index + 1, None);
        }
        all[index] = Some((attempt, result));
    }

    /// The result of an attempt, if it is the last one that has ended.
    pub fn of(&self, index: usize, attempt: u32) -> Option<AttemptResult> {
        let all = self.0.borrow();
        let (ended, result) = all.get(index)?.as_ref()?;
        (*ended == attempt).then(|| result.clone())
    }
}
