//! Observations without an application.

use alloc::rc::Rc;
use alloc::string::String;

use ringcat_wire::address::StationAddress;

use crate::ring::RingState;
use crate::segment::scan::Found;
use crate::segment::undeclared::StateRead;
use crate::segment::versions::Versions;
use crate::segment::words::Words;

/// An observation without an application. Answers of broadcasts are [`Words`].
#[derive(Debug)]
pub enum IdleObservation<'a> {
    /// Idle operation begins: its watches are started.
    Begun,
    /// The watch begins, with these carriers, by [`crate::link::Link::index`], and this state of the ring.
    Watched([Option<bool>; 2], RingState),
    /// A broadcast has got no answer, or none was sent because no link has a carrier.
    Unanswered(Words),
    /// The first scan has ended.
    Scanned,
    /// A rescan is requested.
    RescanAsked,
    /// The scan after a change has ended.
    Followed {
        /// Version of the model at its beginning.
        versions: Versions,
        /// The SubDevices.
        found: Rc<Found>,
        /// Number of the request that it answers.
        wanted: Option<u64>,
    },
    /// The scan after a change has failed; the reason, unless the segment has changed meanwhile.
    NotFollowed(Option<String>),
    /// The states of all SubDevices with a requested state were read.
    StatesRead(&'a [StateRead]),
    /// The states of some of them were read, beside a broadcast.
    SomeRead(&'a [StateRead]),
    /// The scan under way reads EEPROMs from now on; addresses for which it has found that no SubDevice, or several,
    /// have them.
    ReadingBegun(&'a [StationAddress]),
    /// The scan under way reads no further EEPROMs.
    ReadingEnded,
    /// The ring is about to be opened for a measurement: broadcasts show nothing of the segment until it has ended.
    Measuring,
    /// The measurement has ended.
    Measured,
    /// The end of an application begins: broadcasts are followed when it has ended.
    Deactivating,
    /// The end of an application has ended.
    Deactivated,
}
