//! Ring and standby marks in the source MAC address (facts 9.7).
