//! RingCAT.
