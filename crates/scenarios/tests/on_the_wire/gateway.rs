//! Independent clients of the mailbox gateway: one in Python, written from the protocol, and the ETG.1510 client
//! pyetg1510; tshark checks the messages of the first one.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::bench::{Bench, await_op, finish, is_asked_for};
use crate::captures::{CaptureFile, PAUSE, interrupt};
use crate::foreign::{FOREIGN, NO_CACHE, python};
use crate::said;

const SEGMENT: &str = "
[segment]
ring = false
[[device]]
type = \"digital-output-8\"
[[device]]
type = \"all-protocols\"
";
const ADDRESS: &str = "127.0.0.1";
/// The SubDevice with all protocols.
const STATION: &str = "0x1002";
const CLIENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/gateway_client.py");
const OF_OTHERS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/etg1510_client.py");

fn run(bench: &Bench, python: &Path, arguments: &[&str]) -> String {
    let output = finish(bench.start(python, arguments));
    let (reports, errors) = said(&output);
    assert!(output.status.success(), "{reports}{errors}");
    reports
}

/// Output of tshark for the packets that match a filter.
fn packets(path: &str, filter: &str) -> Vec<String> {
    let output = Command::new("tshark").args(["-r", path, "-Y", filter]).output().expect("tshark");
    String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect()
}

// covers: 10.1, 10.2, gateway
#[test]
fn independent_clients_read_dictionaries_and_files_through_the_gateway() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(SEGMENT, false);
    bench.ip_main("link set lo up");
    let gateway = bench.run_ringcat(&["run", "--main", "main0", "--gateway"]);
    await_op(&bench, 2);
    let capture = CaptureFile::new("gateway");
    // TCP segments as large as responses: tshark treats each as a message.
    let sniffer = bench.start(Path::new("tshark"), &["-q", "-i", "lo", "-w", capture.path()]);
    std::thread::sleep(PAUSE + Duration::from_millis(700));
    let python3 = Path::new("python3");
    let reports = run(&bench, python3, &[NO_CACHE, CLIENT, "good", ADDRESS, STATION]);
    println!("{reports}");
    assert_eq!((reports.matches(" objects, ").count(), reports.matches(" ok\n").count()), (2, 3));
    interrupt(sniffer);
    let malformed = packets(capture.path(), "_ws.malformed");
    assert!(malformed.is_empty(), "{malformed:?}");
    for kind in ["udp", "tcp"] {
        let answers = packets(capture.path(), &format!("ecat_mailbox && {kind}.srcport == 34980")).len();
        println!("tshark: {answers} answers over {kind}");
        assert!(answers > 500, "{answers} answers over {kind}");
    }
    let reports = run(&bench, python3, &[NO_CACHE, CLIENT, "bad", ADDRESS, STATION]);
    println!("{reports}");
    assert_eq!((reports.matches("error reply").count(), reports.matches(" ok\n").count()), (3, 2));
    if is_asked_for(FOREIGN)
        && let Some(python) = python()
    {
        let reports = run(&bench, &python, &[NO_CACHE, OF_OTHERS, ADDRESS]);
        let object = |index: &str| reports.lines().find(|line| line.starts_with(index)).unwrap_or_default().to_owned();
        println!("{}\n{}\n{}", object("0x8001"), object("0xa001"), object("0xf120"));
        for (index, fields) in [
            ("0x1008", "'DeviceName': 'RingCAT'"),
            (
                "0x8001",
                "'FixedStationAddress': 4098, 'Type': 'all-protocols', 'Name': 'all-protocols-2', 'DeviceType': 5001",
            ),
            ("0x8001", "'MailboxOutSize': 1024, 'MailboxInSize': 1024, 'LinkStatus': 0, 'LinkPreset': 0"),
            ("0x8001", "'PortPhysics': 17, 'MailboxProtocolsSupported': 63, 'DiagHistoryObjectSupported': True"),
            ("0x9001", "'StationAddress': 4098, 'VendorId': 3143, 'ProductCode': 2577"),
            ("0xa001", "'ALStatus': 8, 'ALControl': 8, 'ALStatusCode': 0, 'LinkConnStatus': 17"),
            ("0xa001", "'FixedAddressConnPort': [4097, 0, 0, 0], 'FrameErrorCounterPort': [0, 0, 0, 0]"),
            // Its reply to the unknown mailbox type above: 2 is an unsupported protocol.
            ("0xa001", "'LastProtocolError': 2, 'NewDiagMessageAvailable': False"),
            ("0xf020", "'ConfiguredAddress': [4097, 4098, 0,"),
            ("0xf120", "'MasterState': 8"),
        ] {
            let reports = object(index);
            assert!(reports.contains(fields), "{fields} in {reports}");
        }
    }
    let (output, errors) = gateway.interrupt();
    assert!(output.contains("0 without an answer, 0 transfers ended"), "{output}{errors}");
    println!("{}", output.lines().find(|line| line.contains("gateway: ")).unwrap_or_default());
}
