//! How much of a file is read. An ENI within these limits takes bounded time and memory, one beyond them is an error.

/// Bytes that a file may have. An ENI takes about 40 KiB per servo drive: this is room for more than a thousand.
pub const MAX_BYTES: usize = 64 << 20;
/// XML nodes (elements and texts) that a file may have.
pub const MAX_NODES: u32 = 6_000_000;
/// Levels of elements within each other; an ENI has about ten.
pub const MAX_DEPTH: usize = 64;
/// Attributes of one element, and namespaces of a whole file.
pub const MAX_ATTRIBUTES: usize = 64;
/// SubDevices of a segment: there are 65,535 station addresses.
pub const MAX_SUBDEVICES: usize = 65_535;
/// Unknown elements that are listed; the others are counted.
pub const MAX_UNKNOWN: usize = 100;
