//! Control characters in files and in their names, which a terminal would interpret instead of showing them.

use crate::files::{Place, Said, ringcat};

/// Red letters: ESC and CSI of one character (ECMA-48), in a comment, a type, a name and a wrong value.
const ESI: &str = "<?xml version=\"1.0\"?>\n<EtherCATInfo><Vendor><Id>1</Id><Name>a\u{9b}31mb</Name></Vendor>\
                   <Descriptions><Groups><Group><Type>G</Type><Name>G\u{9b}31m</Name></Group></Groups><Devices>\
                   <Device Physics=\"YY\"><Type ProductCode=\"#x1\" RevisionNo=\"#x1\">T\u{9b}31m\u{202e}T</Type>\
                   <Name>N\u{9b}31m\u{200f}\u{2028}x</Name><GroupType>G</GroupType>\
                   <Eeprom><ByteSize>256</ByteSize><ConfigData>0401000000000000000000000000</ConfigData></Eeprom>\
                   </Device></Devices></Descriptions></EtherCATInfo>";

fn assert_tame(said: &Said) {
    let all = [&*said.out, &*said.errors].concat();
    let is_wild =
        |c: &char| matches!(c, '\u{200f}' | '\u{2028}' | '\u{202e}') || c.is_control() && !matches!(c, '\n' | '\t');
    let wild = all.chars().find(is_wild);
    assert_eq!(wild, None, "{:?}", said.all());
    assert!(all.len() > 20, "{}", said.all());
}

// covers: verdict, esi-read, eni-read
#[test]
fn control_characters_of_files_and_their_names_do_not_reach_the_terminal() {
    let place = Place::new("terminal");
    let good = place.write("e\u{1b}[31m\u{9b}.xml", ESI);
    let bad = place.write("bad\u{1b}[2J.xml", &ESI.replacen("Physics=\"YY\"", "Physics=\"\u{9b}31m\"", 1));
    let eni = place.write("eni\u{1b}[2J\r.xml", "<?xml version=\"1.0\"?>\n<EtherCATConfig>\u{1b}[31m</EtherCATConfig>");
    let network = place.write("machine\u{1b}[2J.toml", "ringcat_network = 1\n\"\\u001b[31m\" = 3\n");
    let folder = place.path("");
    for (command, expected) in [
        (&["esi", "list", &folder][..], 0),
        (&["esi", "show", &good], 0),
        (&["esi", "show", &bad], 2),
        (&["sii", "build", &good, "--type", "none", "--out", "-"], 2),
        (&["eni", &eni], 2),
        (&["eni", "export", "--network", &network], 2),
        (&["eni", &place.path("missing\u{1b}[2J.xml")], 2),
    ] {
        let said = ringcat(command);
        assert_tame(&said);
        assert_eq!(said.code, Some(expected), "{command:?} {:?}", said.all());
    }
    let said = ringcat(&["esi", "show", &good, "--json"]);
    assert_tame(&said);
    assert_eq!(said.code, Some(0), "{}", said.all());
    let lines: Vec<serde_json::Value> =
        said.out.lines().map(|line| serde_json::from_str(line).expect("it is JSON")).collect();
    assert!(lines.iter().any(|line| line.to_string().contains("31m\u{200f}\u{2028}x")), "{lines:?}");
    let said = ringcat(&["eni", &eni]);
    assert!(said.verdict().contains("eni\\u{1b}[2J\\r.xml: line 2"), "{}", said.all());
}

// covers: verdict
#[test]
fn readers_of_both_outputs_may_leave() {
    for (command, code) in [(&["scan", "--main", "no-such"][..], 2), (&["esi", "show", "no-such"], 2), (&["--help"], 0)]
    {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut ringcat = std::process::Command::new(env!("CARGO_BIN_EXE_ringcat"));
        ringcat.args(command).stderr(writer.try_clone().expect("a descriptor")).stdout(writer);
        assert_eq!(ringcat.status().expect("it starts").code(), Some(code), "{command:?}");
    }
}
