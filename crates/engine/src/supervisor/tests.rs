//! Supervisor tests.
