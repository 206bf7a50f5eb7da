//! Starts work on a SubDevice in the engine.

use std::future::Future;
use std::time::Duration;

use ringcat_engine::ConfigureError;
use ringcat_engine::mail::{Mailbox, MailboxError};
use ringcat_engine::main_device::{Address, Function, MainDevice as Engine, Pending, Permission};
use ringcat_wire::al::AlState;

use super::error::{SubDeviceError, SubDeviceFailure};
use super::name::SubDeviceName;
use super::resolve::check;

/// Starts work on a SubDevice; errors contain its name.
pub(super) fn start<T, E, W>(
    engine: &mut Engine,
    address: Address,
    within: Option<Duration>,
    work: impl FnOnce(&mut Engine) -> W,
) -> Pending<Result<T, SubDeviceError>>
where
    T: 'static,
    SubDeviceFailure: From<E>,
    W: Future<Output = Result<T, E>> + 'static,
{
    let subdevice = SubDeviceName::of(engine, address);
    let bus = engine.bus();
    let work = check(engine, address).map(|()| work(engine));
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
    within: Option<Duration>,
    work: impl FnOnce(Mailbox) -> W + 'static,
) -> Pending<Result<T, SubDeviceError>>
where
    T: 'static,
    SubDeviceFailure: From<E>,
    W: Future<Output = Result<T, E>> + 'static,
{
    start::<T, SubDeviceFailure, _>(engine, address, within, move |engine| {
        let mailbox = reach(engine, address);
        async move {
            let (mailbox, request) = mailbox?;
            if let Some(request) = request {
                request.ended().await?;
            }
            Ok(work(mailbox).await?)
        }
    })
}

/// A mailbox, and the procedure that brings its SubDevice to PREOP first.
type Reached = (Mailbox, Option<Pending<Result<(), ConfigureError>>>);

/// The mailbox of a SubDevice. One without a declaration is brought to PREOP if its mailbox is not in use.
fn reach(engine: &mut Engine, address: Address) -> Result<Reached, SubDeviceFailure> {
    let is_open = engine.mailbox(address).is_some_and(|mailbox| mailbox.is_open());
    let has_none = || engine.info(address).is_some_and(|info| info.mailbox.is_none() && info.bootstrap.is_none());
    if !is_open && has_none() {
        return Err(SubDeviceFailure::NoMailbox);
    }
    // Where no state can be requested, the refusal of the mail names the reason.
    let may_request = engine.permission(Function::SubDeviceState) == Permission::Allowed;
    let is_wanted = !is_open && !engine.is_declared(address) && may_request;
    let request = is_wanted.then(|| engine.start_state_request(address, AlState::PreOp));
    let mailbox = engine.mailbox(address).ok_or(MailboxError::Closed)?;
    Ok((mailbox, request))
}
