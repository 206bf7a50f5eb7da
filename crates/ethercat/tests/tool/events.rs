//! `ethercat events`, with and without `--follow`.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;

use ringcat::sim::cable::{CableId, DeviceIndex};
use ringcat::sim::fault::Fault;

use crate::bench::{Bench, LONG, PROGRAM};
use crate::several::ring;

// covers: daemon
#[test]
fn events_are_listed_and_followed_as_they_come() {
    let bench = Bench::start(vec![ring(3, true)]);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Cut(CableId(1))));
    let lists = |text: &str| bench.good(&["events"]).lines().any(|line| line.contains(text));
    bench.wait_until("the cut", || lists("ring open"));
    let listed = bench.good(&["events"]);
    let time = |line: &str| line.trim_start_matches('[').split(']').next().and_then(|it| it.trim().parse::<f64>().ok());
    let times: Vec<f64> = listed.lines().map(|line| time(line).expect(line)).collect();
    assert!(times.is_sorted() && times[0] > 0.0, "{listed}");

    let mut follow = Command::new(PROGRAM);
    follow.args(["events", "--follow"]).env("RINGCAT_SOCKET", &bench.socket);
    let mut follow = follow.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("it starts");
    let output = BufReader::new(follow.stdout.take().expect("it is piped"));
    let (sender, lines) = channel();
    std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    let wait_for = |text: &str| {
        while !lines.recv_timeout(LONG).unwrap_or_else(|error| panic!("{text}: {error}")).contains(text) {}
    };
    wait_for("ring open");
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Heal(CableId(1))));
    wait_for("ring closed");
    bench.inside(0, |segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(1))));
    wait_for("ring open");
    assert!(follow.try_wait().expect("it is a child").is_none(), "it goes on");
    follow.kill().expect("it runs");
    follow.wait().expect("it has ended");
}
