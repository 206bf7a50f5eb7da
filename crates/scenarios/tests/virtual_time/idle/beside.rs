//! Services of undeclared SubDevices beside an application in OP: files, BOOT, another device in the same place. Each
//! cycle of the application is complete, and its outputs are compared inside its SubDevices.

use ringcat::{AlState, SubDevice};
use ringcat_sim::application::foe::firmware;
use ringcat_sim::device::Device;
use ringcat_wire::al::AlStatus;
use scenarios::segments::describe;
use scenarios::world::World;

use super::*;

const KINDS: [&str; 5] = ["servo", "digital-output-8", "all-protocols", "digital-output-8", "analog-output-4"];
/// In the middle, and without a declaration.
const OTHER: usize = 2;
const OTHERS_POSITION: Position = Position(OTHER as u16);

/// All but [`OTHER`] are declared, in OP, and their outputs change in each cycle.
fn worlds() -> [World; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&KINDS), options()), ring(descriptions(&KINDS), options())].map(|network| {
        let declare = |scan: &ringcat::Scan| {
            let declared = (0..KINDS.len()).filter(|at| *at != OTHER).map(|at| scan.subdevices[at].clone());
            automatic(&declared.collect::<Vec<_>>(), CYCLE)
        };
        let options = super::options();
        let mut world = World::with(17, network, &options, declare).expect("scan and activation");
        world.settle();
        world.run_cycles(300);
        assert_eq!(status_of(&world, OTHER), PREOP);
        world
    })
}

fn status_of(world: &World, device: usize) -> AlStatus {
    world.network().device(DeviceIndex(device)).al_status()
}

/// Runs cycles until a request has ended.
fn ended<T>(world: &mut World, mut take: impl FnMut() -> Option<T>) -> T {
    for _ in 0..20_000 {
        if let Some(result) = take() {
            return result;
        }
        world.cycle();
    }
    panic!("a request has not ended\n{}", world.log());
}

/// Requests a state, and checks it inside the SubDevice.
fn change(world: &mut World, state: AlState) {
    let mut request = SubDevice::new(world.application_mut(), OTHERS_POSITION).request_state(state);
    ended(world, || request.take()).expect("it follows");
    assert_eq!(status_of(world, OTHER), AlStatus::new(state));
}

/// No cycle was incomplete, and no declared SubDevice has left OP.
fn is_undisturbed(world: &World, mark: scenarios::world::Mark, cycles: usize) {
    let evaluated = world.evaluated(mark).len();
    assert!(evaluated >= cycles, "{evaluated} cycles");
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()), "{}", world.log());
}

// covers: states, foe, mailbox
#[test]
fn files_and_boot_of_an_undeclared_subdevice_disturb_no_application_in_op() {
    for mut world in worlds() {
        let (mark, compared) = (world.mark(), world.compared());
        for (round, size) in [600, 40_000].into_iter().enumerate() {
            change(&mut world, AlState::Boot);
            let version = format!("4.{round}");
            let image = firmware::image(&version, &vec![0x5A; size]);
            let mut write = SubDevice::new(world.application_mut(), OTHERS_POSITION).foe_write("firmware.bin", image);
            ended(&mut world, || write.take()).expect("it is written");
            change(&mut world, AlState::PreOp);
            let mut read = SubDevice::new(world.application_mut(), OTHERS_POSITION).sdo_read::<String>(0x100A, 0);
            assert_eq!(ended(&mut world, || read.take()).expect("it answers"), version, "it runs the new firmware");
            // A file in PREOP, both ways.
            let file: Vec<u8> = (0..3_000_u32).map(|at| at as u8).collect();
            let mut write =
                SubDevice::new(world.application_mut(), OTHERS_POSITION).foe_write("recipe.bin", file.clone());
            ended(&mut world, || write.take()).expect("it is written");
            let mut read = SubDevice::new(world.application_mut(), OTHERS_POSITION).foe_read("recipe.bin");
            assert_eq!(ended(&mut world, || read.take()).expect("it is read"), file);
        }
        is_undisturbed(&world, mark, 50);
        assert!(world.compared() > compared);
    }
}

/// A ring stays reachable around it; the cables are unplugged and plugged between two frames.
// covers: states, identity
#[test]
fn an_undeclared_subdevice_is_replaced_beside_an_application_in_op() {
    let [_, mut world] = worlds();
    let mark = world.mark();
    let before = describe(KINDS[OTHER], "x").identity;
    for kind in ["servo", "digital-output-8", KINDS[OTHER]] {
        world.fault_in(CYCLE / 2, Fault::PowerOff(DeviceIndex(OTHER)));
        world.run_cycles(400);
        let mut device = Device::new(describe(kind, "new"));
        let now = world.network().now();
        device.power_off(now);
        *world.network_mut().device_mut(DeviceIndex(OTHER)) = device;
        world.fault_in(CYCLE / 2, Fault::PowerOn(DeviceIndex(OTHER)));
        world.run_cycles(800);
        assert_eq!(status_of(&world, OTHER), PREOP, "{kind}");
        let mut info = SubDevice::new(world.application_mut(), OTHERS_POSITION).info();
        let info = ended(&mut world, || info.take()).expect("it answers").expect("it is known");
        let expected = describe(kind, "x").identity;
        assert_eq!(info.identity.product_code, expected.product_code, "{kind}");
        if kind != "digital-output-8" {
            let mut read = SubDevice::new(world.application_mut(), OTHERS_POSITION).sdo_read::<u32>(0x1018, 2);
            assert_eq!(ended(&mut world, || read.take()).expect("it answers"), expected.product_code);
            change(&mut world, AlState::Op);
            change(&mut world, AlState::PreOp);
        }
    }
    assert_eq!(describe(KINDS[OTHER], "x").identity, before);
    assert_eq!(world.left_op(mark).iter().filter(|device| device.0 != OTHER).count(), 0);
    assert_eq!(world.incomplete(mark), 0, "{}", world.log());
}
