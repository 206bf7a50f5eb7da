//! `--json` of the commands that need no network interface, and of every command that cannot do what was asked. Those
//! that need one are in `crates/scenarios/tests/on_the_wire`.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::documented::Page;

fn ringcat(line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
    command.args(line.split(' ')).stdin(Stdio::null()).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

// covers: json
#[test]
fn a_demonstration_prints_events_and_a_result_with_the_documented_keys() {
    let output = ringcat("demo --fast --json");
    let (said, errors) = (text(&output.stdout), text(&output.stderr));
    let result = Page::read().check("demo", &said);
    assert_eq!((result["result"]["outcome"].as_str(), output.status.code()), (Some("ok"), Some(0)), "{errors}");
    assert_eq!(result["subdevices"].as_array().map(Vec::len), Some(19));
    assert!(result["states"].as_array().expect("states").iter().all(|state| state["state"] == "OP"));
    assert!(result["checks"].as_array().expect("checks").iter().all(|check| check["held"] == true));
    assert!(said.contains("\"event\":\"ScanFinished\""), "{said}");
    assert_eq!(errors, "result: ok: everything held\n", "the last line for people");
}

// covers: json, demo, standby
#[cfg(feature = "standby")]
#[test]
fn a_demonstration_of_two_controllers_prints_the_documented_keys() {
    let output = ringcat("demo --standby --fast --json");
    let (said, errors) = (text(&output.stdout), text(&output.stderr));
    let result = Page::read().check("demo --standby", &said);
    assert_eq!((result["result"]["outcome"].as_str(), output.status.code()), (Some("ok"), Some(0)), "{errors}");
    assert_eq!((result["active"].as_str(), result["time_out_cycles"].as_u64()), (Some("A"), Some(3)));
    let incidents = result["incidents"].as_array().expect("incidents");
    let within =
        |it: &Value| it["longest_ns"].as_u64() > Some(0) && it["longest_ns"].as_u64() <= it["limit_ns"].as_u64();
    assert!(incidents.len() == 8 && incidents.iter().all(within), "{incidents:#?}");
    let lamps = &result["subdevices"][2];
    assert_eq!((lamps["name"].as_str(), lamps["longest_ns"].as_array().map(Vec::len)), (Some("lamps"), Some(8)));
    assert!(said.contains("\"event\":\"TookOver\""), "{said}");
}

// covers: json
#[test]
fn a_file_is_printed_with_the_documented_keys() {
    let page = Page::read();
    for file in ["ringcat/examples/machine.eni.xml", "config/tests/files/small.xml"] {
        let output = ringcat(&format!("--json eni {}/../{file}", env!("CARGO_MANIFEST_DIR")));
        let result = page.check("eni", &text(&output.stdout));
        assert_eq!((result["result"]["exit_code"].as_i64(), output.status.code()), (Some(0), Some(0)), "{file}");
        assert!(result["subdevices"].as_array().is_some_and(|subdevices| subdevices.len() >= 4), "{file}");
    }
}

/// A directory of its own, removed at the end.
struct Directory(PathBuf);

impl Directory {
    fn new(name: &str) -> Directory {
        let path = std::env::temp_dir().join(format!("ringcat-json-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the temporary directory is writable");
        Directory(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

impl Drop for Directory {
    fn drop(&mut self) {
        let removed = std::fs::remove_dir_all(&self.0);
        assert!(removed.is_ok() || std::thread::panicking());
    }
}

/// A command that ends well, its result held against the page.
fn good(page: &Page, command: &str, options: &str) -> Value {
    let output = ringcat(&format!("--json {command} {options}"));
    let (printed, errors) = (text(&output.stdout), text(&output.stderr));
    let result = page.check(command, &printed);
    assert_eq!((result["result"]["outcome"].as_str(), output.status.code()), (Some("ok"), Some(0)), "{errors}");
    result
}

// covers: json, esi-read, esi-use, esi-declare
#[test]
fn descriptions_and_images_are_printed_with_the_documented_keys() {
    let page = Page::read();
    let directory = Directory::new("esi");
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");
    let esi = format!("{folder}/outputs.xml");
    let image = directory.file("image.bin");
    let list = good(&page, "esi list", &format!("{folder} --vendor 0x1ff --product 0x10002 --revision 3"));
    assert_eq!(list["devices"][0]["type"], "A2", "{list}");
    assert_eq!(list["devices"][0]["choice"], "exact", "{list}");
    assert!(list["files"].as_u64() >= Some(4), "{list}");
    let shown = good(&page, "esi show", &format!("{folder}/acme.xml --type AM01"));
    let first = |key: &str| shown[key][0]["name"].as_str().map(str::to_owned);
    assert_eq!((first("modes"), first("slots")), (Some("FreeRun".into()), Some("Axis 1".into())), "{shown}");
    let out = directory.file("machine.toml");
    let declared = good(&page, "esi declare", &format!("{folder}/acme.xml --type AM01 --mode DC4 --out {out}"));
    assert_eq!((declared["mode"].as_str(), declared["name"].as_str()), (Some("DC4"), Some("AM01")), "{declared}");
    let bare = good(&page, "esi declare", &format!("{folder}/acme.xml --type AK10 --out {out} --append"));
    assert!(bare["mode"].is_null() && bare["pdos"] == 0, "{bare}");
    let built = good(&page, "sii build", &format!("{esi} --out {image}"));
    assert_eq!(built["bytes"], 512, "{built}");
    let compared = good(&page, "sii compare", &format!("{image} --esi {esi}"));
    assert_eq!(compared["images"][0]["outcome"], "identical", "{compared}");
    let skeleton = good(&page, "sii skeleton", &format!("{image} --out {}", directory.file("skeleton.xml")));
    assert!(skeleton["bytes"].as_u64() > Some(200), "{skeleton}");
}

// covers: json, network-file
#[test]
fn a_network_file_and_its_differences_are_printed_with_the_documented_keys() {
    let page = Page::read();
    let directory = Directory::new("network");
    let (segment, other) = (directory.file("segment.toml"), directory.file("other.toml"));
    let file = directory.file("network.toml");
    let devices = |kinds: [&str; 2]| kinds.map(|kind| format!("[[device]]\ntype = \"{kind}\"\n")).concat();
    std::fs::write(&segment, devices(["coupler", "digital-output-8"])).expect("it is writable");
    std::fs::write(&other, devices(["coupler", "servo"])).expect("it is writable");
    let init = good(&page, "init", &format!("--sim {segment} --out {file}"));
    assert_eq!((init["subdevices"].as_u64(), init["digest"].as_str().map(str::len)), (Some(2), Some(64)), "{init}");
    let eni = directory.file("network.xml");
    let export = good(&page, "eni export", &format!("--network {file} --out {eni}"));
    assert_eq!((export["subdevices"].as_u64(), export["lrw"].as_bool()), (Some(2), Some(false)), "{export}");
    let same = good(&page, "compare", &format!("--sim {segment} --network {file}"));
    assert_eq!(same["differences"].as_array().map(Vec::len), Some(0), "{same}");
    let output = ringcat(&format!("--json compare --sim {other} --network {file}"));
    let different = page.check("compare", &text(&output.stdout));
    assert_eq!((different["result"]["outcome"].as_str(), output.status.code()), (Some("failed"), Some(1)));
    assert!(different["differences"].as_array().is_some_and(|them| !them.is_empty()), "{different}");
}

/// Each heading of a command has to be named in a test that holds its output against the table.
// covers: json
#[test]
fn the_output_of_each_command_on_the_page_is_checked_by_a_test() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../");
    let read = |path: &str| std::fs::read_to_string(format!("{root}{path}")).expect("the file is there");
    let tests = read("cli/tests/program/json.rs")
        + &read("cli/tests/program/doctor.rs")
        + &read("scenarios/tests/on_the_wire/json.rs")
        + &read("scenarios/tests/on_the_wire/remote.rs");
    let page = read("../docs/json.md");
    let heading = |line: &str| Some(line.strip_prefix("### `")?.strip_suffix('`')?.to_owned());
    let commands: Vec<String> = page.lines().filter_map(heading).collect();
    assert!(commands.len() >= 17, "{commands:?}");
    let unchecked: Vec<&String> = commands.iter().filter(|name| !tests.contains(&format!("\"{name}\""))).collect();
    assert!(unchecked.is_empty(), "{unchecked:?}");
}

// covers: json, verdict
#[test]
fn what_cannot_be_done_is_an_object_too() {
    let page = Page::read();
    let file = std::env::temp_dir().join(format!("ringcat-json-{}.toml", std::process::id()));
    let commands = [
        "scan --main no-such",
        "run --main no-such",
        "ring --main no-such",
        "clocks --main no-such",
        "doctor --main no-such",
        "capture --main no-such --out /tmp/never.pcapng",
        "sim --main no-such --segment FILE",
        "standby --main no-such --redundant no-such-2",
        "remote 127.0.0.1:1 --token FILE.missing",
        "init --main no-such --out /tmp/never.toml",
        "compare --main no-such --network FILE.missing",
        "eni FILE.xml",
        "eni export --network FILE.missing --out /tmp/never.xml",
        "esi list FILE.missing",
        "esi show FILE.missing",
        "esi declare FILE.missing --out /tmp/never.toml",
        "sii build FILE.missing --out /tmp/never.bin",
        "sii compare FILE.missing --esi FILE.missing",
        "sii skeleton FILE.missing --out /tmp/never.xml",
        "demo --segment FILE.missing",
        "demo --standby --segment FILE.missing",
        "bench echo --main no-such",
        "bench round-trip --main no-such",
        "bench cycles --main no-such",
        "bench rate --main no-such",
        "run --main lo --cycle 1us",
        "nonsense",
    ];
    std::fs::write(&file, "[[device]]\ntype = \"coupler\"\n").expect("the temporary directory is writable");
    let mut named = std::collections::BTreeSet::new();
    for line in commands {
        let output = ringcat(&format!("{} --json", line.replace("FILE", &file.display().to_string())));
        let command = match line.split(' ').collect::<Vec<_>>().as_slice() {
            [group @ ("bench" | "esi" | "sii"), what, ..] => format!("{group} {what}"),
            ["eni", "export", ..] => "eni export".to_owned(),
            [command, ..] => (*command).to_owned(),
            [] => String::new(),
        };
        named.insert(command.clone());
        let result = page.check(&command, &text(&output.stdout));
        let (outcome, message) = (&result["result"]["outcome"], result["result"]["message"].as_str().unwrap_or("none"));
        assert_eq!((outcome.as_str(), output.status.code()), (Some("error"), Some(2)), "{line}");
        assert!(text(&output.stderr).ends_with(&format!("result: FAILED: {message}\n")), "{line}: {message}");
    }
    std::fs::remove_file(&file).expect("it was just written");
    for command in all_commands() {
        assert!(named.contains(&command), "`{command}` is missing in the list");
    }
}

/// Every command that the help names, with those of a group.
fn all_commands() -> Vec<String> {
    let under = |line: &str| -> Vec<String> {
        let output = text(&ringcat(line).stdout);
        let list = output.split("Commands:").nth(1).unwrap_or_default().split("\n\n").next().unwrap_or_default();
        let names = list.lines().filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
        names.filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
    };
    let mut all = Vec::new();
    for command in under("-h").into_iter().filter(|command| command != "help") {
        match under(&format!("{command} -h")) {
            none if none.is_empty() => all.push(command),
            some => all.extend(some.iter().filter(|it| *it != "help").map(|it| format!("{command} {it}"))),
        }
    }
    assert!(all.len() > 15, "{all:?}");
    all
}

// covers: json
#[test]
fn help_and_version_are_an_object_too() {
    let version = format!("ringcat {}", env!("CARGO_PKG_VERSION"));
    for (line, message) in [("help", "help"), ("run --help", "help"), ("--version", version.as_str())] {
        let output = ringcat(&format!("--json {line}"));
        let said = text(&output.stdout);
        let result: serde_json::Value = serde_json::from_str(said.trim()).expect("one object and nothing else");
        assert_eq!((result["result"]["outcome"].as_str(), output.status.code()), (Some("ok"), Some(0)), "{line}");
        assert_eq!(result["result"]["message"], message, "{line}");
        let details = result["result"]["details"].as_array().expect("lines");
        // The path of the program, in a line of its own, may be longer.
        let wide = |text: &&str| text.chars().count() > 80 && !text.contains(env!("CARGO_BIN_EXE_ringcat"));
        let wide: Vec<&str> = details.iter().filter_map(|text| text.as_str()).filter(wide).collect();
        assert_eq!(wide, [""; 0], "{line}");
    }
}
