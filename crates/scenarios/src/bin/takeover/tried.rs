//! Results with a reason in words.

/// A result, or the reason why there is none.
pub type Tried<T> = Result<T, String>;

/// An error as a reason.
pub fn said(error: impl ToString) -> String {
    error.to_string()
}
