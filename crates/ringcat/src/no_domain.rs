//! The error for a domain that is not declared.

use std::fmt;

use ringcat_engine::domain::DomainId;

/// The declaration has no such domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NoDomain {
    /// The number that was given.
    pub domain: DomainId,
    /// Number of declared domains.
    pub declared: usize,
}

impl fmt::Display for NoDomain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "domain {}: not declared: the declaration has {} domains, from 0", self.domain, self.declared)
    }
}

impl std::error::Error for NoDomain {}
