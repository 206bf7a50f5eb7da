//! Handles of the live status, which any thread may read.

use ringcat_engine::main_device::{Address, LiveStatus, SubDeviceId, SubDeviceStatus};

use crate::application::Application;
use crate::links::Links;
use crate::observer::Observer;
use crate::services::Services;
use crate::services::key::EngineKey;
use crate::subdevice::SubDevice;

/// The live status of one declared SubDevice, for any thread.
///
/// ```
/// use ringcat::{LiveSubDevice, ProcessData};
///
/// /// In the cyclic thread: enables the axis only while the drive is in OP and processes all its process data.
/// fn may_move(drive: &LiveSubDevice) -> bool {
///     let status = drive.status();
///     status.operational && status.wkc.is_complete()
/// }
/// ```
#[derive(Clone, Debug)]
pub struct LiveSubDevice {
    all: LiveStatus,
    subdevice: SubDeviceId,
}

impl LiveSubDevice {
    /// Its state now.
    pub fn status(&self) -> SubDeviceStatus {
        self.all.subdevice(self.subdevice).unwrap_or_default()
    }

    /// The SubDevice.
    pub fn id(&self) -> SubDeviceId {
        self.subdevice
    }
}

impl<L: Links, H> Application<L, H> {
    /// State of the segment, of the links and of each declared SubDevice, for real-time threads: a handle that can be
    /// copied to any thread.
    ///
    /// ```
    /// use ringcat::{AcyclicHalf, Application, Link, Links, SubDeviceId};
    ///
    /// fn show<L: Links, H: AcyclicHalf>(application: &Application<L, H>) {
    ///     let live = application.live_status();
    ///     std::thread::spawn(move || {
    ///         let segment = live.segment();
    ///         println!("{} SubDevices respond; MAIN up: {}", segment.responding, live.link(Link::Main).is_up());
    ///         println!("the first one: {:?}", live.subdevice(SubDeviceId(0)));
    ///     });
    /// }
    /// ```
    pub fn live_status(&self) -> LiveStatus {
        self.live_status.clone()
    }

    /// A handle for other threads: snapshots of the process data, FMMUs, figures of the links.
    pub fn observer(&self) -> Observer {
        Observer::new(self.cyclic.observed.clone())
    }
}

impl<S: Services> SubDevice<S> {
    /// The live status of a declared SubDevice, for any thread; `None` before activation, and for a SubDevice that is
    /// not declared.
    pub fn live_status(self) -> S::Immediate<Option<LiveSubDevice>> {
        let (address, services) = self.into_parts();
        services.immediately(EngineKey, move |engine| {
            let all = engine.live_status();
            let Address::Declared(subdevice) = address else { return None };
            (subdevice.0 < all.subdevice_count()).then_some(LiveSubDevice { all, subdevice })
        })
    }
}
