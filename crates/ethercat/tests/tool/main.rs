//! The tool beside a daemon and an application, on simulated segments.
//!
//! `golden` and `real_outputs` compare with outputs of the original tool, where they are there; all others have
//! the expected text here.

mod bench;
mod beside;
mod dot;
mod events;
mod golden;
mod golden_bus;
mod gone;
mod hostile;
mod idle;
mod json;
mod operation;
mod outputs;
mod real_bus;
mod real_details;
mod real_outputs;
mod real_xml;
mod record;
mod ring_and_clocks;
mod several;
mod shells;
mod siis;
mod situations;
mod standalone;
mod terminal;
