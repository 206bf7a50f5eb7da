//! Which functions are refused in which phase: the table of the engine against what it does (protocol 9.11).

use std::future::Future;
use std::time::Duration;

use ringcat::{
    Acknowledge, ActivateError, AlState, AlStatus, Application, ConfigureError, Declaration, EepromAssignment,
    EngineKey, Error, Function, InformationError, Limits, ListType, Mailbox, MailboxError, MainDevice, MainDevicePhase,
    MainDeviceRole, NotPermitted, Options, Pending, Position, RawDatagram, RegisterAddress, SdoAddress, SdoFailure,
    ServiceError, Services, StateScope, StatesError, StopError, Subjects,
};
use ringcat_engine::mail::coe::pdo_mail::{self, PdoMailError};
use ringcat_engine::mail::coe::{self, information};
use ringcat_engine::mail::{Lane, raw};
use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{LoopControl, map};
use scenarios::segments::{descriptions, line};
use scenarios::tap::Tap;
use scenarios::witness::Witness;
use scenarios::world::CYCLE;

const KINDS: [&str; 3] = ["coupler", "all-protocols", "digital-input-8"];
/// The SubDevice that is used.
const DRIVE: Position = Position(1);
const LIMIT: Duration = Duration::from_millis(500);

fn main_device() -> MainDevice<Tap> {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
    main_device.attend(Duration::from_millis(400));
    main_device
}

/// Without idle operation the scan is kept while all links are down.
fn orphaned() -> MainDevice<Tap> {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    main_device.scan().expect("it is stable");
    main_device.subdevice(DRIVE).request_state(AlState::PreOp).expect("it follows");
    main_device.links_mut().network_mut().apply(Fault::Cut(CableId(0)));
    // Carriers are read at the beginning of each call.
    (0..2).for_each(|_| main_device.attend(Duration::from_millis(100)));
    main_device
}

fn application() -> Application<Tap> {
    let main_device = main_device();
    let declaration = ringcat::automatic(&main_device.subdevices(), CYCLE);
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    (0..500).for_each(|_| application.cycle(|_| ()));
    application
}

/// The refusal in the result of a service.
fn denial<T>(result: &Result<T, ServiceError>) -> Option<NotPermitted> {
    if let Err(ServiceError::NotPermitted(denied)) = result { Some(*denied) } else { None }
}

/// The refusal of a call, if it was refused.
type Answer = Pending<Result<Option<NotPermitted>, ServiceError>>;

/// The answer of a call that needs no frame.
fn now(engine: &mut Engine, denied: Option<NotPermitted>) -> Answer {
    engine.start(async move { Ok(denied) })
}

/// The answer of a call whose error does not name the refusal: of this function, in the present role.
fn unnamed(engine: &mut Engine, function: Function, is_refused: bool) -> Answer {
    let denied = function.check(engine.role(), engine.phase()).err().filter(|_| is_refused);
    assert_eq!(denied.is_some(), is_refused, "{function:?} is refused without a reason");
    now(engine, denied)
}

/// The answer of a service.
fn later<T: 'static>(engine: &mut Engine, service: Pending<Result<T, ServiceError>>) -> Answer {
    engine.start(async move { Ok(denial(&service.ended().await)) })
}

/// The answer of a conversation with a mailbox; others than refusals are errors of the mailbox.
fn mail<T, E: 'static>(
    engine: &mut Engine,
    work: impl Future<Output = Result<T, E>> + 'static,
    denied: fn(&E) -> Option<MailboxError>,
) -> Answer {
    engine.start(async move {
        match work.await.err().and_then(|error| denied(&error)) {
            Some(MailboxError::NotPermitted(denied)) => Ok(Some(denied)),
            _ => Ok(None),
        }
    })
}

/// Mail of each protocol.
fn call_of_mail(engine: &mut Engine, function: Function) -> Option<Answer> {
    let mailbox = engine.mailbox(DRIVE)?;
    let limit = Duration::from_millis(50);
    let limits = Limits::new(limit, limit);
    Some(match function {
        Function::SdoTransfer => {
            let work = async move { coe::read(&mailbox, SdoAddress::new(0x1018, 1), limits, 4).await };
            mail(engine, work, |error| if let SdoFailure::Mailbox(error) = error.cause { Some(error) } else { None })
        }
        Function::ObjectDictionary => {
            let work = async move { information::list(&mailbox, ListType::All, limits).await };
            mail(engine, work, |error| if let InformationError::Mailbox(error) = error { Some(*error) } else { None })
        }
        Function::PdoByMailbox => {
            let work = async move { pdo_mail::send(&mailbox, 0x1600, &[0], limit).await };
            mail(engine, work, |error| if let PdoMailError::Mailbox(error) = error { Some(*error) } else { None })
        }
        Function::FileTransfer => conversation(engine, mailbox, Lane::Foe),
        Function::SoeAccess => conversation(engine, mailbox, Lane::Soe),
        Function::AoeAccess => conversation(engine, mailbox, Lane::Aoe),
        Function::VendorMessage => conversation(engine, mailbox, Lane::Voe),
        Function::RawMailbox => {
            let work = async move { raw::send(&mailbox, Lane::Other(9), &[0; 4], limit).await };
            mail(engine, work, |error| Some(*error))
        }
        _ => return None,
    })
}

/// The beginning that all functions of a protocol have in common.
fn conversation(engine: &mut Engine, mailbox: Mailbox, lane: Lane) -> Answer {
    let work = async move { mailbox.conversation(lane).await };
    mail(engine, work, |error| Some(*error))
}

/// Ethernet and states.
fn call_of_states(engine: &mut Engine, function: Function) -> Option<Answer> {
    Some(match function {
        Function::Ethernet => {
            let is_refused = engine.role() == MainDeviceRole::Inactive && engine.ethernet_port(DRIVE).is_none();
            unnamed(engine, function, is_refused)
        }
        Function::SubDeviceState => {
            let request = engine.start_state_request(DRIVE, AlState::PreOp);
            if engine.role() == MainDeviceRole::Active {
                return Some(now(engine, None));
            }
            engine.start(async move {
                Ok(if let Err(ConfigureError::NotPermitted(denied)) = request.ended().await {
                    Some(denied)
                } else {
                    None
                })
            })
        }
        Function::StateOfAll => {
            let request = engine.start_state_of_all(AlState::PreOp, StateScope::All, LIMIT);
            if engine.role() == MainDeviceRole::Active {
                return Some(now(engine, None));
            }
            engine.start(async move {
                Ok(if let Err(StatesError::NotPermitted(denied)) = request.ended().await { Some(denied) } else { None })
            })
        }
        Function::ForcedState => {
            let service = engine.start_forced_state(DRIVE, AlState::Init, Acknowledge::No);
            later(engine, service)
        }
        _ => return None,
    })
}

/// Datagrams, registers, EEPROMs, ports.
fn call_of_registers(engine: &mut Engine, function: Function) -> Option<Answer> {
    Some(match function {
        Function::RawDatagrams => {
            let read = RawDatagram::new(Command::Brd, Target::Broadcast(map::TYPE), vec![0]);
            let service = engine.start_datagrams(vec![read]);
            later(engine, service)
        }
        Function::DebugMessage => {
            let service = engine.start_debug_message(0x88B5, b"text");
            later(engine, service)
        }
        Function::Registers => {
            let service = engine.start_register_read(DRIVE, RegisterAddress(0), 1);
            later(engine, service)
        }
        Function::Eeprom => {
            let service = engine.start_sii_read(DRIVE);
            later(engine, service)
        }
        Function::EepromOwner => {
            let service = engine.start_eeprom_assignment(DRIVE, EepromAssignment::Force);
            later(engine, service)
        }
        Function::ControllerReset => {
            let service = engine.start_reset(DRIVE);
            later(engine, service)
        }
        Function::PortReport => {
            let service = engine.start_port_report();
            later(engine, service)
        }
        Function::Statistics => {
            let service = engine.start_statistics_read(DRIVE);
            later(engine, service)
        }
        Function::SiiCompletion => {
            let service = engine.start_sii_completion();
            later(engine, service)
        }
        _ => return None,
    })
}

/// The segment as a whole, and functions without frames.
fn call_of_the_segment(engine: &mut Engine, function: Function) -> Option<Answer> {
    let at = engine.bus().now();
    Some(match function {
        Function::Scan => {
            let denied = of_activation(engine.start_scan());
            now(engine, denied)
        }
        Function::Rescan => {
            let service = engine.start_rescan(LIMIT);
            later(engine, service)
        }
        Function::ForceTopologyChange => {
            let is_refused = !engine.force_topology_change();
            unnamed(engine, function, is_refused)
        }
        Function::PortState => {
            let service = engine.start_port_set(DRIVE, 3, LoopControl::default());
            later(engine, service)
        }
        Function::BlockedPorts => {
            let service = engine.start_open_blocked();
            later(engine, service)
        }
        Function::Activate => {
            let denied = of_activation(engine.load(Declaration::new(CYCLE)));
            now(engine, denied)
        }
        Function::Deactivate => {
            let result = engine.start_deactivate(LIMIT, at);
            now(engine, denial(&result))
        }
        Function::Stop => {
            engine.start_stop(AlState::Init, LIMIT, at);
            let result = engine.stop_result();
            let denied = if let Some(Err(StopError::NotPermitted(denied))) = result { Some(denied) } else { None };
            now(engine, denied)
        }
        Function::SubDeviceInfo => {
            let is_refused = engine.subdevices().is_empty() && engine.info(DRIVE).is_none();
            unnamed(engine, function, is_refused)
        }
        Function::Status => {
            let _ = (engine.live_status(), engine.ring_status());
            now(engine, None)
        }
        Function::OwnObjects => {
            engine.relay(1, &[]);
            now(engine, None)
        }
        Function::Events => {
            let is_refused = engine.register_client(Subjects::ALL, 1).is_none();
            unnamed(engine, function, is_refused)
        }
        Function::Settings => {
            engine.set_statistics_period(None);
            now(engine, None)
        }
        _ => return None,
    })
}

/// What only an INACTIVE may do.
fn call_of_an_inactive(engine: &mut Engine, function: Function) -> Option<Answer> {
    if function != Function::Follow {
        return None;
    }
    let known = main_device().knowledge().expect("it has scanned");
    let denied = of_activation(engine.follow(Declaration::new(CYCLE), known, 1));
    Some(now(engine, denied))
}

fn of_activation<T>(result: Result<T, ActivateError>) -> Option<NotPermitted> {
    if let Err(ActivateError::NotPermitted(denied)) = result { Some(denied) } else { None }
}

/// Calls a function; the result is its refusal, if it was refused.
fn call(engine: &mut Engine, function: Function) -> Answer {
    let called = call_of_mail(engine, function)
        .or_else(|| call_of_states(engine, function))
        .or_else(|| call_of_registers(engine, function))
        .or_else(|| call_of_the_segment(engine, function))
        .or_else(|| call_of_an_inactive(engine, function));
    called.unwrap_or_else(|| panic!("{function:?} has no call here"))
}

/// The refusal is the one of the table, and names the function.
fn evaluate(denied: Option<NotPermitted>, function: Function, role: MainDeviceRole, phase: MainDevicePhase) {
    assert_eq!(denied, function.check(role, phase).err(), "{function:?} in {role}, {phase:?}");
}

const ROLES: [MainDeviceRole; 2] = [MainDeviceRole::Active, MainDeviceRole::Inactive];

// covers: 9.11
#[test]
fn each_function_is_refused_in_the_roles_and_phases_of_the_table_and_in_no_other() {
    let mut count = 0;
    for (role, function) in ROLES.into_iter().flat_map(|role| Function::ALL.iter().map(move |it| (role, *it))) {
        for phase in [MainDevicePhase::Orphaned, MainDevicePhase::Idle] {
            let is_idle = phase == MainDevicePhase::Idle;
            let mut main_device = if is_idle { main_device() } else { orphaned() };
            Services::set_role(&mut main_device, role);
            assert_eq!((Services::role(&mut main_device), Services::phase(&mut main_device)), (role, phase));
            assert_eq!(main_device.permission(function), function.permission(role, phase));
            let denied = Services::call(&mut main_device, EngineKey, move |engine| call(engine, function));
            let denied = denied.unwrap_or_else(|error| panic!("{function:?} in {phase:?}: {error}"));
            evaluate(denied, function, role, phase);
            count += 1;
        }
        let mut application = application();
        let phase = Services::phase(&mut application);
        assert_eq!(phase, MainDevicePhase::Operation);
        application.engine_mut().set_role(role);
        // INACTIVE ends the application.
        let phase = application.engine_mut().phase();
        let pending = call(application.engine_mut(), function);
        let denied = application.cycle_until(pending, Duration::from_secs(5), |_| ());
        let denied = denied.unwrap_or_else(|error| panic!("{function:?} in {phase:?}: {error}"));
        evaluate(denied, function, role, phase);
        count += 1;
    }
    assert_eq!(count, 6 * Function::ALL.len());
}

// covers: 9.11
#[test]
fn role_inactive_sends_nothing_for_a_call_and_all_work_again_when_it_is_active() {
    let (links, frames) = Witness::new(Tap::new(line(descriptions(&KINDS), NetworkOptions::default())));
    let mut main_device = MainDevice::request(links, &Options::default());
    main_device.scan().expect("it is stable");
    main_device.subdevice(DRIVE).request_state(AlState::PreOp).expect("it follows");
    main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect("it answers");
    // The polls of a mailbox in use end with it.
    main_device.attend(LIMIT);
    for function in Function::ALL.iter().copied().filter(|function| function.needs_the_bus()) {
        Services::set_role(&mut main_device, MainDeviceRole::Inactive);
        frames.take();
        let denied =
            Services::call(&mut main_device, EngineKey, move |engine| call(engine, function)).expect("it is answered");
        evaluate(denied, function, MainDeviceRole::Inactive, MainDevicePhase::Idle);
        main_device.attend(Duration::from_millis(20));
        let sent = frames.take().into_iter().filter(|passed| passed.is_sent).count();
        assert_eq!(sent, 0, "{function:?}");
        Services::set_role(&mut main_device, MainDeviceRole::Active);
        let states = main_device.subdevice(DRIVE).state().expect("it answers").status;
        assert_eq!(states, AlStatus::new(AlState::PreOp), "{function:?} has changed nothing");
        main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect("it answers");
        main_device.attend(LIMIT);
    }
    Services::set_role(&mut main_device, MainDeviceRole::Inactive);
    let error = main_device.subdevice(DRIVE).sdo_read::<u32>(0x1018, 1).expect_err("it is refused");
    let text = error.to_string();
    assert!(text.contains("SdoTransfer is refused in role INACTIVE: it needs the bus"), "{text}");
}
