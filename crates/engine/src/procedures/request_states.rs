//! A state of all SubDevices, requested by the application, with a time limit.
//!
//! Each SubDevice gets a request of its own and takes its own path; those that lose frames or power meanwhile follow
//! when the supervision has brought them back, as long as the limit permits it.

mod error;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::future::Future;
use core::pin::Pin;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;

pub use error::{NotFollowed, NotFollowedReason, StatesError};

use super::al_state::read_status;
use super::configure::ConfigureError;
use super::recover::is_of_bus;
use super::request_state::request_state;
use super::shared_segment::SharedSegment;
use super::undeclared::{self, until_decided};
use crate::declared::{Address, SubDeviceId};
use crate::segment::SubDeviceKey;
use crate::segment::member::{Member, Phase};
use crate::supervisor::Bus;

/// Which SubDevices must follow a state that is requested of all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StateScope {
    /// All; an optional one that is absent is not waited for.
    #[default]
    All,
    /// Those that are not optional. The state is requested of the optional ones, too.
    Mandatory,
}

type Outcome = Result<(), NotFollowedReason>;

/// One SubDevice on its way.
struct Follower {
    subdevice: Address,
    station: StationAddress,
    /// It may be absent at the limit.
    optional: bool,
    outcome: Pin<Box<dyn Future<Output = Outcome>>>,
}

/// Requests the state of all declared SubDevices, or without a declaration of all SubDevices of the scan. Declared ones
/// go at most to their declared states; those in BOOT stay there. All requests begin at once, and are kept beyond the
/// limit.
pub(crate) fn request_states(
    bus: &Bus,
    segment: &SharedSegment,
    state: AlState,
    scope: StateScope,
    limit: Duration,
) -> impl Future<Output = Result<(), StatesError>> + use<> {
    let followers = match state {
        AlState::Boot => Err(StatesError::Boot),
        _ if segment.view().is_active() => Ok(members(segment, state, scope)),
        _ => scanned(segment, state),
    };
    let (bus, until) = (bus.clone(), bus.now() + limit);
    async move {
        let results = bus.gather(followers?, |bus, follower| async move {
            let Follower { subdevice, station, optional, outcome } = follower;
            let result = match bus.within(until.since(bus.now()), outcome).await {
                Ok(result) => result,
                Err(_) => at_the_limit(&bus, station, optional).await,
            };
            result.err().map(|reason| NotFollowed { subdevice, reason })
        });
        let not_followed: Vec<NotFollowed> = results.await.into_iter().flatten().collect();
        if not_followed.is_empty() {
            return Ok(());
        }
        Err(StatesError::NotFollowed { state, limit, subdevices: not_followed })
    }
}

/// The reason of a SubDevice that has not followed in time.
async fn at_the_limit(bus: &Bus, station: StationAddress, optional: bool) -> Outcome {
    match read_status(bus, station).await {
        Ok((status, code)) => Err(NotFollowedReason::Late { status, code }),
        Err(_) if optional => Ok(()),
        Err(_) => Err(NotFollowedReason::Absent),
    }
}

fn members(segment: &SharedSegment, state: AlState, scope: StateScope) -> Vec<Follower> {
    let count = segment.view().subdevices().member_count();
    let mut followers = Vec::with_capacity(count);
    for index in 0..count {
        let (goal, optional, station, in_boot) = {
            let view = segment.view();
            let Some(member) = view.member(index) else { continue };
            (goal(&member, state), member.config.optional, member.station, member.target == AlState::Boot)
        };
        let outcome: Pin<Box<dyn Future<Output = Outcome>>> = if in_boot {
            Box::pin(core::future::ready(Err(NotFollowedReason::InBoot)))
        } else {
            Box::pin(follow_member(segment.clone(), index, goal, request_state(segment, index, goal)))
        };
        let absent = segment.view().member(index).is_some_and(|member| member.phase == Phase::Absent);
        let counts = match scope {
            StateScope::All => !(optional && absent),
            StateScope::Mandatory => !optional,
        };
        if counts {
            followers.push(Follower { subdevice: SubDeviceId(index).into(), station, optional, outcome });
        }
    }
    followers
}

/// The state for one SubDevice: not above the declared one.
fn goal(member: &Member, state: AlState) -> AlState {
    let rank = |state: AlState| match state {
        AlState::Init => 0,
        AlState::PreOp | AlState::Boot => 1,
        AlState::SafeOp => 2,
        AlState::Op => 3,
    };
    if rank(member.config.target) < rank(state) { member.config.target } else { state }
}

async fn follow_member(
    segment: SharedSegment,
    index: usize,
    goal: AlState,
    request: impl Future<Output = Result<(), ConfigureError>>,
) -> Outcome {
    match request.await {
        Ok(()) => return Ok(()),
        Err(error) if is_passing(&error) => {}
        Err(error) => return Err(NotFollowedReason::Refused(error)),
    }
    let ready = |member: &Member| match member.phase {
        _ if member.target != goal => Some(Err(NotFollowedReason::Overtaken)),
        Phase::Settled(is) if is == goal => Some(Ok(())),
        Phase::Settled(_) | Phase::Configuring | Phase::Absent => None,
    };
    segment.until(|model| model.member(index).and_then(|member| ready(&member))).await
}

/// The request can be followed yet: frames were lost, or the SubDevice was, or a new attempt has begun.
fn is_passing(error: &ConfigureError) -> bool {
    is_of_bus(error) || matches!(error, ConfigureError::Absent | ConfigureError::Interrupted)
}

fn scanned(segment: &SharedSegment, state: AlState) -> Result<Vec<Follower>, StatesError> {
    let all: Vec<(SubDeviceKey, Position)> = {
        let view = segment.view();
        view.subdevices().unassigned().filter(|it| it.is_undeclared()).map(|it| (it.key, it.position)).collect()
    };
    if all.is_empty() {
        return Err(StatesError::NoSubDevices);
    }
    let follower = |(key, position): (SubDeviceKey, Position)| {
        let in_boot = segment.view().upkeep(key).is_some_and(|upkeep| upkeep.target == AlState::Boot);
        let outcome: Pin<Box<dyn Future<Output = Outcome>>> = if in_boot {
            Box::pin(core::future::ready(Err(NotFollowedReason::InBoot)))
        } else {
            let (request, segment) = (undeclared::request(segment, key, state), segment.clone());
            Box::pin(async move {
                match request.await {
                    Ok(()) => Ok(()),
                    Err(error) if is_passing(&error) => match until_decided(&segment, key, state).await {
                        true => Ok(()),
                        false => Err(NotFollowedReason::Overtaken),
                    },
                    Err(error) => Err(NotFollowedReason::Refused(error)),
                }
            })
        };
        Follower { subdevice: Address::Scanned(position), station: key.station, optional: false, outcome }
    };
    Ok(all.into_iter().map(follower).collect())
}
