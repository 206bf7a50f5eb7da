//! Starts work on a SubDevice in the engine.

use std::future::Future;
use std::time::Duration;

use ringcat_engine::mail::{Mailbox, MailboxError};
use ringcat_engine::main_device::{Address, MainDevice as Engine, Pending};
use ringcat_engine::procedures::configure::ConfigureError;
use ringcat_wire::al::AlState;

use super::error::{SubDeviceError, SubDeviceFailure};
use super::name::SubDeviceName;
use super::resolve::{find, info};

/// Starts work on a SubDevice; errors contain its name.
pub(super) fn start<T, E, W>(
    engine: &mut Engine,
    address: Address,
    within: Option<Duration>,
    work: impl FnOnce(&mut Engine, usize) -> W,
) -> Pending<Result<T, SubDeviceError>>
where
    T: 'static,
    SubDeviceFailure: From<E>,
    W: Future<Output = Result<T, E>> + 'static,
{
    let subdevice = SubDeviceName::of(engine, address);
    let bus = engine.bus();
    let work = find(engine, address).map(|number| work(engine, number));
    engine.start(async move {
        let done = async { Ok(work?.await?) };
        let result = match within {
            None => done.await,
            Some(limit) => bus.within(limit, done).await.unwrap_or(Err(SubDeviceFailure::TimedOut { limit })),
        };
        result.map_err(|failure| SubDeviceError { subdevice, failure })
    })
}

/// Starts work in a SubDevice's mailbox.
pub(super) fn start_with_mailbox<T, E, W>(
    engine: &mut Engine,
    address: Address,
    opening: Opening,
    within: Option<Duration>,
    work: impl FnOnce(Mailbox) -> W + 'static,
) -> Pending<Result<T, SubDeviceError>>
where
    T: 'static,
    SubDeviceFailure: From<E>,
    W: Future<Output = Result<T, E>> + 'static,
{
    start::<T, SubDeviceFailure, _>(engine, address, within, move |engine, number| {
        let opening = if engine.is_declared(number) { Opening::LeftAlone } else { opening };
        let mailbox = reach(engine, number, opening);
        async move {
            let (mailbox, visit) = mailbox?;
            if let Some(visit) = visit {
                visit.ended().await?;
            }
            Ok(work(mailbox).await?)
        }
    })
}

/// Handling of a mailbox that is not in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opening {
    /// The SubDevice is brought to PREOP; for undeclared SubDevices.
    BringToPreOp,
    /// No action.
    LeftAlone,
}

impl Opening {
    pub(super) const fn of(address: Address) -> Opening {
        match address {
            Address::Scanned(_) => Opening::BringToPreOp,
            Address::Declared(_) => Opening::LeftAlone,
        }
    }
}

/// A mailbox, and the procedure that brings its SubDevice to PREOP first.
type Reached = (Mailbox, Option<Pending<Result<(), ConfigureError>>>);

fn reach(engine: &mut Engine, number: usize, opening: Opening) -> Result<Reached, SubDeviceFailure> {
    let is_open = engine.mailbox(number).is_some_and(|mailbox| mailbox.is_open());
    let has_none = || info(engine, number).is_some_and(|info| info.mailbox.is_none() && info.bootstrap.is_none());
    if !is_open && has_none() {
        return Err(SubDeviceFailure::NoMailbox);
    }
    let is_wanted = !is_open && opening == Opening::BringToPreOp;
    let visit = is_wanted.then(|| engine.start_visit(number, AlState::PreOp));
    let mailbox = engine.mailbox(number).ok_or(MailboxError::Closed)?;
    Ok((mailbox, visit))
}
