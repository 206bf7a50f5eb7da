//! Rules: the effects of observations.

mod breaks;
mod clocks;
mod crossings;
mod findings;
mod fit;
mod group_matching;
mod idle;
mod matches;
mod members;
mod neighbours;
mod observe;
mod pdos;
mod ports;
mod recabling;
#[cfg(feature = "standby")]
mod roles;
mod silence;
mod stages;
mod unassigned;
mod undeclared;
