//! Compares the declaration with the scan, and builds domains and members from it.

use alloc::collections::BTreeSet;
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Position;
use ringcat_wire::al::AlState;
use ringcat_wire::datagram::MAX_DATA;
use ringcat_wire::register::{WatchdogDivider, WatchdogTime};

use super::activate_error::ActivateError;
use crate::config::{ConfigError, Resolution, SubDeviceConfig, can_be_head, groups, resolve};
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::info::SubDeviceInfo;
use crate::layout::{AreaSpec, DomainSpec, ImageOrder, Layout, LrwPolicy, Witness};
use crate::link::LinkSet;
use crate::main_device::declaration::areas::{Areas, Declared};
use crate::main_device::declaration::registered;
use crate::main_device::declaration::registered_area::RegisteredArea;
use crate::main_device::declaration::{Declaration, DomainConfig, MAX_UNDER_WAY, Required};
use crate::plan::{PlanError, PlanFault, PlanProblem, SubDevicePlan, plan};
use crate::procedures::request_state::exchanges;
use crate::procedures::scan::station_at;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::findings::{DeclarationFinding, SettingFinding};
use crate::segment::member::MemberView;
use crate::segment::setup::{Setup, SetupError, declared_areas, planned_areas, presence};
use crate::segment::{Found, Observation, Owners, SubDevice, SubDevices};

/// Period of the domain that only carries the supervision datagram.
const SUPERVISION_PERIOD: Duration = Duration::from_millis(10);

/// By declaration the SubDevice found, and the undeclared SubDevices.
type Matched = (Vec<Option<Rc<SubDeviceInfo>>>, Vec<SubDevice>);

/// Matches SubDevices with the declaration.
pub(in crate::main_device) fn match_declaration(
    segment: &SharedSegment,
    declaration: &Declaration,
    scan: &Found,
) -> Result<Matched, ActivateError> {
    let mut found = vec![None; declaration.subdevices.len()];
    let mut owners = vec![None; scan.subdevices.len()];
    let mut extra = Vec::new();
    for resolution in resolve(&declaration.subdevices, &scan.subdevices) {
        match resolution {
            Resolution::Found { config, info } => {
                owners[info] = Some(config);
                found[config] = Some(scan.subdevices[info].clone());
            }
            Resolution::Absent { config, error } if declaration.required != Required::All => {
                report_absence(segment, config, true, error);
            }
            Resolution::Failed { config, error } if declaration.required == Required::Nothing => {
                report_absence(segment, config, false, error);
            }
            Resolution::Absent { config, error } | Resolution::Failed { config, error } => {
                return Err(ActivateError::Config { subdevice: SubDeviceId(config), error });
            }
            Resolution::Extra { info } => extra.push(info),
        }
    }
    let owners = Owners::new(owners, |index| declaration.subdevices[index].group.is_some());
    let unassigned = extra.into_iter().map(|at| {
        let info = scan.subdevices[at].clone();
        let (position, identity) = (info.position, info.identity);
        segment.observe(Observation::Compared(DeclarationFinding::Unexpected { position, identity }));
        SubDevice::undeclared(info, &owners, scan.main_count)
    });
    Ok((found, unassigned.collect()))
}

/// SYNC signals need a clock, and clocks that are synchronized. A SubDevice without a clock may fail alone.
pub(in crate::main_device) fn check_clocks(
    declaration: &Declaration,
    found: &[Option<Rc<SubDeviceInfo>>],
) -> Result<(), ActivateError> {
    let is_alone = fails_alone(declaration);
    let counts =
        |error: &ActivateError| !(is_alone && matches!(error, ActivateError::NoClock { has_clock: false, .. }));
    let mut errors = (0..found.len()).filter_map(|subdevice| no_clock(declaration, found, subdevice));
    errors.find(counts).map_or(Ok(()), Err)
}

/// Why a SubDevice cannot have the SYNC signals that are declared for it.
pub(in crate::main_device) fn no_clock(
    declaration: &Declaration,
    found: &[Option<Rc<SubDeviceInfo>>],
    subdevice: usize,
) -> Option<ActivateError> {
    declaration.subdevices.get(subdevice)?.sync?;
    let has_clock = found.get(subdevice)?.as_ref().is_none_or(|info| info.controller.features.dc);
    let error = ActivateError::NoClock { subdevice: SubDeviceId(subdevice), has_clock };
    (!has_clock || declaration.clocks.is_none()).then_some(error)
}

fn report_absence(segment: &SharedSegment, subdevice: usize, is_optional: bool, error: ConfigError) {
    let finding = DeclarationFinding::Absent { subdevice: SubDeviceId(subdevice), is_optional, error };
    segment.observe(Observation::Compared(finding));
}

/// Whether a present SubDevice that does not fit its declaration fails alone, when its configuration begins.
fn fails_alone(declaration: &Declaration) -> bool {
    declaration.required == Required::Nothing
}

pub(in crate::main_device) fn plan_all(
    declaration: &Declaration,
    found: &[Option<Rc<SubDeviceInfo>>],
) -> Result<Vec<Areas>, ActivateError> {
    let pairs = declaration.subdevices.iter().zip(found).enumerate();
    pairs
        .map(|(index, (config, info))| match info {
            Some(info) => plan_one(declaration, SubDeviceId(index), config, info),
            None => Ok(Areas::Declared(Declared::absent(config))),
        })
        .collect()
}

fn plan_one(
    declaration: &Declaration,
    subdevice: SubDeviceId,
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
) -> Result<Areas, ActivateError> {
    let unfit = |error| Ok(Areas::Declared(Declared::unfit(config, info, error)));
    match plan(config, info) {
        Ok(_) if !exchanges(config.target) => Ok(Areas::Planned(None)),
        Ok(plan) => match misplaced(declaration, subdevice, &plan) {
            Some(error) if fails_alone(declaration) => unfit(error),
            _ => match beyond_datagram(declaration, subdevice, config, info, &plan) {
                Some(error) => unfit(error),
                None => Ok(Areas::Planned(Some(plan))),
            },
        },
        // A bad EEPROM fails only its own SubDevice.
        Err(error) if error.fault == PlanFault::Sii || fails_alone(declaration) => unfit(SetupError::Plan(error)),
        Err(error) => Err(ActivateError::Setup { subdevice, error: SetupError::Plan(error) }),
    }
}

/// Process data that no datagram can carry, where the SII alone says so: all of it is placed.
fn beyond_datagram(
    declaration: &Declaration,
    subdevice: SubDeviceId,
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
    plan: &SubDevicePlan,
) -> Option<SetupError> {
    let mut registered = declaration.domains.iter().flat_map(|domain| &domain.registered);
    if config.declared.is_some() || config.pdos.is_some() || registered.any(|area| area.subdevice == subdevice) {
        return None;
    }
    let mut areas = planned_areas(plan).into_iter();
    let (sync_manager, _, length) = areas.find(|(.., length)| usize::from(*length) > MAX_DATA)?;
    let problem = PlanProblem::BeyondDatagram { sync_manager, length };
    let (position, station) = (info.position, info.station);
    Some(SetupError::Plan(PlanError { position, station, problem, fault: PlanFault::Sii }))
}

/// A registered area of a SubDevice that has another size or direction than its process data now.
fn misplaced(declaration: &Declaration, subdevice: SubDeviceId, plan: &SubDevicePlan) -> Option<SetupError> {
    let now = planned_areas(plan);
    let all = declaration.domains.iter().flat_map(|domain| &domain.registered);
    all.filter(|area| area.subdevice == subdevice).find_map(|area| {
        let RegisteredArea { sync_manager, direction, length: expected, .. } = *area;
        let listed = now.iter().find(|(number, ..)| *number == sync_manager);
        let got = listed.map_or(0, |(.., length)| *length);
        let is_same = listed == Some(&(sync_manager, direction, expected));
        (!is_same).then_some(SetupError::Area { sync_manager, expected, got })
    })
}

/// How each SubDevice shows whether its inputs were processed. For an absent SubDevice it is unknown whether it has a
/// free FMMU.
pub(in crate::main_device) fn witnesses(
    plans: &[Areas],
    found: &[Option<Rc<SubDeviceInfo>>],
    specs: &[DomainSpec],
) -> Vec<Witness> {
    // Further places of an area need FMMUs, too.
    let mut further = vec![0; plans.len()];
    let mut seen = BTreeSet::new();
    for area in specs.iter().flat_map(|spec| &spec.areas).filter(|area| area.length > 0) {
        if !seen.insert((area.subdevice, area.sync_manager))
            && let Some(count) = further.get_mut(area.subdevice)
        {
            *count += 1;
        }
    }
    let pairs = plans.iter().zip(found).enumerate();
    let witness = |(subdevice, (areas, info)): (usize, (&Areas, &Option<Rc<SubDeviceInfo>>))| match (areas, info) {
        (Areas::Planned(Some(plan)), Some(info)) => {
            presence::witness(subdevice, plan, info, plan.mapped_areas().count() + further[subdevice])
        }
        _ => Witness::Alone,
    };
    pairs.map(witness).collect()
}

/// Checks of the declaration that need no SubDevice.
pub(in crate::main_device) fn check(declaration: &Declaration) -> Result<(), ActivateError> {
    let boot = declaration.subdevices.iter().position(|config| config.target == AlState::Boot);
    if let Some(subdevice) = boot {
        return Err(ActivateError::Target { subdevice: SubDeviceId(subdevice), target: AlState::Boot });
    }
    let headless = groups(&declaration.subdevices).into_iter().find_map(|members| {
        let head = *members.first()?;
        (!can_be_head(&declaration.subdevices[head])).then_some(head)
    });
    if let Some(subdevice) = headless {
        return Err(ActivateError::Headless { subdevice: SubDeviceId(subdevice) });
    }
    let periods = declaration.domains.iter().map(|domain| domain.period).filter(|period| !period.is_zero());
    let shortest = periods.min().unwrap_or_default();
    for (domain, config) in declaration.domains.iter().enumerate() {
        if !config.members.is_empty() && !config.registered.is_empty() {
            return Err(ActivateError::MixedPlaces { domain: DomainId(domain) });
        }
        if !(1..=MAX_UNDER_WAY).contains(&config.under_way) {
            return Err(ActivateError::UnderWay { domain: DomainId(domain), under_way: config.under_way });
        }
    }
    check_sync_cycles(declaration, shortest)
}

/// The SYNC0 period must equal the cycle, or be a whole multiple or fraction of it. A single pulse fits every cycle.
fn check_sync_cycles(declaration: &Declaration, period: Duration) -> Result<(), ActivateError> {
    let period_ns = period.as_nanos();
    for (subdevice, config) in declaration.subdevices.iter().enumerate() {
        let sync0_ns = config.sync.map_or(0, |signals| u128::from(signals.sync0_cycle_ns));
        let fits = sync0_ns == 0 || period_ns == 0 || sync0_ns % period_ns == 0 || period_ns.is_multiple_of(sync0_ns);
        if !fits {
            let sync0 = Duration::from_nanos(config.sync.map_or(0, |signals| signals.sync0_cycle_ns.into()));
            return Err(ActivateError::SyncCycle { subdevice: SubDeviceId(subdevice), sync0, period });
        }
    }
    Ok(())
}

/// Process data without any domain would never be exchanged. Without a required SubDevice this is no obstacle: its
/// outputs stay where its watchdog has them.
pub(in crate::main_device) fn check_domains(declaration: &Declaration, plans: &[Areas]) -> Result<(), ActivateError> {
    if fails_alone(declaration) {
        return Ok(());
    }
    let has_data = |areas: &Areas| areas.list().iter().any(|(.., length)| *length > 0);
    match plans.iter().position(has_data) {
        Some(subdevice) if declaration.domains.is_empty() => {
            Err(ActivateError::NoDomain { subdevice: SubDeviceId(subdevice) })
        }
        _ => Ok(()),
    }
}

pub(in crate::main_device) fn domain_specs(
    declaration: &Declaration,
    plans: &[Areas],
    lrw: LrwPolicy,
    links: LinkSet,
) -> Result<Vec<DomainSpec>, ActivateError> {
    // With two links it is always refused ([`super::lrw::check_lrw`]).
    let is_asked_for = lrw == LrwPolicy::Explicit && links == LinkSet::Single;
    let mut specs: Vec<DomainSpec> = Vec::new();
    for (domain, config) in declaration.domains.iter().enumerate() {
        let mut spec = DomainSpec {
            period: config.period,
            under_way: config.under_way,
            lrw: true,
            areas: Vec::new(),
            image: ImageOrder::Packed,
        };
        if !config.registered.is_empty() {
            let id = DomainId(domain);
            registered::fill(&mut spec, id, &config.registered, plans, is_asked_for)?;
            specs.push(spec);
            continue;
        }
        for member in &config.members {
            let subdevice = member.subdevice;
            let Some(areas) = plans.get(subdevice.0) else {
                return Err(ActivateError::UnknownMember { domain: DomainId(domain), subdevice });
            };
            if is_asked_for && !areas.lrw() {
                return Err(ActivateError::LrwUnknown { domain: DomainId(domain), subdevice });
            }
            spec.lrw &= areas.lrw();
            for (sync_manager, direction, length) in areas.list() {
                if member.sync_managers.as_ref().is_none_or(|wanted| wanted.contains(&sync_manager)) {
                    let same = |a: &AreaSpec| a.subdevice == subdevice.0 && a.sync_manager == sync_manager;
                    let is_packed = |spec: &DomainSpec| spec.image == ImageOrder::Packed;
                    let earlier = specs.iter().position(|spec| is_packed(spec) && spec.areas.iter().any(same));
                    let earlier = earlier.or_else(|| spec.areas.iter().any(same).then_some(domain));
                    if let Some(other) = earlier {
                        let domains = [other, domain];
                        return Err(ActivateError::TwoDomains {
                            subdevice,
                            sync_manager,
                            domains: domains.map(DomainId),
                        });
                    }
                    spec.areas.push(AreaSpec { subdevice: subdevice.0, sync_manager, direction, length });
                }
            }
        }
        specs.push(spec);
    }
    Ok(specs)
}

/// An application without domains still has one for the supervision datagram.
pub(in crate::main_device) fn with_domain(mut declaration: Declaration) -> Declaration {
    if declaration.domains.is_empty() {
        declaration.domains.push(DomainConfig::new(SUPERVISION_PERIOD, Vec::new()));
    }
    declaration
}

/// Reports rules that SubDevices cannot follow, and optional SubDevices for which the process image has no place.
pub(in crate::main_device) fn report_oddities(segment: &SharedSegment, subdevices: &SubDevices, layout: &Layout) {
    let report = |subdevice: usize, warning: SettingFinding| {
        segment.observe(Observation::Compared(DeclarationFinding::SettingFinding(SubDeviceId(subdevice), warning)));
    };
    for (subdevice, member) in subdevices.members().enumerate() {
        let warnings = member.setup.iter().flat_map(|setup| &setup.plan.warnings);
        for warning in warnings {
            report(subdevice, SettingFinding::Plan(*warning));
        }
        if let Some((period, watchdog)) = beyond_watchdog(subdevice, &member, layout) {
            report(subdevice, SettingFinding::Watchdog { period, watchdog });
        }
        if member.info.is_none() && declared_areas(&member.config).is_none() {
            report(subdevice, SettingFinding::NoPlace);
        }
    }
}

/// Time of a SubDevice's watchdog for process data, as declared; `None` if it is off.
pub(in crate::main_device) fn watchdog_of(member: &MemberView<'_>) -> Option<Duration> {
    let divider = member.config.watchdog_divider.map_or(WatchdogDivider::default(), WatchdogDivider);
    let intervals = member.config.watchdog_intervals.map_or(WatchdogTime::default(), WatchdogTime);
    Some(Duration::from_nanos(intervals.duration_ns(divider)?))
}

/// Period of a SubDevice's outputs and time of its watchdog, if the watchdog is shorter.
fn beyond_watchdog(subdevice: usize, member: &MemberView<'_>, layout: &Layout) -> Option<(Duration, Duration)> {
    let plan = &member.setup.as_ref()?.plan;
    let watchdog = watchdog_of(member)?;
    let watched = plan.process_data.iter().filter(|area| area.register.control.watchdog);
    let periods = watched.filter_map(|area| {
        let (domain, _) = layout.area(subdevice, area.sync_manager)?;
        Some(layout.domains.get(domain.0)?.period)
    });
    periods.max().filter(|period| !period.is_zero() && *period >= watchdog).map(|period| (period, watchdog))
}

pub(in crate::main_device) fn members(
    declaration: Declaration,
    found: Vec<Option<Rc<SubDeviceInfo>>>,
    plans: &[Areas],
    layout: &Layout,
) -> Result<Vec<SubDevice>, ActivateError> {
    let count = found.len();
    let is_alone = fails_alone(&declaration);
    let mut members = Vec::with_capacity(count);
    for (index, (config, info)) in declaration.subdevices.into_iter().zip(found).enumerate() {
        let unfit = plans.get(index).and_then(Areas::unfit).cloned();
        let setup = match &info {
            Some(info) if unfit.is_none() => match Setup::new(index, &config, info, layout) {
                Ok(setup) => Ok(Rc::new(setup)),
                Err(error) if is_alone => Err(Some(error)),
                Err(error) => return Err(ActivateError::Setup { subdevice: SubDeviceId(index), error }),
            },
            Some(_) | None => Err(unfit),
        };
        // An absent SubDevice gets an address behind those of the scan.
        let absent = station_at(Position((0x4000 + index) as u16));
        let station = info.as_ref().map_or(absent, |info| info.station);
        members.push(SubDevice::declared(config, info, station, setup));
    }
    Ok(members)
}
