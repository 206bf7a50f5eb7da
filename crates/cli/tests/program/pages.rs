//! Pages for users name what the program has.

use std::process::Command;

/// Names of the commands in the help of the program.
fn commands() -> Vec<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_ringcat")).arg("--help").output().expect("the program starts");
    let help = String::from_utf8_lossy(&output.stdout).into_owned();
    let list = help.split_once("Commands:\n").expect("a list of commands").1;
    let lines = list.lines().take_while(|line| !line.is_empty());
    // Further lines of a text are indented more.
    let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

// covers: run
#[test]
fn the_first_page_for_users_names_each_command() {
    let page = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/getting-started.md"));
    let commands = commands();
    assert!(commands.len() > 14, "{commands:?}");
    let missing: Vec<&String> =
        commands.iter().filter(|name| *name != "help" && !page.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
