//! Pages of `docs` besides the guide, which is in the package `ringcat`: their examples are compiled.

#[doc = include_str!("../../../docs/eni.md")]
mod eni {}

#[doc = include_str!("../../../docs/network-file.md")]
mod network_file {}

#[doc = include_str!("../../../docs/standby.md")]
mod standby {}
