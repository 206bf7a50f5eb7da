//! The EtherCAT state machine as the wire shows it: states, AL control, AL status, status codes (facts 5).
