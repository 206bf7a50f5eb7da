//! The guide: from the first application to a drive with clocks. Its pages are those of `docs/guide/`.
//!
//! 1. [`first_application`]: links, scan, declaration, process data, OP
//! 2. [`drive_with_clocks`]: CiA 402 in cyclic synchronous position mode
//! 3. [`ring`]: two interfaces, what happens when a cable breaks
//! 4. [`mailbox`]: objects, files, IDNs, firmware
//! 5. [`several_threads`]: cycles in a thread of their own, services from any other
//! 6. [`testing`]: an application against the simulator, in its own CI
//! 7. [`known_places`]: offsets before activation, cycles in parts
//! 8. [`without_an_application`]: idle operation, states, mailboxes and rescans

// Of two definitions of a link the first one counts: in a page it leads to the file beside it, here to the module.
/// [a drive with clocks]: drive_with_clocks
///
#[doc = include_str!("../guide/first-application.md")]
pub mod first_application {}

#[doc = include_str!("../guide/drive-with-clocks.md")]
pub mod drive_with_clocks {}

#[doc = include_str!("../guide/ring.md")]
pub mod ring {}

#[doc = include_str!("../guide/mailbox.md")]
pub mod mailbox {}

#[doc = include_str!("../guide/several-threads.md")]
pub mod several_threads {}

#[doc = include_str!("../guide/testing.md")]
pub mod testing {}

#[doc = include_str!("../guide/known-places.md")]
pub mod known_places {}

#[doc = include_str!("../guide/without-an-application.md")]
pub mod without_an_application {}
