//! Symbols with their versions, layout of the structures, and the header in several languages.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use crate::library::{here, library, program, run};

/// Exported functions with their versions.
fn exported(library: &Path) -> BTreeMap<String, String> {
    let symbols = run(Command::new("nm").args(["-D", "--defined-only", "--with-symbol-versions"]).arg(library));
    let mut exported = BTreeMap::new();
    for line in symbols.lines() {
        let (kind, name) = line.split_once(' ').and_then(|(_, rest)| rest.split_once(' ')).expect(line);
        if kind == "A" {
            continue;
        }
        let (name, version) = name.split_once("@@").expect(line);
        exported.insert(name.to_owned(), version.to_owned());
    }
    exported
}

// covers: c-interface
#[test]
fn both_libraries_export_the_103_functions_and_libethercat_those_of_ringcat_h() {
    let Some(library) = library() else { return };
    let facts = include_str!("../facts/ecrt_symbol_versions.csv");
    let facts = facts.lines().skip(1).filter_map(|line| line.split_once(','));
    let wanted: BTreeMap<String, String> = facts.map(|(name, version)| (name.into(), version.into())).collect();
    assert_eq!(wanted.len(), 103);
    for name in ["libethercat.so.1", "libfakeethercat.so.1"] {
        let library = library.with_file_name(name);
        let mut wanted = wanted.clone();
        if name == "libethercat.so.1" {
            let first = ["domain", "load_network", "subdevice", "variable"].map(|name| (name, "RINGCAT_1"));
            let second = ["load_eni", "load_eni_data", "load_network_data"].map(|name| (name, "RINGCAT_2"));
            let third = [("receive_again_at", "RINGCAT_3")];
            let added = first.into_iter().chain(second).chain(third);
            wanted.extend(added.map(|(name, version)| (format!("ringcat_master_{name}"), version.to_owned())));
            wanted.insert("ringcat_domain_send_again".to_owned(), "RINGCAT_3".to_owned());
        }
        assert_eq!(exported(&library), wanted, "{name}");
        let headers = run(Command::new("readelf").arg("-d").arg(library));
        assert!(headers.contains(&format!("[{name}]")) && headers.contains("NODELETE"), "{headers}");
    }
}

// covers: c-interface
#[test]
fn the_headers_are_clean_in_c99_c11_and_cpp17() {
    if library().is_none() {
        return;
    }
    let compilers = [("cc", "c99", "c"), ("cc", "c11", "c"), ("c++", "c++17", "c++")];
    for (source, (compiler, standard, language)) in
        ["header.c", "header_ringcat.c"].iter().flat_map(|source| compilers.map(|compiler| (source, compiler)))
    {
        let source = here().join("tests/c").join(source);
        let mut command = Command::new(compiler);
        command.args([&format!("-std={standard}"), "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]);
        command.args(["-x", language]).arg("-I").arg(here().join("include")).arg(&source);
        run(&mut command);
    }
}

/// What `crates/ffi/reference` makes pages of.
// covers: c-interface
#[test]
fn each_function_of_the_facts_has_a_comment_with_phases_and_what_it_returns() {
    let header = std::fs::read_to_string(here().join("include/ecrt.h")).expect("the header");
    let facts = include_str!("../facts/ecrt_symbol_versions.csv");
    let mut wrong = Vec::new();
    for (name, _) in facts.lines().skip(1).filter_map(|line| line.split_once(',')) {
        let call = format!("{name}(");
        let declared = header.match_indices(&call).filter_map(|(at, _)| {
            let (before, line) = header[..at].rsplit_once('\n')?;
            line.strip_prefix("EC_PUBLIC_API ").map(|kind| (before, kind))
        });
        let Some((before, kind)) = declared.last() else {
            wrong.push(format!("{name}: not declared"));
            continue;
        };
        // The comment ends in the line before.
        let comment = before.rsplit_once("/**").filter(|_| before.ends_with("*/")).map_or("", |(_, text)| text);
        let is_whole = comment.matches("*/").count() == 1 && comment.contains("Phases: ");
        if !is_whole || comment.contains("@return ") == (kind == "void ") {
            wrong.push(format!("{name}: {comment}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

// covers: c-interface
#[test]
fn doxygen_makes_the_reference_without_a_warning() {
    if Command::new("doxygen").arg("--version").output().is_err() {
        eprintln!("skipped: doxygen is not installed");
        return;
    }
    let to = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c-reference");
    let _ = std::fs::remove_dir_all(&to);
    run(Command::new(here().join("reference")).arg(&to));
    assert!(to.join("index.html").is_file());
    let page = std::fs::read_to_string(to.join("ecrt_8h.html")).expect("the page of a header");
    let facts = include_str!("../facts/ecrt_symbol_versions.csv");
    for (name, _) in facts.lines().skip(1).filter_map(|line| line.split_once(',')) {
        assert!(page.contains(&format!(">{name}</a>")), "{name}");
    }
}

/// On processors with pointers of 32 bits too, for which `ci/cross-examples` compiles it.
// covers: c-interface
#[test]
fn the_compiler_agrees_with_the_layout_of_the_structures() {
    if library().is_none() {
        return;
    }
    let mut command = Command::new("cc");
    command.args(["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I"]);
    run(command.arg(here().join("include")).arg(here().join("tests/c/layout.c")));
    let layout = std::fs::read_to_string(here().join("tests/c/layout.c")).expect("the file");
    let facts = include_str!("../facts/ecrt_abi_x86_64.txt");
    assert_eq!(layout.lines().filter(|line| line.starts_with("HAS(")).count(), facts.lines().count());
}

// covers: c-interface
#[cfg(target_arch = "x86_64")]
#[test]
fn structures_have_the_sizes_and_offsets_that_programs_were_compiled_with() {
    let facts = include_str!("../facts/ecrt_abi_x86_64.txt");
    let mut source = String::from("#include <stddef.h>\n#include <stdio.h>\n#include \"ecrt.h\"\nint main(void) {\n");
    let mut structure = "";
    for line in facts.lines() {
        let (name, _) = line.rsplit_once(' ').expect(line);
        let (name, expression) = match name.trim().strip_prefix('.') {
            Some(member) => (name, format!("offsetof({structure}, {member})")),
            None => {
                structure = name;
                (name, format!("sizeof({structure})"))
            }
        };
        let at = if name.starts_with(' ') { "@" } else { "" };
        source += &format!("printf(\"{name} {at}%zu\\n\", {expression});\n");
    }
    source += "return 0; }\n";
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("layout.c");
    std::fs::write(&file, source).expect("a file");
    let Some(layout) = program(&file, &[]) else { return };
    assert_eq!(run(&mut Command::new(layout)), facts);
}
