//! `--json` of the commands that need no network interface, and of every command that cannot do what was asked. Those
//! that need one are in `crates/scenarios/tests/on_the_wire`.

use std::process::{Command, Output, Stdio};

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
        "capture --main no-such --out /tmp/never.pcapng",
        "sim --main no-such --segment FILE",
        "standby --main no-such --redundant no-such-2",
        "init --main no-such --out /tmp/never.toml",
        "compare --main no-such --network FILE.missing",
        "eni FILE.xml",
        "esi list FILE.missing",
        "esi show FILE.missing",
        "esi declare FILE.missing --out /tmp/never.toml",
        "sii build FILE.missing --out /tmp/never.bin",
        "sii compare FILE.missing --esi FILE.missing",
        "sii skeleton FILE.missing --out /tmp/never.xml",
        "demo --segment FILE.missing",
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
