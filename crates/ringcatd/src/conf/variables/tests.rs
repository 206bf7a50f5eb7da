use super::*;
use ringcat_control::BusSettings;

use crate::conf::Own;
use ringcat::AlState;

fn read(text: &str) -> Conf {
    Conf::from_bytes(text.as_bytes()).expect(text)
}

fn mistakes(text: &str) -> Vec<(Option<usize>, String)> {
    Conf::from_bytes(text.as_bytes()).expect_err(text).into_iter().map(|it| (it.line, it.text)).collect()
}

/// The only mistake of a text, in its last line.
fn mistake(text: &str) -> String {
    let found = mistakes(text);
    let [(line, found)] = &found[..] else { panic!("{text}: {found:?}") };
    assert_eq!(*line, Some(text.lines().count()), "{found}");
    found.clone()
}

fn meaning(conf: &Conf, name: &str) -> String {
    conf.understood.iter().find(|it| it.name == name).expect(name).text.clone()
}

// covers: daemon
#[test]
fn masters_are_on_addresses_names_the_first_interface_and_rings() {
    let text = "MASTER0_DEVICE=\"00:00:08:44:ab:66\"\nMASTER1_DEVICE=eth1\nMASTER1_BACKUP=00:00:08:44:AB:67\n\
                MASTER2_DEVICE='ff:ff:ff:ff:ff:ff'\nMASTER3_DEVICE=\"\"\nMASTER3_BACKUP=\n";
    let conf = read(text);
    let shown: Vec<String> = conf.masters.iter().map(|it| format!("{}={}", it.master, it.source)).collect();
    assert_eq!(shown, ["0=00:00:08:44:ab:66", "1=eth1,00:00:08:44:ab:67", "2=ff:ff:ff:ff:ff:ff"]);
    assert_eq!(meaning(&conf, "MASTER0_DEVICE"), "master 0 on the interface with address 00:00:08:44:ab:66");
    assert_eq!(meaning(&conf, "MASTER2_DEVICE"), "master 2 on the first interface that nothing else uses");
    assert_eq!(meaning(&conf, "MASTER3_DEVICE"), "empty: no master");
}

// covers: daemon
#[test]
fn each_variable_of_the_manual_is_honoured_or_explained() {
    let conf = read(
        "MASTER0_DEVICE=eth0\nDEVICE_MODULES=\"e1000e generic\"\nUPDOWN_INTERFACES=\" eth0  eth1 \"\n\
                     MODPROBE_FLAGS=\"-b\"\nOTHER=1\n",
    );
    assert_eq!(conf.up_down, ["eth0", "eth1"]);
    assert!(meaning(&conf, "DEVICE_MODULES").starts_with("not needed: ringcatd uses interfaces with the drivers"));
    assert_eq!(meaning(&conf, "MODPROBE_FLAGS"), "not needed: no kernel module is loaded");
    assert!(meaning(&conf, "UPDOWN_INTERFACES").ends_with("eth0, eth1"));
    assert!(meaning(&conf, "OTHER").ends_with("without effect"));
    assert_eq!(read("MASTER0_DEVICE=eth0\nUPDOWN_INTERFACES=\" \"\n").up_down, [""; 0]);
}

// covers: daemon
#[test]
fn variables_of_ringcat_are_the_options_of_the_daemon() {
    let text = "RINGCAT_MASTER0_SIM=/srv/a.toml\nRINGCAT_MASTER0_SAFE_STATE=safeop\nRINGCAT_SOCKET=/run/x\n\
                RINGCAT_MODE=0664\nRINGCAT_GROUP=44\nRINGCAT_STOP_LIMIT=250\nRINGCAT_EOE=no\nRINGCAT_DEBUG_LEVEL=1\n\
                RINGCAT_BACKUP=required\nRINGCAT_DEBUG_IF=yes\nRINGCAT_REGALIAS=yes\n";
    let mut bus = BusSettings::default();
    bus.reads_alias_register = true;
    let safe_states = vec![crate::source::SafeState { master: 0, state: AlState::SafeOp }];
    let expected = Own {
        socket: Some("/run/x".into()),
        mode: Some(0o664),
        group: Some(44),
        stop_limit: Some(250),
        eoe: Some(false),
        has_debug_interfaces: true,
        debug_level: Some(1),
        needs_backup: true,
        bus,
        safe_states,
    };
    let conf = read(text);
    assert_eq!(conf.own, expected);
    assert_eq!(conf.masters[0].source, Source::Simulated("/srv/a.toml".into()));
    assert_eq!(conf.understood.len(), 11);
    assert_eq!(meaning(&conf, "RINGCAT_REGALIAS"), "aliases are those of register 0x0012");
    let empty = "MASTER0_DEVICE=a\nRINGCAT_SOCKET=\nRINGCAT_MODE=\nRINGCAT_GROUP=\nRINGCAT_STOP_LIMIT=\nRINGCAT_EOE=\n\
                 RINGCAT_DEBUG_LEVEL=\nRINGCAT_BACKUP=\nRINGCAT_MASTER0_SIM=\nRINGCAT_MASTER7_SAFE_STATE=\n\
                 RINGCAT_WILDCARDS=\nRINGCAT_DEBUG_RING_FILES=\nRINGCAT_DEBUG_IF=\n";
    assert_eq!(read(empty).own, Own::default());
}

// covers: daemon
#[test]
fn the_last_of_several_assignments_counts_and_the_others_say_so() {
    let conf = read("MASTER0_DEVICE=eth0 # before\nMASTER0_DEVICE=eth1\n");
    assert_eq!(conf.masters[0].source.to_string(), "eth1");
    assert_eq!(conf.understood[0].text, "line 2 counts instead");
}

// covers: daemon
#[test]
fn values_that_cannot_be_meant_are_mistakes() {
    let cases = [
        ("MASTER0_DEVICE=eth0\nMASTER0_BACKUP=eth0", "eth0 is named in line 1 already"),
        ("MASTER0_DEVICE=eth0\nMASTER1_DEVICE=eth0", "eth0 is named in line 1 already"),
        ("MASTER0_DEVICE=FF:ff:ff:ff:ff:ff\nMASTER1_DEVICE=ff:ff:ff:ff:ff:ff", "is named in line 1 already"),
        ("MASTER0_BACKUP=eth0", "expected MASTER0_DEVICE, too"),
        ("MASTER0_DEVICE=\nMASTER1_DEVICE=eth0", "expected master 0 before it"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MASTER0_SIM=/a", "an interface and a simulated segment"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MASTER0_SIM=a", "expected a path from /"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MASTER1_SAFE_STATE=PREOP", "there is no master 1"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MASTER0_SAFE_STATE=OP", "expected INIT, PREOP or SAFEOP"),
        ("MASTER0_DEVICE=eth0\nMASTER0_DEVCE=eth0", "expected MASTERx_DEVICE or MASTERx_BACKUP"),
        ("MASTER0_DEVICE=eth0\nMASTER32_DEVICE=eth1", "with x from 0 to 31"),
        ("MASTER0_DEVICE=eth0\nMASTER01_DEVICE=eth1", "with x from 0 to 31"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MOOD=0660", "expected RINGCAT_SOCKET, _MODE"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_MODE=0777", "expected octal digits"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_GROUP=no-such-group", "there is no group"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_STOP_LIMIT=0", "expected a number from 1 to"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_DEBUG_LEVEL=+1", "expected a number from 0 to 2"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_EOE=maybe", "expected yes or no"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_BACKUP=no", "expected optional or required"),
        ("MASTER0_DEVICE=eth0\nRINGCAT_SOCKET=x", "expected a path from /"),
        ("MASTER0_DEVICE=eth0\nUPDOWN_INTERFACES=00:00:08:44:ab:66", "expected names of interfaces"),
    ];
    for (text, expected) in cases {
        let found = mistake(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
    let many = format!("MASTER0_DEVICE=eth0\nUPDOWN_INTERFACES='{}'", "a ".repeat(65));
    assert!(mistake(&many).contains("at most 64"));
}

// covers: daemon
#[test]
fn a_file_without_a_master_is_a_mistake() {
    for text in ["", "MASTER0_DEVICE=\"\"\nDEVICE_MODULES=\"\"\n"] {
        let found = mistakes(text);
        assert!(matches!(&found[..], [(None, text)] if text.starts_with("there is no master")), "{found:?}");
    }
}
