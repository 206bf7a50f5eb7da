//! A state for one SubDevice, and a hot connect group, with both halves in threads of their own.

use std::ops::ControlFlow;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::shared_segment::SharedSegment;
use ringcat::{
    DeclaredGroup, DomainMember, Error, Event, Group, GroupId, GroupState, LastOutputs, Options, SubDeviceConfig,
    SubDeviceFailure, SubDeviceId, SubDeviceState, SupervisorThread, automatic,
};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::al::AlState;

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n\
                       [[device]]\ntype = \"digital-input-8\"\nalias = 5\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);

// covers: states
#[test]
fn states_and_groups_are_asked_for_from_any_thread() -> Result<(), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let mut declaration = automatic(&scan.subdevices[..2], PERIOD);
    let head = SubDeviceConfig::at_alias(5, 0).pdos_of(&scan.subdevices[2]);
    let DeclaredGroup { id: group, members, .. } = declaration.add_group(Group::new(head));
    assert_eq!((group, members.as_slice()), (GroupId(0), [SubDeviceId(2)].as_slice()));
    let members = members.into_iter().map(DomainMember::new);
    declaration.domains[0].members.extend(members);
    let application = supervisor.activate(declaration, cyclic)?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    let end = Instant::now() + LIMIT;
    while !(cycles.supervisor().mandatory_settled()? && cycles.supervisor().groups()?[0].has_joined()) {
        assert!(Instant::now() < end, "all are in OP");
        sleep(Duration::from_millis(1));
    }
    cycles.supervisor().subdevice(SubDeviceId(1)).request_state(AlState::PreOp)?;
    cycles.supervisor().subdevice(SubDeviceId(2)).request_state(AlState::Init)?;
    while cycles.supervisor().states()[1..] != [AlState::PreOp, AlState::Init].map(SubDeviceState::Settled) {
        assert!(Instant::now() < end, "the states are published");
        sleep(Duration::from_millis(1));
    }
    let groups = cycles.supervisor().groups()?;
    let [GroupState { present: 1, settled: 0, members: 1, .. }] = groups[..] else { panic!("{groups:?}") };
    let refused = cycles.supervisor().subdevice(SubDeviceId(1)).request_state(AlState::Boot);
    let Err(Error::SubDevice(refused)) = refused else { panic!("it has no boot loader: {refused:?}") };
    assert!(matches!(refused.failure, SubDeviceFailure::State(_)), "{refused}");
    cycles.supervisor().subdevice(SubDeviceId(1)).request_state(AlState::Op)?;
    cycles.supervisor().subdevice(SubDeviceId(2)).request_state(AlState::Op)?;
    let events: Vec<Event> = std::iter::from_fn(|| cycles.supervisor().pop_event()).map(|timed| timed.event).collect();
    assert!(events.contains(&Event::GroupJoined { group: GroupId(0) }));
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
