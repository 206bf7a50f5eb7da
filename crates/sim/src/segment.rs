//! Segments from files.
