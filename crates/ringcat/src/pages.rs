//! Pages of `docs` besides the guide: their examples are compiled, and run where they need no interface.

#[doc = include_str!("../../../docs/eni.md")]
mod eni {}

#[doc = include_str!("../../../docs/network-file.md")]
mod network_file {}

#[doc = include_str!("../../../docs/standby.md")]
mod standby {}
