//! A crate that uses std, for the counter-proof: linked into the program beside it, it must break the build.

/// Something that only std has.
pub fn now() -> std::time::Instant {
    std::time::Instant::now()
}
