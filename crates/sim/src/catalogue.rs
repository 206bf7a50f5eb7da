//! Devices out of the box.
