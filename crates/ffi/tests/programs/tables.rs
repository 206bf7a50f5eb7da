//! The tables of docs/ecrt.md as a C header, from which the conformance programs are made: what each function returns
//! in each phase, and with arguments that are wrong or extreme, each with its source.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

use crate::library::{here, program, root, workshop};

/// Columns of the first table, as the program names the phases.
const PHASES: [&str; 5] = ["opened", "requested", "active", "deactivated", "NULL"];

/// A row of an array in C: function, phase or argument, result, source.
type Row = [String; 4];

/// The rows of both tables: by phase, and by argument. A dash is no promise.
fn rows() -> (Vec<Row>, Vec<Row>) {
    let page = std::fs::read_to_string(root().join("docs/ecrt.md")).expect("docs/ecrt.md");
    let (_, tables) = page.split_once("\n## Return codes by phase\n").expect("the tables");
    let (mut by_phase, mut by_argument) = (Vec::new(), Vec::new());
    for line in tables.lines().filter(|line| line.starts_with("| `ecrt_")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let row = |when: &str, code: &str, source: &str| -> Row {
            [cells[0].trim_matches('`'), when, code, source].map(str::to_owned)
        };
        match cells[..] {
            [_, argument, code, source] => by_argument.push(row(argument, code, source)),
            [_, ref codes @ .., source] if codes.len() == PHASES.len() => {
                let cells = PHASES.into_iter().zip(codes).filter(|(_, code)| **code != "-");
                by_phase.extend(cells.map(|(phase, code)| row(phase, code, source)));
            }
            _ => panic!("expected 4 or 7 cells: {line}"),
        }
    }
    (by_phase, by_argument)
}

fn array(name: &str, rows: &[Row]) -> String {
    let mut text = format!("static struct promise {name}[] __attribute__((unused)) = {{\n");
    for row in rows {
        let quoted = row.each_ref().map(|cell| format!("\"{}\"", cell.replace('\\', "\\\\").replace('"', "\\\"")));
        writeln!(text, "    {{{}, 0}},", quoted.join(", ")).expect("a string");
    }
    text + "};\n"
}

/// A conformance program, made from the tables.
pub fn conformance(name: &str, arguments: &[&str]) -> Option<PathBuf> {
    static WRITTEN: std::sync::Once = std::sync::Once::new();
    let directory = workshop().join("tables");
    WRITTEN.call_once(|| {
        let (by_phase, by_argument) = rows();
        std::fs::create_dir_all(&directory).expect("a directory");
        let text = [
            "/* Made by tests/programs/tables.rs from docs/ecrt.md. */\n".to_owned(),
            array("by_phase", &by_phase),
            array("by_argument", &by_argument),
        ];
        std::fs::write(directory.join("tables.h"), text.concat()).expect("a file");
    });
    let include = format!("-I{}", directory.display());
    program(&here().join("tests/c").join(name), &[arguments, &[&include]].concat())
}

// covers: c-interface
#[test]
fn the_tables_of_results_have_each_function_and_no_row_twice() {
    let (by_phase, by_argument) = rows();
    assert!(by_phase.len() > 380 && by_argument.len() > 100, "{} and {}", by_phase.len(), by_argument.len());
    for rows in [&by_phase, &by_argument] {
        let mut calls: Vec<(&str, &str)> = rows.iter().map(|[function, when, ..]| (&**function, &**when)).collect();
        calls.sort_unstable();
        let twice: Vec<_> = calls.windows(2).filter(|pair| pair[0] == pair[1]).collect();
        assert!(twice.is_empty(), "{twice:?}");
        assert!(rows.iter().flatten().all(|cell| !cell.is_empty()));
    }
    // All functions that the library has, in the first table. Those without a handle are called for themselves.
    let map = std::fs::read_to_string(here().join("libethercat.map")).expect("the list of functions");
    let words = map.split(|it: char| !(it.is_ascii_alphanumeric() || it == '_'));
    let of_library: BTreeSet<&str> = words.filter(|word| word.starts_with("ecrt_")).collect();
    let without_handle = ["ecrt_read_real", "ecrt_read_lreal", "ecrt_write_real", "ecrt_write_lreal"];
    let called: BTreeSet<&str> = by_phase.iter().map(|[function, ..]| function.as_str()).collect();
    let others = without_handle.into_iter().chain(["ecrt_version_magic", "ecrt_release_master"]);
    assert_eq!(called.into_iter().chain(others).collect::<BTreeSet<_>>(), of_library);
}
