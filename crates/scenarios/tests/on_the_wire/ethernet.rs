//! EoE as network interfaces of the kernel: two SubDevices with IP stacks, bridged and separate.

use std::fs::OpenOptions;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op, finish, program};
use crate::captures::CaptureFile;
use crate::said;

const SEGMENT: &str = "
[segment]
ring = false
[[device]]
type = \"digital-output-8\"
[[device]]
type = \"ethernet-terminal\"
mailbox_bytes = 1486
ip = \"10.0.0.2/24\"
[[device]]
type = \"ethernet-terminal\"
mailbox_bytes = 512
alias = 7
ip = \"10.0.0.3/24\"
gateway = \"10.0.0.1\"
";
const INTERFACES: [&str; 2] = ["eoe0s1", "eoe0a7"];
const LIMIT: Duration = Duration::from_secs(10);
/// Pings an address, downloads bytes from its web server, or has bytes echoed; prints the duration. Standard library
/// only.
pub const CLIENT: &str = "
import socket, struct, sys, threading, time
def checksum(data):
    total = sum(struct.unpack('!%dH' % (len(data) // 2), data))
    total = (total >> 16) + (total & 0xFFFF)
    return ~(total + (total >> 16)) & 0xFFFF
def ping(address, count):
    s = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP)
    s.settimeout(1)
    times = []
    lost = 0
    for number in range(count):
        body = bytes(range(256)) * (1 + number % 5)
        head = struct.pack('!BBHHH', 8, 0, 0, 0x4711, number)
        head = struct.pack('!BBHHH', 8, 0, checksum(head + body), 0x4711, number)
        begin = time.monotonic()
        s.sendto(head + body, (address, 0))
        while True:
            try:
                packet, sender = s.recvfrom(4096)
            except TimeoutError:
                # The host takes up to a second to act on a carrier.
                assert times == [] and lost < 4, 'no answer to number %d' % number
                lost += 1
                begin = time.monotonic()
                s.sendto(head + body, (address, 0))
                continue
            kind, _, _, ident, seq = struct.unpack('!BBHHH', packet[20:28])
            if sender[0] == address and (kind, ident, seq) == (0, 0x4711, number):
                break
        assert packet[28:] == body, 'another body'
        times.append(time.monotonic() - begin)
    print('ping', address, 'lost', lost, 'median_ms %.2f' % (sorted(times)[count // 2] * 1e3))
def download(address, length):
    begin = time.monotonic()
    s = socket.create_connection((address, 80), timeout=10)
    s.sendall(b'GET /bytes/%d HTTP/1.0\\r\\n\\r\\n' % length)
    data = b''
    while True:
        piece = s.recv(65536)
        if not piece:
            break
        data += piece
    body = data.split(b'\\r\\n\\r\\n', 1)[1]
    assert body == bytes(33 + number % 89 for number in range(length)), len(body)
    print('download', address, length, 'kB_per_s %.0f' % (length / 1e3 / (time.monotonic() - begin)))
def echo(address, length):
    begin = time.monotonic()
    s = socket.create_connection((address, 7), timeout=10)
    data = bytes(number * 7 % 253 for number in range(length))
    threading.Thread(target=s.sendall, args=(data,), daemon=True).start()
    back = b''
    while len(back) < length:
        back += s.recv(65536)
    assert back == data, 'another echo'
    print('echo', address, length, 'kB_per_s %.0f both ways' % (length / 1e3 / (time.monotonic() - begin)))
for word in sys.argv[1:]:
    address, what = word.split('/')
    if what.startswith('echo'):
        echo(address, int(what[4:]))
        continue
    download(address, int(what)) if int(what) > 1000 else ping(address, int(what))
";

/// Whether this machine has TAP interfaces; prints a line if not.
pub fn has_taps() -> bool {
    let there = OpenOptions::new().read(true).write(true).open("/dev/net/tun").is_ok();
    if !there {
        println!("skipped: /dev/net/tun cannot be opened");
    }
    there
}

/// Waits until the interfaces of the MainDevice's host meet a condition.
fn wait(bench: &Bench, what: &str, condition: impl Fn(&str) -> bool) {
    let until = Instant::now() + LIMIT;
    loop {
        let links = bench.links_main();
        if condition(&links) {
            return;
        }
        assert!(Instant::now() < until, "{what}:\n{links}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn line<'a>(links: &'a str, interface: &str) -> Option<&'a str> {
    links.lines().find(|line| line.contains(&format!(": {interface}:")))
}

fn client(bench: &Bench, tasks: &[&str]) {
    ask(tasks, |arguments| bench.start(Path::new("python3"), arguments));
}

fn ask(tasks: &[&str], start: impl FnOnce(&[&str]) -> Child) {
    let output = finish(start(&[&["-c", CLIENT], tasks].concat()));
    let (reports, errors) = said(&output);
    assert!(output.status.success(), "{reports}{errors}");
    print!("{reports}");
}

// covers: eoe-interfaces
#[test]
fn two_eoe_devices_serve_ping_and_downloads_bridged_and_routed() {
    let Some(mut bench) = Bench::new(1).filter(|_| has_taps()) else { return };
    bench.simulate(SEGMENT, false);
    let capture = CaptureFile::new("eoe");
    let run = bench.run_ringcat(&["run", "--main", "main0", "--eoe", "--capture", capture.path()]);
    await_op(&bench, 3);
    bench.ip_main("link add br0 type bridge");
    for interface in INTERFACES {
        wait(&bench, "an interface for each", |links| line(links, interface).is_some());
        bench.ip_main(&format!("link set {interface} master br0 up"));
    }
    bench.ip_main("addr add 10.0.0.1/24 dev br0");
    bench.ip_main("link set br0 up");
    let has_carrier =
        |links: &str| INTERFACES.iter().all(|name| line(links, name).is_some_and(|is| is.contains("LOWER_UP")));
    wait(&bench, "both have a carrier", has_carrier);
    client(&bench, &["10.0.0.2/20", "10.0.0.3/20", "10.0.0.2/1000000", "10.0.0.3/1000000", "10.0.0.3/echo200000"]);

    // An unreachable SubDevice only loses its carrier; its interface stays in the bridge.
    bench.order("power off 2");
    wait(&bench, "no carrier", |links| line(links, "eoe0a7").is_some_and(|is| is.contains("NO-CARRIER")));
    client(&bench, &["10.0.0.2/3"]);
    bench.order("power on 2");
    await_op(&bench, 3);
    wait(&bench, "both have a carrier again", has_carrier);
    client(&bench, &["10.0.0.3/3"]);

    // Without the bridge, the host's own stack on one interface.
    bench.ip_main("link set eoe0a7 nomaster");
    bench.ip_main("addr del 10.0.0.1/24 dev br0");
    bench.ip_main("addr add 10.0.0.1/24 dev eoe0a7");
    client(&bench, &["10.0.0.3/5", "10.0.0.3/50000"]);

    // And from another network through this host.
    bench.add_routed_computer();
    ask(&["10.0.0.3/5", "10.0.0.3/50000"], |arguments| bench.start_elsewhere(Path::new("python3"), arguments));

    // An interface that is removed is created again.
    let index = |links: &str| line(links, "eoe0s1").and_then(|line| line.split(':').next().map(str::to_owned));
    let before = index(&bench.links_main());
    bench.ip_main("link del eoe0s1");
    wait(&bench, "it is there again", |links| index(links).is_some_and(|index| Some(index) != before));

    let (output, errors) = run.interrupt();
    let figures: Vec<&str> = output.lines().filter(|line| line.contains("eoe0")).collect();
    println!("{}", figures.join("\n"));
    assert_eq!(
        figures.iter().filter(|line| line.contains(" 0 incomplete, 0 overrun, ")).count(),
        2,
        "{output}{errors}"
    );
    assert!(errors.contains("network interface eoe0s1 leads to SubDevice 1"), "{errors}");
    assert!(errors.contains("eoe0a7: no carrier, its SubDevice is away"), "{errors}");
    assert_eq!(errors.matches("eoe0s1: removed by another program; it is made again").count(), 1, "{errors}");
    assert!(output.contains("stopped: outputs zero"), "{output}{errors}");
    let links = bench.links_main();
    assert!(INTERFACES.iter().all(|name| line(&links, name).is_none()), "{links}");
    // tshark treats fragments as whole frames, and their contents as truncated.
    capture.check_frames("two EoE devices", &["ip"]);
}

// covers: eoe-interfaces
#[test]
fn without_permission_eoe_prints_a_warning_and_cycles_continue() {
    let Some(mut bench) = Bench::new(1).filter(|_| has_taps()) else { return };
    bench.simulate(SEGMENT, false);
    let program = program("ringcat").display().to_string();
    let arguments =
        ["--bounding-set", "-net_admin", "--inh-caps", "-net_admin", &program, "run", "--main", "main0", "--eoe"];
    let output = finish(
        bench.start(Path::new("setpriv"), &[&arguments[..], &["--for", "500ms", "--receive", "block"]].concat()),
    );
    let (reports, errors) = said(&output);
    assert!(
        reports.contains("all SubDevices are in OP") && reports.contains("stopped: outputs zero"),
        "{reports}{errors}"
    );
    assert_eq!(errors.matches("EoE: not permitted to make the network interface eoe0").count(), 2, "{errors}");
    assert!(errors.contains("sudo setcap cap_net_raw,cap_net_admin"), "{errors}");
    assert!(reports.contains("EoE: no network interface"), "{reports}");
}
