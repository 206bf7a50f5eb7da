//! SII images.
