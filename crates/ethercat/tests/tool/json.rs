//! `--json` of every command: each line holds the keys of `docs/ethercat-json.md`, and what the text says.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;

use ethercat::commands::ALL;
use ethercat::shape::Output;
use json_keys::Page;
use ringcat::automatic;
use ringcat::sim::cable::CableId;
use ringcat::sim::fault::Fault;
use serde_json::{Value, json};

use crate::bench::{Bench, Driver, LONG, PROGRAM, directory};
use crate::golden_bus::{WITH_SOE, segment};
use crate::operation::declare;
use crate::several::ring;

const PAGE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/ethercat-json.md"));

/// Lines of an output, each held against the page.
fn lines(command: &str, output: &str) -> Vec<Value> {
    let page = Page::read(PAGE);
    let read = |line: &str| -> Value {
        let value: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{command}: {error}: {line}"));
        page.check(&["Every line", command], value.as_object().expect("an object"));
        assert_eq!((&value["schema_version"], &value["command"]), (&json!(1), &json!(command)), "{line}");
        value
    };
    output.lines().map(read).collect()
}

impl Bench {
    /// The lines of a command that succeeds.
    pub fn json(&self, arguments: &[&str]) -> Vec<Value> {
        lines(arguments[0], &self.good(&[arguments, &["--json"]].concat()))
    }

    /// The only line of a command.
    pub fn one(&self, arguments: &[&str]) -> Value {
        let mut lines = self.json(arguments);
        assert_eq!(lines.len(), 1, "{arguments:?}: {lines:?}");
        lines.remove(0)
    }
}

fn array(value: &Value) -> &[Value] {
    value.as_array().expect("an array")
}

fn bench() -> Bench {
    let directory = directory();
    let segment = segment(&directory, WITH_SOE);
    Bench::start_in(directory, vec![segment])
}

// covers: daemon, json
#[test]
fn lists_of_an_idle_bus_are_those_of_the_text() {
    let bench = bench();
    let slaves = bench.one(&["slaves"]);
    let row = |it: &Value| {
        let flag = if it["error"] == true { "E" } else { "+" };
        let [position, alias, relative] =
            ["position", "last_alias", "relative_position"].map(|key| it[key].to_string());
        format!("{position} {alias}:{relative} {} {flag}", it["state"].as_str().expect("it answers"))
    };
    let rows: Vec<String> = array(&slaves["subdevices"]).iter().map(row).collect();
    let words = |line: &str| line.split_whitespace().take(4).collect::<Vec<_>>().join(" ");
    let text: Vec<String> = bench.good(&["slaves"]).lines().map(|line| words(&line.replace("+ERROR", ""))).collect();
    assert_eq!(rows, text);
    assert_eq!(array(&bench.one(&["slaves", "-p1", "-m0"])["subdevices"]).len(), 1);

    let input = &bench.one(&["slaves", "-p1", "-v"])["subdevices"][0];
    let name = "EL3102 2Ch. Ana. Input +/-10V";
    assert_eq!((&input["name"], &input["alias"]), (&json!(name), &json!(1000)));
    assert_eq!((&input["vendor_id"], &input["product_code"]), (&json!(2), &json!(0x0C1E_3052)));
    assert_eq!((&input["state"], &input["al_status"], &input["link"]), (&json!("PREOP"), &json!(2), &json!("main")));
    let details = &input["details"];
    assert_eq!((&details["clock"], &details["protocols"]), (&json!("bits32"), &json!(["CoE", "FoE", "SoE"])));
    assert_eq!(details["mailboxes"]["receive_address"], 0x1800);
    assert_eq!((&details["general"]["current_ma"], &details["ports"][0]["neighbour"]), (&json!(130), &json!(0)));
    assert_eq!(array(&bench.one(&["slaves", "-v"])["subdevices"]).len(), 4);

    let pdos = bench.one(&["pdos"]);
    let managers = &pdos["subdevices"][0]["sync_managers"];
    assert_eq!((&pdos["subdevices"][0]["position"], array(&pdos["subdevices"]).len()), (&json!(1), 2));
    assert_eq!((&managers[3]["start_address"], &managers[3]["direction"]), (&json!(0x1100), &json!("inputs")));
    let entry = json!({ "index": 0x3101, "subindex": 2, "length_bits": 16, "name": "Value" });
    assert_eq!(managers[3]["pdos"][0]["entries"][1], entry);
    assert!(bench.bad(&["pdos", "-s", "etherlab", "--json"]).starts_with("Skin 'etherlab' has no --json!\n"));

    let crc = bench.one(&["crc"]);
    assert_eq!((array(&crc["subdevices"]).len(), array(&crc["subdevices"][0]["ports"]).len()), (4, 4));
    assert_eq!(crc["subdevices"][1]["ports"][1]["neighbour"], 2);
    let master = bench.one(&["master"]);
    assert_eq!((&master["phase"], &master["subdevices"]), (&json!("idle"), &json!(4)));
    assert!(master["devices"][0]["frames"]["sent_frames"].as_u64() > Some(100), "{master}");
    for (command, key) in [("config", "declared"), ("domains", "domains"), ("data", "domains"), ("eoe", "interfaces")] {
        assert_eq!(bench.one(&[command])[key], json!([]), "{command}");
    }
    assert_eq!(bench.one(&["clocks"])["clocks"], json!([]));
    for command in ["graph", "xml", "cstruct"] {
        assert_eq!(bench.one(&[command])["text"], bench.good(&[command]), "{command}");
    }
    let version = bench.one(&["version"]);
    let [igh, own] = ["igh_version", "ringcat_version"].map(|key| version[key].as_str().expect("a text"));
    assert_eq!(bench.good(&["version"]), format!("IgH EtherCAT master {igh} (RingCAT {own})\n"));
}

// covers: daemon, json
#[test]
fn values_have_types_and_bytes_and_failures_stay_text() {
    let bench = bench();
    let on = |words: &[&str]| bench.one(&[words, &["-p", "1"]].concat());
    let read = |it: &Value| json!([it["data_type"], it["value"], it["data"]]);
    let upload = on(&["upload", "0x2000", "0"]);
    assert_eq!(read(&upload), json!(["uint32", 0x8000_0005_u32, "05000080"]));
    assert_eq!((&upload["position"], &upload["index"], &upload["subindex"]), (&json!(1), &json!(0x2000), &json!(0)));
    assert_eq!(on(&["upload", "0x2000", "0", "-t", "sm32"])["value"], -5);
    assert_eq!(on(&["upload", "0x2002", "0"])["value"], "EL3102");
    bench.good(&["download", "-p1", "-t", "float", "0x2001", "0", "0.1"]);
    assert_eq!(on(&["upload", "0x2001", "0"])["value"], 0.1);
    let register = on(&["reg_read", "0x0012", "-t", "uint16"]);
    assert_eq!((read(&register), &register["address"]), (json!(["uint16", 1000, "e803"]), &json!(0x12)));
    assert_eq!(read(&on(&["reg_read", "0x0012", "2"])), json!([null, null, "e803"]));
    let idn = on(&["soe_read", "P-0-100"]);
    assert_eq!((&idn["idn"], &idn["data"]), (&json!(0x8064), &json!("01020304")));
    let file = on(&["foe_read", "fw.bin"]);
    assert_eq!((&file["file"], &file["data"]), (&json!("fw.bin"), &json!("68656c6c6f")));
    let path = bench.directory.join("out.bin");
    let file = on(&["foe_read", "fw.bin", "-o", path.to_str().expect("it is text")]);
    assert_eq!((&file["length_bytes"], &file["data"]), (&json!(5), &Value::Null));
    assert_eq!(std::fs::read(path).expect("it was written"), b"hello");

    let sii = on(&["sii_read"]);
    let image: String = bench.tool(&["sii_read", "-p1"]).bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!((sii["data"].as_str(), sii["length_bytes"].as_u64()), (Some(&image[..]), Some(image.len() as u64 / 2)));
    let category = |it: &Value| Some(format!("0x{:04x} {}", it["category"].as_u64()?, it["name"].as_str()?));
    let categories: Vec<Option<String>> = array(&sii["categories"]).iter().map(category).collect();
    let verbose = bench.good(&["sii_read", "-p1", "-v"]);
    let titles = verbose.lines().filter_map(|line| line.strip_prefix("SII Category "));
    let titles: Vec<_> = titles.map(|it| it.split_once(')').map(|(it, _)| it.replace('(', ""))).collect();
    assert_eq!(categories, titles);

    let sdos = on(&["sdos"]);
    let object = |index: u64| array(&sdos["objects"]).iter().find(|it| it["index"] == index).expect("it is there");
    assert_eq!(object(0x8000)["name"], "Settings");
    let entry = &object(0x2004)["entries"][0];
    assert_eq!((&entry["data_type"], &entry["length_bits"]), (&json!("uint16"), &json!(16)));
    assert_eq!((&entry["read_in"], &entry["write_in"]), (&json!(["PREOP", "SAFEOP", "OP"]), &json!([])));
    assert_eq!(on(&["sdos", "-q"])["objects"][0]["entries"], Value::Null);
    assert_eq!(bench.json(&["sdos"]).len(), 4);

    for words in [&["upload", "-p1", "-t", "uint8", "0x5000", "0"][..], &["upload", "0x2000", "0"], &["slaves", "-m7"]]
    {
        assert_eq!(bench.bad(&[words, &["--json"]].concat()), bench.bad(words), "{words:?}");
    }
}

// covers: daemon, json
#[test]
fn commands_that_print_nothing_refuse_json_and_change_nothing() {
    let bench = bench();
    for command in ALL.into_iter().filter(|command| command.output == Output::Nothing) {
        let refused = format!("'{}' prints no data: it has no --json!\n\nethercat {0} [OPTIONS]", command.name);
        assert!(bench.bad(&[command.name, "--json"]).starts_with(&refused), "{}", command.name);
        assert!(!ethercat::help::of(command).contains("--json"), "{}", command.name);
    }
    bench.bad(&["download", "-p1", "0x2003", "0", "200", "--js"]);
    assert_eq!(bench.good(&["upload", "-p1", "0x2003", "0"]), "0x00 0\n");
    assert!(bench.bad(&["crc", "reset", "--json"]).starts_with("'crc reset' prints no data: it has no --json!\n"));
    for command in ALL.into_iter().filter(|command| command.output == Output::Data) {
        assert!(bench.good(&[command.name, "--help"]).contains("  --json  "), "{}", command.name);
    }
}

// covers: daemon, json
#[test]
fn an_application_is_listed_in_json() {
    let bench = bench();
    let _driver = Driver::start(&bench, declare);
    bench.wait_until("a full working counter", || bench.good(&["domains"]).contains("WorkingCounter 3/3\n"));
    let config = bench.one(&["config"]);
    let of = |alias: u64, position: u64| {
        let declared = array(&config["declared"]).iter();
        declared.clone().find(|it| it["alias"] == alias && it["position"] == position).expect("it is declared")
    };
    assert_eq!(array(&config["declared"]).len(), bench.good(&["config"]).lines().count());
    assert_eq!(of(0, 7)["attached"], Value::Null);
    let input = of(1000, 0);
    assert_eq!(input["attached"], json!({ "position": 1, "state": "OP", "error": false }));
    let watchdog = (&input["watchdog_divider"], &input["watchdog_intervals"]);
    assert_eq!((watchdog, &input["sii_to_pdi"]), ((&json!(2498), &Value::Null), &json!(true)));
    let written = json!({ "index": 0x8000, "subindex": 6, "length_bytes": 2, "data": "3412" });
    assert!(array(&input["sdos"]).contains(&written), "{input}");
    assert_eq!(input["idns"][0]["data"], "0102");
    assert_eq!((&input["sync"]["sync0_cycle_ns"], &input["sync"]["sync0_shift_ns"]), (&json!(1_000_000), &json!(4400)));

    let domain = &bench.one(&["domains"])["domains"][0];
    let counters = (&domain["working_counter"], &domain["expected_working_counter"]);
    assert_eq!((counters, &domain["length_bytes"]), ((&json!(3), &json!(3)), &json!(7)));
    let lengths: Vec<usize> =
        array(&domain["areas"]).iter().map(|it| it["data"].as_str().map_or(0, str::len)).collect();
    assert_eq!(lengths.iter().sum::<usize>(), 14);
    let data = &bench.one(&["data"])["domains"];
    assert_eq!((&data[0]["length_bytes"], data[0]["data"].as_str().map(str::len)), (&json!(7), Some(14)));
    assert_eq!(bench.one(&["data", "-d1"])["domains"], json!([]));
    let master = bench.one(&["master"]);
    assert_eq!((&master["phase"], &master["active"]), (&json!("operation"), &json!(true)));
    assert_eq!((&master["reference_clock"], master["application_time_ns"].as_u64() > Some(0)), (&json!(0), true));
    let clocks = bench.one(&["clocks"]);
    assert_eq!(array(&clocks["clocks"]).iter().filter(|it| it["reference"] == true).count(), 1);
}

// covers: daemon, json
#[test]
fn each_line_names_its_master() {
    let bench = Bench::start_beside_a_waiting_master(vec![ring(4, true), ring(2, false)]);
    for command in ["master", "slaves", "pdos", "cstruct"] {
        let done = bench.tool(&[command, "--json"]);
        let masters: Vec<Value> = lines(command, &done.out).iter().map(|line| line["master"].clone()).collect();
        assert_eq!((done.code, masters), (Some(0), vec![json!(0), json!(1), json!(2)]), "{command}");
    }
    let waiting = bench.one(&["master", "-m2"]);
    assert_eq!((&waiting["phase"], &waiting["awaited_interfaces"]), (&json!("waiting"), &json!(["eth9"])));
    assert_eq!((&waiting["devices"], &waiting["common"]), (&json!([]), &Value::Null));
    let count = |line: &Value| array(&line["subdevices"]).len();
    assert_eq!(bench.json(&["slaves", "-m0-1"]).iter().map(count).collect::<Vec<_>>(), [4, 2]);

    let shown = || bench.json(&["ring", "-m0-1"]);
    bench.wait_until("a closed ring", || shown()[0]["closed"] == true);
    let [first, second] = &shown()[..] else { panic!("two masters") };
    let links = json!([{ "link": "main", "subdevices": 4, "carrier": null },
                       { "link": "redundant", "subdevices": 0, "carrier": null }]);
    let without_carrier = |links: &Value| {
        let mut links = links.clone();
        links.as_array_mut().expect("an array").iter_mut().for_each(|link| link["carrier"] = Value::Null);
        links
    };
    assert_eq!((without_carrier(&first["links"]), &first["cables"]), (links, &json!([])));
    assert_eq!((&second["closed"], array(&second["links"]).len()), (&Value::Null, 1));
    let _driver = Driver::start(&bench, |found| automatic(found, std::time::Duration::from_millis(1)));
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Cut(CableId(2))));
    let place = json!({ "near": { "position": 1, "port": 1 }, "far": { "position": 2, "port": 0 } });
    bench.wait_until("the place of the break", || shown()[0]["line_break"] == place);
    let open = &shown()[0];
    assert_eq!((&open["closed"], array(&open["cables"]).len()), (&json!(false), 5));
    assert_eq!(open["cables"][0]["near"], Value::Null);
    let slaves = bench.one(&["slaves", "-m0"]);
    let links: Vec<&Value> = array(&slaves["subdevices"]).iter().map(|it| &it["link"]).collect();
    assert_eq!(links, ["main", "main", "redundant", "redundant"]);
}

// covers: daemon, json
#[test]
fn events_are_followed_one_object_per_line_as_they_come() {
    let bench = Bench::start(vec![ring(3, true)]);
    let cut = |is_cut: bool| {
        let fault = if is_cut { Fault::Cut(CableId(1)) } else { Fault::Heal(CableId(1)) };
        bench.inside(0, move |segment| segment.network_mut().apply(fault));
    };
    let reports = |line: &Value, text: &str| line["text"].as_str().is_some_and(|it| it.contains(text));
    cut(true);
    bench.wait_until("the cut", || bench.json(&["events"]).iter().any(|line| reports(line, "ring open")));
    let listed = bench.json(&["events"]);
    assert!(listed.is_sorted_by_key(|line| line["time_ns"].as_u64()) && listed[0]["master"] == 0, "{listed:?}");
    assert!(listed.windows(2).all(|two| two[1]["number"].as_u64() > two[0]["number"].as_u64()), "{listed:?}");

    let mut follow = Command::new(PROGRAM);
    follow.args(["events", "--follow", "--json"]).env("RINGCAT_SOCKET", &bench.socket);
    let mut follow = follow.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("it starts");
    let output = BufReader::new(follow.stdout.take().expect("it is piped"));
    let (sender, received) = channel();
    std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    let wait_for = |text: &str| {
        loop {
            let line = received.recv_timeout(LONG).unwrap_or_else(|error| panic!("{text}: {error}"));
            if reports(&lines("events", &line)[0], text) {
                break;
            }
        }
    };
    wait_for("ring open");
    cut(false);
    wait_for("ring closed");
    follow.kill().expect("it runs");
    follow.wait().expect("it has ended");
}
