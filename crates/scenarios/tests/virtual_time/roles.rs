//! Which functions are refused in which phase: the table of the engine against what it does (protocol 9.11).

use std::time::Duration;

use ringcat::{
    Acknowledge, AlState, Application, Declaration, EepromAssignment, Error, Function, MainDevice, MainDevicePhase,
    Options, Pending, Permission, Position, RawDatagram, RegisterAddress, ServiceError, Services, StateScope, Subjects,
};
use ringcat_engine::main_device::{ActivateError, MainDevice as Engine};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{LoopControl, map};
use scenarios::segments::{descriptions, line};
use scenarios::tap::Tap;
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

/// Whether a service was refused because of the phase.
fn refused<T>(result: &Result<T, ServiceError>) -> bool {
    matches!(result, Err(ServiceError::NotActive))
}

/// The answer of a call that needs no frame.
fn now(engine: &mut Engine, is_refused: bool) -> Pending<Result<bool, ServiceError>> {
    engine.start(async move { Ok(is_refused) })
}

/// The answer of a service.
fn later<T: 'static>(
    engine: &mut Engine,
    service: Pending<Result<T, ServiceError>>,
) -> Pending<Result<bool, ServiceError>> {
    engine.start(async move { Ok(refused(&service.ended().await)) })
}

/// Mail and states.
fn call_of_mail_and_states(engine: &mut Engine, function: Function) -> Option<Pending<Result<bool, ServiceError>>> {
    Some(match function {
        // These have no check of the phase: a SubDevice without an open mailbox fails.
        Function::SdoTransfer
        | Function::ObjectDictionary
        | Function::PdoByMailbox
        | Function::FileTransfer
        | Function::SoeAccess
        | Function::AoeAccess
        | Function::VendorMessage
        | Function::RawMailbox => {
            let _ = engine.mailbox(DRIVE);
            now(engine, false)
        }
        Function::Ethernet => {
            let _ = engine.ethernet_port(DRIVE);
            now(engine, false)
        }
        Function::SubDeviceState => {
            let _ = engine.start_state_request(DRIVE, AlState::PreOp);
            now(engine, false)
        }
        Function::StateOfAll => {
            let _ = engine.start_state_of_all(AlState::PreOp, StateScope::All, LIMIT);
            now(engine, false)
        }
        Function::ForcedState => {
            let service = engine.start_forced_state(DRIVE, AlState::Init, Acknowledge::No);
            later(engine, service)
        }
        _ => return None,
    })
}

/// Datagrams, registers, EEPROMs, ports.
fn call_of_registers(engine: &mut Engine, function: Function) -> Option<Pending<Result<bool, ServiceError>>> {
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
fn call_of_the_segment(engine: &mut Engine, function: Function) -> Option<Pending<Result<bool, ServiceError>>> {
    let at = engine.bus().now();
    Some(match function {
        Function::Scan => {
            let is_refused = matches!(engine.start_scan(), Err(ActivateError::Active));
            now(engine, is_refused)
        }
        Function::Rescan => {
            let service = engine.start_rescan(LIMIT);
            later(engine, service)
        }
        Function::ForceTopologyChange => {
            let is_refused = !engine.force_topology_change();
            now(engine, is_refused)
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
            let is_refused = matches!(engine.load(Declaration::with_period(CYCLE)), Err(ActivateError::Active));
            now(engine, is_refused)
        }
        Function::Deactivate => {
            let result = engine.start_deactivate(LIMIT, at);
            now(engine, refused(&result))
        }
        Function::Stop => {
            engine.start_stop(AlState::Init, LIMIT, at);
            now(engine, false)
        }
        Function::SubDeviceInfo => {
            let _ = engine.subdevices();
            now(engine, false)
        }
        Function::Status => {
            let _ = (engine.live_status(), engine.ring_status());
            now(engine, false)
        }
        Function::OwnObjects => {
            engine.relay(1, &[]);
            now(engine, false)
        }
        Function::Events => {
            let is_refused = engine.register_client(Subjects::ALL, 1).is_none();
            now(engine, is_refused)
        }
        Function::Settings => {
            engine.set_statistics_period(None);
            now(engine, false)
        }
        _ => return None,
    })
}

/// Calls a function; the result is whether it was refused because of the phase.
fn call(engine: &mut Engine, function: Function) -> Pending<Result<bool, ServiceError>> {
    let called = call_of_mail_and_states(engine, function)
        .or_else(|| call_of_registers(engine, function))
        .or_else(|| call_of_the_segment(engine, function));
    called.unwrap_or_else(|| panic!("{function:?} has no call here"))
}

// covers: 9.11
#[test]
fn each_function_is_refused_in_the_phases_of_the_table_and_in_no_other() {
    let mut count = 0;
    for function in Function::ALL.iter().copied() {
        for phase in [MainDevicePhase::Orphaned, MainDevicePhase::Idle] {
            let is_idle = phase == MainDevicePhase::Idle;
            let mut main_device = if is_idle { main_device() } else { orphaned() };
            assert_eq!(Services::phase(&mut main_device), phase);
            let allowed = main_device.permission(function);
            assert_eq!(allowed, function.permission(phase));
            let is_refused = Services::call(&mut main_device, move |engine| call(engine, function));
            let is_refused = is_refused.unwrap_or_else(|error| panic!("{function:?} in {phase:?}: {error}"));
            assert_eq!(is_refused, allowed == Permission::Refused, "{function:?} in {phase:?}");
            count += 1;
        }
        let mut application = application();
        let phase = Services::phase(&mut application);
        assert_eq!(phase, MainDevicePhase::Operation);
        let pending = call(application.engine_mut(), function);
        let is_refused = application.cycle_until(pending, Duration::from_secs(5), |_| ());
        let is_refused = is_refused.unwrap_or_else(|error| panic!("{function:?} in {phase:?}: {error}"));
        assert_eq!(is_refused, function.permission(phase) == Permission::Refused, "{function:?} in {phase:?}");
        count += 1;
    }
    assert_eq!(count, 3 * Function::ALL.len());
}
