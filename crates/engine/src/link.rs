//! The MainDevice's network interfaces.

/// One of the two interfaces of a MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Link {
    /// The first interface, MAIN in docs/protocol: frames sent here reach the SubDevices in order.
    Main,
    /// The second interface, RED: closes the ring.
    Redundant,
}

impl Link {
    /// Both, in order.
    pub const ALL: [Link; 2] = [Link::Main, Link::Redundant];

    /// 0 or 1.
    pub const fn index(self) -> usize {
        match self {
            Link::Main => 0,
            Link::Redundant => 1,
        }
    }

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Link {
        match self {
            Link::Main => Link::Redundant,
            Link::Redundant => Link::Main,
        }
    }

    /// A mask with the bit of this link.
    pub(crate) const fn bit(self) -> u8 {
        1 << self.index()
    }
}

/// The interfaces of a MainDevice. The same code runs with one link and with two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkSet {
    /// The main link alone.
    Single,
    /// Main and redundant link.
    Ring,
}

impl LinkSet {
    /// The links of the set.
    pub const fn links(self) -> &'static [Link] {
        match self {
            LinkSet::Single => &[Link::Main],
            LinkSet::Ring => &Link::ALL,
        }
    }

    /// Bits of all links of the set.
    pub(crate) const fn mask(self) -> u8 {
        match self {
            LinkSet::Single => 1,
            LinkSet::Ring => 3,
        }
    }
}

/// An order to the link layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LinkOrder {
    /// The link.
    pub link: Link,
    /// Disconnect it; otherwise reconnect it.
    pub disconnect: bool,
}

impl core::fmt::Display for Link {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Link::Main => "MAIN",
            Link::Redundant => "REDUNDANT",
        })
    }
}
