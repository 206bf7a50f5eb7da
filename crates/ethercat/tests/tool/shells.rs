//! Completion scripts and manual pages in the programs that they are for, where those are there.

use std::process::{Command, Stdio};

use ethercat::commands::ALL;
use ethercat::{completion, manual};

use crate::bench::directory;

/// What bash offers for the last of these words.
fn offered(words: &[&str]) -> Vec<String> {
    let line: Vec<String> = words.iter().map(|word| format!("'{word}'")).collect();
    let script = format!(
        "set -eu\n{}\nCOMP_WORDS=({})\nCOMP_CWORD={}\n_ethercat\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"\n",
        completion::bash(),
        line.join(" "),
        words.len() - 1
    );
    let output = Command::new("bash").arg("-c").arg(script).output().expect("there is bash");
    assert!(output.status.success() && output.stderr.is_empty(), "{words:?}: {output:?}");
    String::from_utf8(output.stdout).expect("it is text").lines().map(str::to_owned).collect()
}

// covers: daemon
#[test]
fn bash_offers_commands_and_their_options() {
    assert_eq!(offered(&["ethercat", "sl"]), ["slaves"]);
    assert_eq!(offered(&["ethercat", "-m", "0", "sii"]), ["sii_read", "sii_write"]);
    assert_eq!(offered(&["ethercat", "pdos", "--s"]), ["--skin", "--sim"]);
    assert_eq!(offered(&["ethercat", "crc", "r"]), ["reset"]);
    assert_eq!(offered(&["ethercat", "--quiet", "reg_write", "--em"]), ["--emergency"]);
    let all = offered(&["ethercat", ""]);
    assert!(ALL.iter().all(|command| all.iter().any(|word| word == command.name)), "{all:?}");
}

const KEYS: [&str; 5] = ["ip_address", "mac_address", "default_gateway", "dns_address", "hostname"];

// covers: daemon
#[test]
fn bash_offers_the_values_of_options_and_arguments() {
    let all = ["INIT", "PREOP", "BOOT", "SAFEOP", "OP"];
    assert_eq!(offered(&["ethercat", "states", ""]), all);
    assert_eq!(offered(&["ethercat", "states", "-p", "1", "S"]), ["SAFEOP"]);
    assert_eq!(offered(&["ethercat", "upload", "-t", "uint1"]), ["uint16"]);
    assert_eq!(offered(&["ethercat", "upload", "--type", "=", "uint1"]), ["uint16"]);
    assert_eq!(offered(&["ethercat", "upload", "--type", "="]).len(), ethercat::data_types::ALL.len());
    assert_eq!(offered(&["ethercat", "pdos", "-s", ""]), ["default", "etherlab"]);
    assert_eq!(offered(&["ethercat", "graph", ""]), ["DC", "CRC"]);
    assert_eq!(offered(&["ethercat", "ip", "-p1", ""]), KEYS);
    assert_eq!(offered(&["ethercat", "ip", "hostname", "axis", "d"]), ["default_gateway", "dns_address"]);
    let nothing = [""];
    assert_eq!(offered(&["ethercat", "ip", "hostname", "d"]), nothing);
    assert_eq!(offered(&["ethercat", "slaves", "-p", ""]), nothing);
    for option in ["--main", "--redundant"] {
        assert!(offered(&["ethercat", "slaves", option, ""]).contains(&"lo".to_owned()), "{option}");
    }
    assert_eq!(offered(&["ethercat", "slaves", "--sim", "Carg"]), ["Cargo.toml"]);
    assert_eq!(offered(&["ethercat", "sii_write", "Carg"]), ["Cargo.toml"]);
}

// covers: daemon
#[test]
fn fish_and_zsh_offer_the_values_of_options_and_arguments() {
    let directory = directory();
    let path = directory.join("ethercat.fish");
    std::fs::write(&path, completion::fish()).expect("it can be written");
    let types: Vec<&str> = ethercat::data_types::ALL.iter().map(|it| it.name).collect();
    for (line, wanted) in [
        ("ethercat states ", &["INIT", "PREOP", "BOOT", "SAFEOP", "OP"][..]),
        ("ethercat upload -t ", &types),
        ("ethercat pdos --skin ", &["default", "etherlab"]),
        ("ethercat graph ", &["DC", "CRC"]),
        ("ethercat ip ", &KEYS),
        ("ethercat slaves --main ", &["lo"]),
        ("ethercat slaves --sim Carg", &["Cargo.toml"]),
    ] {
        let script = format!("source {}; complete -C '{line}'", path.display());
        let Ok(output) = Command::new("fish").args(["--no-config", "-c", &script]).output() else {
            println!("fish is not there: it was not asked");
            break;
        };
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let has = |word: &&&str| text.lines().any(|line| line.split('\t').next() == Some(**word));
        assert_eq!(wanted.iter().filter(has).count(), wanted.len(), "{line}: {output:?}");
    }
    let zsh = completion::zsh();
    for part in [
        ":skin:(default etherlab)'",
        ":interface:_net_interfaces'",
        ":file:_files'",
        "'1::argument:(INIT PREOP BOOT SAFEOP OP)'",
        "'1::argument:(DC CRC)'",
        "'3::argument:(ip_address mac_address default_gateway dns_address hostname)'",
        &format!(":type:({})'", types.join(" ")),
    ] {
        assert!(zsh.contains(part), "{part}: {zsh}");
    }
    std::fs::remove_dir_all(directory).expect("it is writable");
}

/// Whether a program accepts a file without a message; true where the program is not installed.
fn takes(program: &str, options: &[&str], file: &std::path::Path) -> bool {
    let output = Command::new(program).args(options).arg(file).stdin(Stdio::null()).output();
    let Ok(output) = output else {
        println!("{program} is not there: {} was not checked", file.display());
        return true;
    };
    println!("{program} {}: {}{}", file.display(), output.status, String::from_utf8_lossy(&output.stderr));
    output.status.success() && output.stderr.is_empty()
}

// covers: daemon
#[test]
fn scripts_and_pages_are_taken_by_their_programs() {
    let directory = directory();
    for (program, name, text) in
        [("bash", "ethercat.bash", completion::bash()), ("zsh", "_ethercat", completion::zsh())].into_iter().chain([(
            "fish",
            "ethercat.fish",
            completion::fish(),
        )])
    {
        let path = directory.join(name);
        std::fs::write(&path, &text).expect("it can be written");
        assert!(takes(program, &["-n"], &path), "{program}");
        for command in ALL {
            assert!(text.contains(command.name), "{name}: {}", command.name);
        }
    }
    let pages = manual::pages();
    assert_eq!(pages.len(), ALL.len() + 1);
    for (name, page) in pages {
        let path = directory.join(name);
        std::fs::write(&path, &page).expect("it can be written");
        assert!(takes("groff", &["-man", "-Tutf8", "-ww", "-z"], &path), "{page}");
        assert!(takes("mandoc", &["-Tlint", "-Wwarning"], &path), "{page}");
    }
    std::fs::remove_dir_all(directory).expect("it is writable");
}
