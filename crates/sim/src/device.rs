//! A SubDevice.
