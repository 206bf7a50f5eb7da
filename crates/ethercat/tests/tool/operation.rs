//! The same commands while an application drives the ring: questions reach it over the daemon.

use std::time::Duration;

use ringcat::{
    ClockConfig, Declaration, Direction, DomainId, Idn, Required, SubDeviceConfig, SubDeviceInfo, SyncSignals,
    Transition, Watchdog, WhenUnlocked,
};

use crate::bench::{Bench, Driver, directory};
use crate::golden_bus::{WITH_SOE, segment};

/// The application of the original's outputs: analogue inputs and a digital output in one domain, and a SubDevice that
/// is not there.
pub fn declare(found: &[SubDeviceInfo]) -> Declaration {
    let mut declaration = Declaration::new(Duration::from_millis(1)).with_required(Required::Nothing);
    let domain = DomainId(0);
    let input = SubDeviceConfig::at_alias(1000, 0).expect_product(2, 0x0C1E_3052);
    let input = input.sync_manager(3, Direction::Inputs, Watchdog::Off).watchdog(Some(2498), None);
    let input = input.sdo(0x8000, 6, [0x34, 0x12]).idn_at(Transition::Ps, 0, Idn(0x8096), [1, 2]).sii_to_pdi();
    let signals = SyncSignals::sync0(1_000_000, 4400).with_assign_activate(0x0300);
    let input = declaration.add_without_domain(input.sync(signals));
    let output = SubDeviceConfig::at_alias(0, 2).expect_product(2, 0x07D8_3052);
    let output = declaration.add_without_domain(output);
    declaration.add_without_domain(SubDeviceConfig::at_alias(0, 7).expect_product(2, 0x044C_2C52));
    for (subdevice, sync_manager, position) in [(input, 3, 1), (output, 0, 2)] {
        let placed = declaration.register_sync_manager(domain, subdevice, sync_manager, found.get(position));
        placed.expect("it has process data");
    }
    // A busy machine sends drift compensation late: the SubDevice goes on without locked clocks.
    let clocks = ClockConfig::default().with_lock_limit(Duration::from_secs(1));
    declaration.with_clocks(clocks.with_when_unlocked(WhenUnlocked::GoOn))
}

// covers: daemon
#[test]
fn an_application_answers_while_it_runs_its_cycles() {
    let directory = directory();
    let segment = segment(&directory, WITH_SOE);
    let bench = Bench::start_in(directory, vec![segment]);
    let _driver = Driver::start(&bench, declare);
    bench.wait_until("OP", || bench.good(&["slaves", "-p", "1,2"]).matches("  OP").count() == 2);
    let config = bench.good(&["config"]);
    assert!(
        config.contains("   0:7  0x00000002/0x044c2c52  -  -   \n1000:0  0x00000002/0x0c1e3052  1  OP  \n"),
        "{config}"
    );
    assert_eq!(bench.good(&["config", "-p7"]).lines().count(), 1);
    let domains = bench.good(&["domains", "-v"]);
    assert!(domains.contains("  SlaveConfig 1000:0, SM3 ( Input), LogAddr 0x"), "{domains}");
    assert_eq!(bench.tool(&["data"]).bytes.len(), 7);
    assert_eq!(bench.good(&["data", "-d1"]), "");
    let master = bench.good(&["master"]);
    assert!(master.contains("  Phase: Operation\n  Active: yes\n  Slaves: 4\n"), "{master}");
    assert!(master.contains("    Reference clock:   Slave 0\n"), "{master}");
    assert!(!master.contains("Application time:  0\n"), "{master}");
    assert_eq!(bench.good(&["upload", "-p1", "0x8000", "6"]), "0x1234 4660\n");
    assert_eq!(bench.good(&["foe_read", "-p1", "fw.bin"]), "hello");
    assert_eq!(bench.good(&["soe_read", "-p1", "P-0-150"]), "0x01 0x02\n");
    assert_eq!(bench.good(&["reg_read", "-p2", "0x0130", "-t", "uint16"]), "0x0008 8\n");
    assert_eq!(bench.good(&["pdos", "-p1"]).matches("TxPDO").count(), 2);
    assert!(bench.good(&["graph", "DC"]).contains("1 / 1000:0\\nEL3102\\nDC: 32 bit"));
    assert_eq!(bench.good(&["crc"]).lines().count(), 6);
    assert!(bench.good(&["sii_read", "-v", "-p1"]).contains("(TXPDO)"));
    assert!(bench.good(&["sdos", "-p1"]).contains("SDO 0x8000, \"Settings\"\n"));
    assert_eq!(bench.good(&["states", "-p", "2", "PREOP"]), "");
    bench.wait_until("PREOP", || bench.good(&["slaves", "-p2"]).contains("PREOP"));
    assert_eq!(bench.good(&["states", "-p", "2", "OP"]), "");
    bench.wait_until("OP again", || bench.good(&["slaves", "-p2"]).contains("  OP"));
    let domain = bench.good(&["domains"]);
    bench.wait_until("a full working counter", || bench.good(&["domains"]).contains("WorkingCounter 3/3\n"));
    assert!(
        domain.starts_with("Domain0: LogBaseAddr 0x") && domain.contains(", Size   7, WorkingCounter "),
        "{domain}"
    );
}
