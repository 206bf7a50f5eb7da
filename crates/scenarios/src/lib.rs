//! Engine and simulated segment put together in virtual time: [`world`] with its verbs, what it runs on ([`segments`],
//! [`tap`], [`dice`]) and, apart from the scenarios, what is checked ([`check`]). The scenarios are in `tests/`, one file
//! per theme.

pub mod check;
pub mod dice;
pub mod segments;
pub mod tap;
pub mod world;
