//! Network interfaces of two controllers that lead to each other (`ringcat standby --tap`): IP over the ring, while
//! roles are handed over and programs are started again.

use std::path::Path;

use crate::bench::{Client, await_op, finish};
use crate::ethernet::{CLIENT, has_taps};
use crate::running::Running;
use crate::said;
use crate::takeover::{Pair, READY, await_that, await_words, end};

const SWITCHOVERS: usize = 20;
const TAP: [&str; 2] = ["--tap", "rc0"];
/// Echoes what it gets on a connection.
const SERVER: &str = "
import socket
s = socket.create_server(('0.0.0.0', 7000))
print('listens', flush=True)
while True:
    c, _ = s.accept()
    while True:
        piece = c.recv(65536)
        if not piece:
            break
        c.sendall(piece)
";
/// Sends numbers on one connection until its input ends, and checks their echoes.
const TCP_CLIENT: &str = "
import select, socket, struct, sys, time
s = socket.create_connection(('192.168.7.1', 7000), timeout=20)
print('connected', flush=True)
sent, back, rest, ends, stall, last = 0, 0, b'', False, 0.0, time.monotonic()
while not ends or back < sent:
    if not ends:
        s.sendall(struct.pack('!Q', sent) * 20)
        sent += 20
    readable = select.select([s] + ([] if ends else [sys.stdin]), [], [], 0.005 if not ends else 20)[0]
    ends |= sys.stdin in readable
    if s in readable:
        rest += s.recv(65536)
        now = time.monotonic()
        stall, last = max(stall, now - last), now
    assert time.monotonic() - last < 20, 'no echo for 20 s'
    while len(rest) >= 160:
        assert rest[:160] == struct.pack('!Q', back) * 20, 'another echo'
        back, rest = back + 20, rest[160:]
print('numbers', back, 'longest_stall_s %.2f' % stall, file=sys.stderr)
";

/// Two controllers with such interfaces.
struct Taps {
    pair: Pair,
    controllers: [Option<Running>; 2],
}

impl Taps {
    /// Starts a controller; its interface has an IP address as soon as it is there.
    fn start(&mut self, side: usize) {
        let pair = &self.pair;
        let started = if side == 0 { pair.first(&TAP) } else { pair.second(&TAP) };
        await_words(&started, "INACTIVE: forwarding between");
        for words in [format!("addr add 192.168.7.{}/24 dev rc0", side + 1), "link set rc0 up".to_owned()] {
            match side {
                0 => pair.bench.ip_main(&words),
                _ => pair.bench.ip_elsewhere(&words),
            }
        }
        self.controllers[side] = Some(started);
    }

    fn of(&self, side: usize) -> &Running {
        self.controllers[side].as_ref().expect("it runs")
    }

    /// The other one is ready, as the one on this side has reported last.
    fn await_ready(&self, side: usize) {
        let controller = self.of(side);
        await_that(READY, &[controller], || {
            let said = controller.said().so_far();
            let last = said.rfind("the other MainDevice: ").map(|at| &said[at..]);
            last.is_some_and(|last| last.starts_with(READY))
        });
    }

    /// Ten pings from the second side.
    fn ping(&self) {
        let tasks = ["-c", CLIENT, "192.168.7.1/10"];
        let output = finish(self.pair.bench.start_elsewhere(Path::new("python3"), &tasks));
        let (reports, errors) = said(&output);
        assert!(output.status.success(), "{reports}{errors}");
        print!("{reports}");
    }
}

// covers: REQ008, REQ034, REQ039, AC-01, AC-04, AC-07, standby
#[test]
fn ping_and_tcp_over_the_taps_survive_twenty_switchovers() {
    let Some(pair) = Pair::new().filter(|_| has_taps()) else { return };
    let mut taps = Taps { pair, controllers: [None, None] };
    taps.start(0);
    await_op(&taps.pair.bench, 10);
    taps.start(1);
    let mtu = taps.pair.bench.links_main();
    assert!(mtu.lines().any(|line| line.contains(": rc0:") && line.contains("mtu 1400")), "{mtu}");
    taps.await_ready(0);
    let _server = Client::new(taps.pair.bench.start(Path::new("python3"), &["-c", SERVER]));
    taps.ping();
    let client = Client::new(taps.pair.bench.start_elsewhere(Path::new("python3"), &["-c", TCP_CLIENT]));
    assert_eq!(client.line, "connected");
    let mut active = 0;
    for _ in 0..SWITCHOVERS {
        let leaving = taps.controllers[active].take().expect("it runs");
        end(leaving, &["result: ok: handed the role over"]);
        taps.start(active);
        await_words(taps.of(active), "INACTIVE: cycles run");
        taps.await_ready(1 - active);
        taps.ping();
        active = 1 - active;
    }
    taps.pair.all_are_in("OP");
    let (is_whole, report) = client.end();
    assert!(is_whole, "{report}");
    print!("one TCP connection over {SWITCHOVERS} switchovers: {report}");
    let [first, second] = taps.controllers.map(|it| it.expect("it runs"));
    let (staying, leaving) = if active == 0 { (second, first) } else { (first, second) };
    end(leaving, &["rc0: ", " frames (", "result: ok: handed the role over"]);
    end(staying, &["rc0: ", " frames (", "result: ok: stopped the bus as ACTIVE"]);
}
