//! Limits of a file. An ENI within these limits takes bounded time and memory; exceeding a limit is an error.

/// Bytes of a file. An ENI takes about 40 KiB per servo drive: the limit is sufficient for more than a thousand drives.
pub const MAX_BYTES: usize = 64 << 20;
/// XML nodes (elements and texts) of a file.
pub const MAX_NODES: u32 = 6_000_000;
/// Nested levels of elements; an ENI has about ten.
pub const MAX_DEPTH: usize = 64;
/// Attributes of one element, and namespaces of a file.
pub const MAX_ATTRIBUTES: usize = 64;
/// SubDevices of a segment: there are 65,535 station addresses.
pub const MAX_SUBDEVICES: usize = 65_535;
/// Unknown elements that are listed; further elements are only counted.
pub const MAX_UNKNOWN: usize = 100;
