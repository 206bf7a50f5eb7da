//! A state for one SubDevice while the others go on: the application's wish, kept until it has another one.
//!
//! The SubDevice goes there by the shortest way, its process data ends or begins at once and not by halves, and nobody
//! misses it meanwhile. A SubDevice that loses its power comes back to the state that was asked for last. One that refuses
//! is brought back to the state that it had.

use alloc::rc::Rc;
use alloc::string::ToString;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::al::AlState;

use super::configure::{BringUp, ConfigureError, Start};
use super::fleet::{Fleet, Phase, Setup, SharedFleet};
use super::recover::{bring_up, failure, is_of_bus, keep_up, no_setup, while_current};
use super::scan::read_one;
use super::sii::{self, SiiCache};
use crate::event::Event;
use crate::supervisor::Bus;

/// Pause between two looks whether the SubDevice is there.
const PAUSE: Duration = Duration::from_micros(500);

/// Whether process data may flow in a state.
pub(crate) const fn exchanges(state: AlState) -> bool {
    matches!(state, AlState::SafeOp | AlState::Op)
}

/// Brings a SubDevice to a state. The work goes on where nobody waits for the result.
pub(crate) fn request_state(
    bus: &Bus,
    fleet: &SharedFleet,
    index: usize,
    state: AlState,
) -> impl Future<Output = Result<(), ConfigureError>> + use<> {
    let (bus, fleet) = (bus.clone(), fleet.clone());
    let result = Rc::new(RefCell::new(None));
    let attempt = match check(&fleet, index, state) {
        Ok(()) => begin(&bus, &fleet, index, state, &result),
        Err(error) => {
            *result.borrow_mut() = Some(Err(error));
            0
        }
    };
    async move {
        loop {
            if let Some(result) = result.borrow_mut().take() {
                return result;
            }
            if fleet.attempt(index) != attempt {
                return Err(ConfigureError::Interrupted);
            }
            bus.sleep(PAUSE).await;
        }
    }
}

/// What can be refused before anything happens.
fn check(fleet: &SharedFleet, index: usize, state: AlState) -> Result<(), ConfigureError> {
    let access = fleet.access();
    let member = access.members.get(index).ok_or(ConfigureError::NoSetup)?;
    match &member.setup {
        Some(setup) if state == AlState::Boot && setup.plan.bootstrap.is_empty() => Err(ConfigureError::NoBoot),
        None if member.unfit.is_some() => Err(no_setup(member)),
        Some(_) | None => Ok(()),
    }
}

type Slot = Rc<RefCell<Option<Result<(), ConfigureError>>>>;

/// Returns the number of the attempt.
fn begin(bus: &Bus, fleet: &SharedFleet, index: usize, state: AlState, result: &Slot) -> u32 {
    let before = fleet.set_target(index, state).unwrap_or(state);
    match fleet.phase(index) {
        Phase::Absent => {
            fleet.board.set_excused(index, !fleet.exchanges(index, state));
            *result.borrow_mut() = Some(Err(ConfigureError::Absent));
            return fleet.attempt(index);
        }
        Phase::Settled(is) if is == state => {
            *result.borrow_mut() = Some(Ok(()));
            return fleet.attempt(index);
        }
        // On the way up it is excused until it is there.
        Phase::Settled(_) | Phase::Configuring if fleet.exchanges(index, state) => {}
        Phase::Settled(_) | Phase::Configuring => fleet.board.set_excused(index, true),
    }
    fleet.set_phase(index, Phase::Configuring);
    let attempt = fleet.next_attempt(index);
    let (bus, fleet, result) = (bus.clone(), fleet.clone(), result.clone());
    bus.clone().spawn(async move {
        let procedure = go(&bus, &fleet, index, before, &result);
        while_current(&fleet, index, attempt, procedure).await;
    });
    attempt
}

async fn go(bus: &Bus, fleet: &SharedFleet, index: usize, before: AlState, result: &Slot) {
    match travel(bus, fleet, index, before).await {
        Ok(state) => {
            fleet.set_phase(index, Phase::Settled(state));
            fleet.board.set_excused(index, !fleet.exchanges(index, state));
            bus.report(Event::StateReached { subdevice: index, state });
            *result.borrow_mut() = Some(Ok(()));
        }
        Err(error) => {
            bus.report(failure(index, &error));
            // One that the frames did not reach has refused nothing.
            if !is_of_bus(&error) {
                fleet.set_target(index, before);
                fleet.board.set_excused(index, !fleet.exchanges(index, before));
            }
            *result.borrow_mut() = Some(Err(error));
            keep_up(bus.clone(), fleet.clone(), index, Start::Unknown, None).await;
        }
    }
}

async fn travel(bus: &Bus, fleet: &SharedFleet, index: usize, before: AlState) -> Result<AlState, ConfigureError> {
    if before == AlState::Boot {
        let to_init = BringUp { target: AlState::Init, ..bring_up(bus, fleet, index)? };
        to_init.run(Start::Unknown).await?;
        read_again(bus, fleet, index).await;
    }
    let bring_up = bring_up(bus, fleet, index)?;
    bring_up.travel().await.map(|()| bring_up.target)
}

/// The SII may be another one since: after a boot loader, or where one that could not be followed was mended. One that
/// cannot be read leaves everything as it was.
pub(super) async fn read_again(bus: &Bus, fleet: &SharedFleet, index: usize) {
    let Some(known) = fleet.access().members.get(index).and_then(|member| member.info.clone()) else { return };
    let read = async {
        sii::claim(bus, known.station).await?;
        // What was read before says nothing about what is there now.
        read_one(bus, known.position, known.station, &SiiCache::new(false)).await
    };
    let info = match read.await {
        // The reason was told.
        Ok(info) if info.is_blank() => return,
        Ok(mut info) => {
            info.keep_read_online(&known);
            info
        }
        Err(error) => return bus.report(Event::ScanFailed { reason: error.to_string() }),
    };
    let mut access = fleet.access();
    let Fleet { members, layout, .. } = &mut *access;
    let Some(member) = members.get_mut(index) else { return };
    match Setup::new(index, &member.config, &info, layout) {
        Ok(setup) => {
            if member.unfit.take().is_some() && setup.plan.mapped_areas().count() > setup.process_data_fmmus() {
                let what =
                    "its SII can be followed now: it has no place in the process image before the next activation";
                bus.report(Event::PlanOddity { subdevice: index, what: what.to_string() });
            }
            member.setup = Some(Rc::new(setup));
            member.info = Some(info);
        }
        // As before.
        Err(_) if member.unfit.is_some() => {}
        Err(error) => bus.report(Event::ConfigurationFailed { subdevice: index, reason: error.to_string() }),
    }
}
