//! Public error types of the library implement `Error`, so that `?` converts them into `Box<dyn Error>`.
//!
//! Input: the tree. Output: a finding for each public struct or enum in the list of public items ([`crate::handed_on`])
//! whose name is that of an error and that has no `impl Error`.

use std::collections::BTreeSet;

use crate::Finding;
use crate::handed_on;
use crate::interface::LIST;
use crate::tree::Tree;

/// Ends of the names of error types.
const ENDS: [&str; 8] = ["Error", "Failure", "Refused", "Panicked", "NotReady", "NotLocked", "NoDomain", "DoesNotFit"];

/// Error types without the trait.
pub fn without_trait(tree: &Tree) -> Result<Vec<Finding>, Finding> {
    Ok(in_items(&handed_on::items(tree)?))
}

fn in_items(items: &[String]) -> Vec<Finding> {
    let named: BTreeSet<&str> = items.iter().filter_map(|item| error_type(item)).collect();
    let implemented: BTreeSet<&str> = items.iter().filter_map(|item| implementor(item)).collect();
    let missing = named.difference(&implemented);
    missing.map(|name| Finding::new(LIST, 0, format!("{name} does not implement Error"))).collect()
}

/// The name in a line `MODULE: pub struct NAME...`, if it is that of an error. Lines of members have more parts.
fn error_type(item: &str) -> Option<&str> {
    let [_, signature] = item.split(": ").collect::<Vec<_>>()[..] else { return None };
    let name = signature.strip_prefix("pub struct ").or(signature.strip_prefix("pub enum "))?;
    let name = name.split(|c: char| !c.is_alphanumeric()).next()?;
    ENDS.iter().any(|end| name.ends_with(end)).then_some(name)
}

/// The type in a line `MODULE: impl ... Error for NAME`.
fn implementor(item: &str) -> Option<&str> {
    let (before, after) = item.split_once(" for ")?;
    let is_error = before.contains(": impl") && before.ends_with("Error") && !before.ends_with(">");
    is_error.then(|| after.split(|c: char| !c.is_alphanumeric()).next()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_without_the_trait_is_found() {
        let items = [
            "a: pub enum OneError",
            "a: impl fmt::Display for OneError",
            "a: impl From<OneError> for TwoError",
            "b::c: pub struct TwoError",
            "b::c: impl std::error::Error for TwoError",
            "b::c: pub struct Three<T>: pub failure: RequestFailure",
            "d: pub struct Refused<M>",
            "d: impl<M> StdError for Refused<M>",
            "lib: pub use e::FourError",
        ];
        let found = in_items(&items.map(str::to_owned));
        assert_eq!(found, [Finding::new(LIST, 0, "OneError does not implement Error")]);
    }
}
