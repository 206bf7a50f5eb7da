//! Outputs for other programs: C for a compiler, DOT, XML, whatever the names of SubDevices hold.

use std::path::Path;
use std::process::Command;

use ringcat::sim::segment::Segment;

use crate::bench::{Bench, directory};
use crate::dot;
use crate::golden_bus::{COE_FOE, segment};

/// Texts of the SIIs, and bytes of the same length in their place: ends of comments, of strings and of sections,
/// control characters, Latin-1, UTF-8 that is cut or wrong.
const TEXTS: [(&[u8], &[u8]); 7] = [
    (b"\x06EL3102", b"\x06\"*/\\]>"),
    (b"EL3102 2Ch. Ana. Input +/-10V", b"]]><&\"'\x01\x02\x1b\xff\xc3(\xe4\xf6*/ /* ??/\n\r\t\\x"),
    (b"Channel 1", b"*/\"\\\n;}{\\"),
    (b"Channel 2", b"]]>--><!-"),
    (b"Status", b"\xed\xa0\x80*/\\"),
    (b"Value", b"<!--\x7f"),
    (b"EL2008 8Ch. Dig. Output 24V, 0.5A", b"#include <x>\n\\\n\xe2\x80\xae\xef\xbf\xbf\xc2\x85 &amp;\x0b\x0c*\\"),
];

fn replaced(bytes: &mut [u8], old: &[u8], new: &[u8]) -> bool {
    assert_eq!(old.len(), new.len(), "{}", String::from_utf8_lossy(old));
    let at = bytes.windows(old.len()).position(|window| window == old);
    at.is_some_and(|at| {
        bytes[at..at + new.len()].copy_from_slice(new);
        true
    })
}

/// The ring of the golden outputs; its texts are replaced.
fn hostile() -> Bench {
    let directory = directory();
    // It writes the SIIs.
    let _ = segment(&directory, COE_FOE);
    let mut text = "[segment]\nring = false\n".to_owned();
    let mut count = 0;
    for name in ["coupler.bin", "input.bin", "output.bin"] {
        let path = directory.join(name);
        let mut bytes = std::fs::read(&path).expect("it was written");
        count += TEXTS.iter().filter(|(old, new)| replaced(&mut bytes, old, new)).count();
        std::fs::write(path, bytes).expect("it can be written");
        text += &format!("[[device]]\nsii = \"{name}\"\n");
    }
    // Two of the texts are in both SIIs.
    assert_eq!(count, TEXTS.len() + 2);
    let segment = Segment::from_toml(&text, &directory).expect("it is right");
    Bench::start_in(directory, vec![segment])
}

/// Compiles with the C compiler of the machine, warnings being errors.
fn compile(directory: &Path, code: &str) {
    let (source, header) = (directory.join("pdos.c"), Path::new(env!("CARGO_MANIFEST_DIR")).join("../ffi/include"));
    let main = "\nint main(void) { return slave_1_syncs[0].index + slave_2_syncs[0].index; }\n";
    std::fs::write(&source, format!("#include \"ecrt.h\"\n\n{code}{main}")).expect("it can be written");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let options = ["-std=gnu99", "-Wall", "-Werror", "-c", "-o"];
    let mut command = Command::new(compiler);
    command.args(options).arg(directory.join("pdos.o")).arg("-I").arg(header).arg(&source);
    let output = command.output().expect("there is a C compiler");
    assert!(output.status.success(), "{}\n{code}", String::from_utf8_lossy(&output.stderr));
}

// covers: daemon
#[test]
fn structures_compile_whatever_names_hold() {
    let bench = hostile();
    let code = bench.good(&["cstruct"]);
    assert_eq!(code.matches("_syncs[] = {").count(), 2, "{code}");
    compile(&bench.directory, &code);
}

// covers: daemon
#[test]
fn graphs_follow_the_grammar_whatever_names_hold() {
    let bench = hostile();
    for words in [&["graph"][..], &["graph", "DC"], &["graph", "CRC"]] {
        let text = bench.good(words);
        let graph = dot::parse(&text).unwrap_or_else(|error| panic!("{words:?}: {error}\n{text}"));
        assert_eq!(graph.edges.len(), 3, "{words:?}: {text}");
        let label = graph.label("slave1").expect("it has a label");
        assert!(label.contains("\\n\\\"*/\\\\]>"), "{words:?}: {label}");
    }
}

// covers: daemon
#[test]
fn a_wrong_graph_is_found() {
    for text in ["graph a {", "graph a { b [label=\"c] }", "graph a { b -- }", "graph a { b [x] }", "a {}", "graph {}}"]
    {
        assert!(dot::parse(text).is_err(), "{text}");
    }
}

// covers: daemon
#[test]
fn descriptions_are_well_formed_whatever_names_hold() {
    let bench = hostile();
    for selection in ["0-2", "1"] {
        let text = bench.good(&["xml", "-p", selection]);
        let document = roxmltree::Document::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let texts = |tag: &'static str| {
            let nodes = document.descendants().filter(move |node| node.has_tag_name(tag));
            nodes.map(|node| node.text().unwrap_or("").to_owned()).collect::<Vec<String>>()
        };
        let orders = texts("Type");
        assert!(orders.contains(&"\"*/\\]>".to_owned()), "{orders:?}");
        let names = texts("Name");
        assert!(names.iter().any(|name| name.starts_with("]]><&\"'   ")), "{names:?}");
        assert!(names.iter().any(|name| name == "<!-- "), "{names:?}");
        assert!(names.iter().flat_map(|name| name.chars()).all(|it| !it.is_control()), "{names:?}");
    }
}

// covers: daemon
#[test]
fn all_outputs_with_names_are_utf_8_of_one_line_each() {
    let bench = hostile();
    for words in [&["slaves"][..], &["slaves", "-v"], &["pdos"], &["pdos", "-s", "etherlab"], &["crc"], &["sdos"]] {
        let done = bench.tool(words);
        assert_eq!(done.code, Some(0), "{words:?}: {done:?}");
        let text = String::from_utf8(done.bytes).expect("it is UTF-8");
        assert!(text.chars().all(|it| !it.is_control() || it == '\n'), "{words:?}: {text:?}");
    }
    assert_eq!(bench.good(&["slaves"]).lines().count(), 3);
}

// covers: daemon, json
#[test]
fn json_is_one_line_of_utf8_whatever_names_hold() {
    let bench = hostile();
    let slaves = bench.one(&["slaves", "-v"]);
    let input = &slaves["subdevices"][1];
    assert_eq!(input["order_number"], "\"*/\\]>");
    // Latin-1 is converted, as in the text; control characters stay.
    let name = "]]><&\"'\u{1}\u{2}\u{1b}\u{ff}\u{c3}(\u{e4}\u{f6}*/ /* ??/\n\r\t\\x";
    let shown = |name: &str| name.chars().map(|it| if it.is_control() { ' ' } else { it }).collect::<String>();
    assert_eq!(input["name"].as_str().map(shown), Some(shown(name)), "{input}");
    let pdos = bench.one(&["pdos"]);
    assert_eq!(pdos["subdevices"][0]["sync_managers"][3]["pdos"][0]["name"], "*/\"\\ ;}{\\");
    for command in ["xml", "graph", "cstruct"] {
        assert_eq!(bench.one(&[command])["text"], bench.good(&[command]), "{command}");
    }
}
