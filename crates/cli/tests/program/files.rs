//! Commands about descriptions of networks and devices, as a user calls them: files in, files out, differences by name.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Descriptions of an invented vendor.
pub const ACME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");

/// A folder of its own, removed on drop.
pub struct Place(PathBuf);

impl Place {
    pub fn new(name: &str) -> Place {
        let place = Place(std::env::temp_dir().join(format!("ringcat-files-{}-{name}", std::process::id())));
        fs::create_dir_all(&place.0).expect("a temporary folder");
        place
    }

    pub fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    pub fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.0.join(name), text).expect("it is writable");
        self.path(name)
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// What a command printed.
pub struct Said {
    pub code: Option<i32>,
    pub out: String,
    pub errors: String,
}

impl Said {
    /// All that was said, for messages.
    pub fn all(&self) -> String {
        format!("{:?}\n{}\n{}", self.code, self.out, self.errors)
    }

    /// The last line, which is the verdict.
    pub fn verdict(&self) -> &str {
        self.errors.lines().chain(self.out.lines()).rfind(|line| line.starts_with("result: ")).unwrap_or("")
    }
}

/// Runs the program with these arguments.
pub fn ringcat(arguments: &[&str]) -> Said {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
    let output = command.args(arguments).stdin(Stdio::null()).output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Said { code: output.status.code(), out: text(&output.stdout), errors: text(&output.stderr) }
}

/// A coupler, terminals, a drive.
fn segment(inputs: usize) -> String {
    format!(
        "[[device]]\ntype = \"coupler\"\n\n[[device]]\ntype = \"digital-input-8\"\ncount = {inputs}\n\n\
         [[device]]\ntype = \"servo\"\n"
    )
}

// covers: network-file
#[test]
fn a_network_file_is_made_of_a_scan_compared_and_never_replaced_by_chance() {
    let place = Place::new("init");
    let (bus, other) = (place.write("bus.toml", &segment(2)), place.write("other.toml", &segment(1)));
    let out = place.path("machine.toml");
    let made = ringcat(&["init", "--sim", &bus, "--out", &out]);
    assert_eq!(made.code, Some(0), "{}", made.all());
    assert!(made.verdict().starts_with("result: ok: 4 SubDevices with "), "{}", made.all());
    let text = place.read("machine.toml");
    assert!(text.starts_with("ringcat_network = 1\n") && text.contains("name = \"digital-input-8 2\""), "{text}");
    let again = ringcat(&["init", "--sim", &bus, "--out", &out]);
    assert!(again.code == Some(2) && again.verdict().contains("exists: name another file"), "{}", again.all());
    assert_eq!(place.read("machine.toml"), text, "it is as it was");
    let replaced = ringcat(&["init", "--sim", &bus, "--out", &out, "--overwrite", "--revisions", "equal"]);
    assert!(replaced.code == Some(0) && place.read("machine.toml").contains("check_revision"), "{}", replaced.all());
    let same = ringcat(&["compare", "--sim", &bus, "--network", &out]);
    assert_eq!((same.code, same.verdict()), (Some(0), "result: ok: 4 SubDevices, as in the file"), "{}", same.all());
    let differs = ringcat(&["compare", "--sim", &other, "--network", &out]);
    assert_eq!(differs.code, Some(1), "{}", differs.all());
    assert!(differs.out.contains("! missing       \"digital-input-8 2\" (position 2,"), "{}", differs.all());
    assert_eq!(differs.verdict(), "result: FAILED: 1 difference from the file, 1 of them prevent OP");
    let clocked = ringcat(&["init", "--sim", &bus, "--out", &out, "--overwrite", "--sync", "auto"]);
    let with_signals = place.read("machine.toml");
    for part in ["[clocks]", "[subdevice.sync]\nassign_activate = 0x0300\nsync0_cycle = \"1ms\""] {
        assert!(clocked.code == Some(0) && with_signals.contains(part), "{}{with_signals}", clocked.all());
    }
    let wrong = place.write("wrong.toml", &text.replacen("direction", "directoin", 1));
    let refused = ringcat(&["compare", "--sim", &bus, "--network", &wrong]);
    assert!(refused.code == Some(2) && refused.verdict().contains("wrong.toml:"), "{}", refused.all());
}

// covers: network-file, esi-use, ES-72, ES-73
#[test]
fn names_that_a_device_does_not_have_come_from_its_description() {
    let place = Place::new("names");
    let text = fs::read_to_string(format!("{ACME}/acme.xml")).expect("it is writable");
    let bare = text
        .replace("<Name>Status__Underrange</Name>", "<Name></Name>")
        .replace("<Name>AI Channel 2</Name>", "<Name></Name>")
        .replace("<Name>Value</Name><DataType>INT</DataType></Entry>", "<Name></Name></Entry>");
    assert_ne!(bare, text);
    place.write("bare.xml", &bare);
    let terminals = "[[device]]\nesi = \"bare.xml\"\ntype = \"AA02\"\n\n[[device]]\ntype = \"digital-input-8\"\n";
    let bus = place.write("bus.toml", terminals);
    fs::create_dir(place.path("esi")).expect("it is writable");
    let described = text.replacen("<Name>Status__Underrange</Name>", "<Name></Name>", 1);
    place.write("esi/acme.xml", &described);
    for folder in ["", "esi/"] {
        let modules = format!("{folder}modules/acme-modules.xml");
        fs::create_dir(place.path(&format!("{folder}modules"))).expect("it is writable");
        fs::copy(format!("{ACME}/modules/acme-modules.xml"), place.path(&modules)).expect("it is writable");
    }
    let out = place.path("machine.toml");
    let init = |more: &[&str]| ringcat(&[&["init", "--sim", &bus, "--out", &out, "--overwrite"], more].concat());
    let without = init(&[]);
    assert!(without.code == Some(0) && !place.read("machine.toml").contains("name = \"Value\""), "{}", without.all());
    let with = init(&["--esi", &place.path("esi")]);
    assert_eq!(with.code, Some(0), "{}", with.all());
    assert!(with.out.contains("1 SubDevice described, 4 names from descriptions"), "{}", with.all());
    assert!(with.errors.contains("position 1 \"digital-input-8\": no description of product"), "{}", with.all());
    let made = place.read("machine.toml");
    for part in [
        "name = \"AI Standard Channel 1\"",
        "name = \"AI Channel 2\"",
        "{ index = 0x6000, sub = 1, bits = 1, name = \"Underrange\", type = \"BOOL\" }",
        "{ index = 0x6010, sub = 17, bits = 16, name = \"Value\", type = \"INT\" }",
    ] {
        assert!(made.contains(part), "{part}: {made}");
    }
    let same = ringcat(&["compare", "--sim", &bus, "--network", &out]);
    assert_eq!(same.code, Some(0), "names are no difference: {}", same.all());
    let translated = "<Name LcId=\"1033\">AI Channel 2</Name><Name LcId=\"1031\">AE Kanal 2</Name>";
    place.write("esi/acme.xml", &described.replacen("<Name>AI Channel 2</Name>", translated, 1));
    for (language, expected) in [("1031", "AE Kanal 2"), ("3079", "AE Kanal 2"), ("1033", "AI Channel 2")] {
        let esi = place.path("esi");
        let in_it = init(&["--esi", &esi, "--language", language]);
        let made = place.read("machine.toml");
        assert!(in_it.code == Some(0) && made.contains(expected), "{language}: {}{made}", in_it.all());
        let file = format!("{esi}/acme.xml");
        let shown = ringcat(&["esi", "show", &file, "--type", "AA02", "--language", language]);
        assert!(shown.code == Some(0) && shown.out.contains(expected), "{language}: {}", shown.all());
    }
    let alone = init(&["--language", "1031"]);
    assert!(alone.code == Some(2) && alone.errors.contains("--esi"), "{}", alone.all());
    let gone = init(&["--esi", &place.path("no-such")]);
    assert!(gone.code == Some(2) && gone.verdict().contains("no-such"), "{}", gone.all());
}

/// The descriptions as those of a bus, and changed by a function for the EEPROMs of its devices.
fn with_bare_devices(place: &Place, devices: &str, bare: impl Fn(&str) -> String) -> String {
    fs::create_dir(place.path("modules")).expect("it is writable");
    let text = fs::read_to_string(format!("{ACME}/acme.xml")).expect("it is writable");
    place.write("bare.xml", &bare(&text));
    let modules = fs::read_to_string(format!("{ACME}/modules/acme-modules.xml")).expect("it is writable");
    place.write("modules/acme-modules.xml", &bare(&modules));
    place.write("bus.toml", devices)
}

/// Removes the names of all PDOs and of their entries.
fn without_names(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = ["<RxPdo", "<TxPdo"].iter().filter_map(|begin| rest.find(begin)).min() {
        let (head, tail) = rest.split_at(at);
        let end = tail.find("Pdo>").expect("it ends");
        let (mut pdo, behind) = tail.split_at(end);
        out += head;
        while let Some((before, named)) = pdo.split_once("<Name") {
            out += before;
            pdo = named.split_once("</Name>").expect("it ends").1;
        }
        out += pdo;
        rest = behind;
    }
    out + rest
}

// covers: network-file, esi-use, ES-64, ES-69
#[test]
fn pdos_of_modules_get_their_names_by_detected_idents_or_by_their_entries() {
    let place = Place::new("modules");
    let devices = "[[device]]\nesi = \"bare.xml\"\ntype = \"AM01\"\nmodules = [\"csp axis\", \"-\", \"status axis\"]\n";
    let out = place.path("machine.toml");
    let acme = format!("{ACME}/acme.xml");
    for list in [true, false] {
        let _ = fs::remove_dir_all(place.path("modules"));
        let bus = with_bare_devices(&place, devices, |text| {
            let text = without_names(text);
            if list { text } else { text.replace(" DownloadModuleIdentList=\"1\"", "") }
        });
        let init = ringcat(&["init", "--sim", &bus, "--out", &out, "--overwrite", "--esi", &acme]);
        assert_eq!(init.code, Some(0), "{}", init.all());
        assert!(init.out.contains("1 SubDevice with 2 modules described, "), "{}", init.all());
        let made = place.read("machine.toml");
        for part in [
            "index = 0x1600\nname = \"csp axis/Outputs\"",
            "index = 0x1a20\nname = \"status axis/Inputs\"",
            "{ index = 0x607a, bits = 32, name = \"Target position\", type = \"DINT\" }",
            "{ index = 0x7041, bits = 16, name = \"Statusword\", type = \"UINT\" }",
        ] {
            assert!(made.contains(part), "{list}, {part}: {made}");
        }
    }
}

/// The interface does not exist: the descriptions are looked for first, so that a wrong path changes nothing.
// covers: esi-use
#[test]
fn descriptions_that_are_not_there_are_refused_before_a_bus_is_opened() {
    for command in [&["scan"][..], &["run"], &["clocks"]] {
        let refused = ringcat(&[command, &["--main", "no-such-if", "--esi", "/no-such.xml"]].concat());
        assert_eq!(refused.code, Some(2), "{}", refused.all());
        assert!(refused.all().contains("/no-such.xml"), "{command:?}: {}", refused.all());
    }
}

// covers: network-file, esi-use
#[test]
fn differences_name_pdos_and_entries_by_the_file_else_by_the_description() {
    let place = Place::new("compared");
    let devices = "[[device]]\nesi = \"bare.xml\"\ntype = \"AA02\"\n";
    let bus = with_bare_devices(&place, devices, |text| {
        without_names(text).replace("<Name>AA02 2Ch. Analog Input</Name>", "<Name></Name>")
    });
    let out = place.path("machine.toml");
    let init = ringcat(&["init", "--sim", &bus, "--out", &out]);
    assert_eq!(init.code, Some(0), "{}", init.all());
    let text = place.read("machine.toml");
    let changed = text.replacen("index = 0x6000, sub = 17, bits = 16", "index = 0x6000, sub = 18, bits = 16", 1);
    let changed =
        changed.replacen("index = 0x6000, sub = 1, bits = 1", "index = 0x6000, sub = 1, bits = 1, name = \"Low\"", 1);
    assert_ne!(changed, text);
    let expected = place.write("expected.toml", &changed);
    let compare = |more: &[&str]| ringcat(&[&["compare", "--sim", &bus, "--network", &expected], more].concat());
    let folded = |said: &Said| said.out.split_whitespace().collect::<Vec<_>>().join(" ");
    let without = compare(&[]);
    let bare = "PDO 0x1a00, entry 3: expected 0x6000:12 of 16 bits, got 0x6000:11 of 16 bits";
    assert!(without.code == Some(1) && folded(&without).contains(bare), "{}", without.all());
    let acme = format!("{ACME}/acme.xml");
    let with = compare(&["--esi", &acme]);
    let named = "PDO 0x1a00 \"AI Standard Channel 1\", entry 3: expected 0x6000:12 \"AI Inputs Ch.1\" of 16 bits, got \
                 0x6000:11 \"Value\" of 16 bits";
    assert!(with.code == Some(1) && folded(&with).contains(named), "{}", with.all());
    assert!(with.out.lines().all(|line| line.chars().count() <= 80), "{}", with.all());
    let of_file = place.write("named.toml", &changed.replacen("index = 0x1a00", "index = 0x1a00\nname = \"Ch 1\"", 1));
    let by_file = ringcat(&["compare", "--sim", &bus, "--network", &of_file, "--esi", &acme]);
    assert!(folded(&by_file).contains("PDO 0x1a00 \"Ch 1\", entry 3: expected"), "{}", by_file.all());
    let json = compare(&["--esi", &acme, "--json"]);
    assert!(json.out.contains("AI Standard Channel 1") && json.code == Some(1), "{}", json.all());
    let gone = compare(&["--esi", &place.path("no-such")]);
    assert!(gone.code == Some(2) && gone.verdict().contains("no-such: cannot be read"), "{}", gone.all());
    let refused = place.write("broken.xml", "<EtherCATInfo>");
    let refused = compare(&["--esi", &refused]);
    assert!(refused.code == Some(2) && refused.verdict().contains("broken.xml"), "{}", refused.all());
}

// covers: esi-read, ES-29
#[test]
fn a_folder_of_descriptions_is_listed_and_searched() {
    let place = Place::new("esi");
    let list = |more: &[&str]| ringcat(&[&["esi", "list", ACME, "--no-index"], more].concat());
    let all = list(&[]);
    assert!(all.code == Some(0) && all.out.contains("AD08") && all.out.contains("acme.xml:"), "{}", all.all());
    assert!(all.verdict().starts_with("result: ok: ") && all.errors.contains("left out: "), "{}", all.all());
    let found = list(&["--find", "modular"]);
    assert!(found.out.contains("AM01") && !found.out.contains("AD08"), "{}", found.all());
    let of_bus = ["--vendor", "0xc47", "--product", "0x1008", "--revision", "0x00150000"];
    let older = list(&of_bus);
    assert!(older.out.contains("0x00120000") && older.out.contains("(older)"), "{}", older.all());
    let none = list(&["--vendor", "0xc47", "--product", "0x1008", "--revision", "0x00110000"]);
    let nearest = "result: FAILED: no description fits; that of revision 0x00120000 is newer: --newer takes it";
    assert_eq!((none.code, none.verdict()), (Some(1), nearest));
    let broken = place.write("broken.xml", "<EtherCATInfo>");
    let refused = ringcat(&["esi", "list", &place.path(""), "--no-index"]);
    assert!(refused.errors.contains("broken.xml:1: ") && refused.code == Some(1), "{broken}: {}", refused.all());
}

// covers: eni-read, network-file, esi-use, ES-07
#[test]
fn pipes_and_devices_are_refused_as_files_without_a_wait() {
    let place = Place::new("pipes");
    let (pipe, out) = (place.path("pipe.xml"), place.path("out.xml"));
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("it is there").success());
    let (image, acme) = (place.write("image.bin", "x"), format!("{ACME}/acme.xml"));
    for file in [pipe.as_str(), "/dev/zero"] {
        for arguments in [
            vec!["eni", file],
            vec!["compare", "--main", "lo", "--network", file],
            vec!["compare", "--main", "lo", "--eni", file],
            vec!["scan", "--main", "lo", "--esi", file],
            vec!["esi", "show", file],
            vec!["sii", "compare", file, "--esi", &acme],
            vec!["sii", "compare", &image, "--esi", file],
            vec!["sii", "skeleton", file, "--out", &out],
        ] {
            let said = ringcat(&arguments);
            assert!(said.code == Some(2) && said.all().contains("no regular file"), "{arguments:?}: {}", said.all());
        }
    }
    let text = fs::read_to_string(&acme).expect("it is there");
    let (start, _) = text.split_once("<Vendor>").expect("a vendor");
    let refers = format!("{start}<InfoReference>pipe.xml</InfoReference>{}", &text[start.len()..]);
    place.write("refers.xml", &refers);
    let list = ringcat(&["esi", "list", place.path(".").as_str()]);
    assert!(list.code.is_some() && list.all().contains("AD08"), "{}", list.all());
}

// covers: esi-use, ES-81, ES-102, ES-105
#[test]
fn images_are_built_compared_and_described_again() {
    let place = Place::new("sii");
    let acme = format!("{ACME}/acme.xml");
    let image = place.path("ad08.bin");
    let built = ringcat(&["sii", "build", &acme, "--type", "AD08", "--serial", "7", "--out", &image]);
    assert_eq!(built.code, Some(0), "{}", built.all());
    let same = ringcat(&["sii", "compare", &image, "--esi", &acme]);
    assert_eq!(
        (same.code, same.verdict()),
        (Some(0), "result: ok: 1 image as described, 0 with differences, 0 not compared")
    );
    // In a folder below the folder, beside files that are no descriptions.
    let below = ringcat(&["sii", "compare", &image, "--esi", &format!("{ACME}/..")]);
    assert_eq!((below.code, below.verdict()), (same.code, same.verdict()), "{}", below.all());
    let mut bytes = fs::read(&image).expect("it was written");
    bytes[0x90] ^= 0x20;
    fs::write(&image, &bytes).expect("it is writable");
    let differs = ringcat(&["sii", "compare", &image, "--esi", &acme]);
    assert!(differs.code == Some(1) && differs.out.contains("string"), "{}", differs.all());
    let skeleton = ringcat(&["sii", "skeleton", &image, "--out", &place.path("again.xml")]);
    assert!(skeleton.code == Some(0) && place.read("again.xml").contains("ProductCode"), "{}", skeleton.all());
    let bytes = fs::read(&image).expect("it is there");
    let wrong = place.path("wrong.bin");
    for (bad, reason) in [(vec![], "got 0"), ([&[bytes[0] ^ 1], &bytes[1..]].concat(), "checksum")] {
        fs::write(&wrong, bad).expect("it is writable");
        let invalid = ringcat(&["sii", "compare", &wrong, &image, "--esi", &acme]);
        let is_said = invalid.verdict().contains("wrong.bin is invalid: ") && invalid.verdict().contains(reason);
        assert!(invalid.code == Some(1) && is_said, "{}", invalid.all());
    }
    let before = (bytes.clone(), place.read("again.xml"));
    for refused in [
        ringcat(&["sii", "build", &acme, "--type", "AD08", "--out", &image]),
        ringcat(&["sii", "skeleton", &image, "--out", &place.path("again.xml")]),
    ] {
        assert!(refused.code == Some(2) && refused.verdict().contains("or add --overwrite"), "{}", refused.all());
    }
    assert_eq!((fs::read(&image).expect("it is there"), place.read("again.xml")), before);
    let again = ["sii", "skeleton", &image, "--overwrite", "--out", &place.path("again.xml")];
    assert_eq!(ringcat(&again).code, Some(0));
    let unknown = ringcat(&["sii", "build", &acme, "--type", "AD09", "--out", &place.path("none.bin")]);
    assert!(
        unknown.code == Some(2) && unknown.all().contains("there is no such device: type \"AD09\""),
        "{}",
        unknown.all()
    );
    let odd =
        place.write("odd.xml", &fs::read_to_string(&acme).unwrap().replacen("<Su Frame", "<Su Foo=\"1\" Frame", 1));
    let noted = ringcat(&["sii", "build", &odd, "--type", "AD08", "--overwrite", "--out", &image]);
    assert!(noted.code == Some(0) && noted.errors.contains("odd.xml: line 31: Su@Foo is not known"), "{}", noted.all());
}

// covers: esi-declare
#[test]
fn a_device_is_shown_and_declared_with_choices_or_refused_by_file_line_and_device() {
    let place = Place::new("declare");
    let acme = format!("{ACME}/acme.xml");
    let shown = ringcat(&["esi", "show", &acme, "--type", "AA02"]);
    assert_eq!(shown.code, Some(0), "{}", shown.all());
    for part in
        ["TxPdo       0x1a00 SM 3   32 bits \"AI Standard Channel 1\", fixed, excludes 0x1a01", "mailbox     CoE, FoE"]
    {
        assert!(shown.out.contains(part), "{}", shown.all());
    }
    let drive = ringcat(&["esi", "show", &acme, "--type", "AM01"]);
    assert!(drive.out.contains("slot        \"Axis 1\", 1 to 1: csp axis, status axis"), "{}", drive.all());
    assert!(drive.out.contains("mode        \"DC\" 0x0300 SYNC0"), "{}", drive.all());
    let out = place.path("machine.toml");
    let declare = |more: &[&str]| ringcat(&[&["esi", "declare", &acme, "--out", &out], more].concat());
    let analog = declare(&["--type", "AA02", "--with", "0x1A01", "--without", "0x1A00", "--set", "0x8000:3=2c01"]);
    assert_eq!(analog.code, Some(0), "{}", analog.all());
    assert!(analog.verdict().starts_with("result: ok: \"AA02\", 2 PDOs with 2 variables and 2 start-up commands"));
    let again = declare(&["--type", "AD08"]);
    assert!(again.code == Some(2) && again.verdict().contains("add --append or --overwrite"), "{}", again.all());
    let second = declare(&["--type", "AM01", "--mode", "DC4", "--module", "csp axis", "--name", "Axis", "--append"]);
    assert_eq!(second.code, Some(0), "{}", second.all());
    let text = place.read("machine.toml");
    for part in ["name = \"AA02\"", "name = \"Axis\"", "[clocks]", "sync0_cycle = \"250us\"", "index = 0x1a01"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let wrong = declare(&["--type", "AA02", "--without", "0x1A02", "--append"]);
    assert_eq!(wrong.code, Some(2), "{}", wrong.all());
    let reason = "device \"AA02\": PDO 0x1a02 \"AI Channel 2\": it is mandatory: it has to be assigned";
    assert!(wrong.verdict().contains("acme.xml:1") && wrong.verdict().contains(reason), "{}", wrong.all());
    assert_eq!(place.read("machine.toml"), text, "the file is as it was");
}

// covers: eni-run
#[test]
fn an_eni_is_exported_from_a_network_file_to_a_file_or_to_the_standard_output() {
    let place = Place::new("eni-export");
    let (bus, network, out) =
        (place.write("bus.toml", &segment(2)), place.path("machine.toml"), place.path("machine.xml"));
    let made = ringcat(&["init", "--sim", &bus, "--out", &network]);
    assert_eq!(made.code, Some(0), "{}", made.all());
    let export = ringcat(&["eni", "export", "--network", &network, "--out", &out]);
    assert_eq!(export.code, Some(0), "{}", export.all());
    assert!(export.verdict().starts_with("result: ok: 4 SubDevices with "), "{}", export.all());
    let text = place.read("machine.xml");
    let printed = ringcat(&["eni", "export", "--network", &network]);
    assert_eq!((printed.code, printed.out.as_str()), (Some(0), text.as_str()), "the file and nothing else");
    assert!(printed.verdict().ends_with("in the standard output"), "{}", printed.all());
    let shown = ringcat(&["eni", &out]);
    assert!(shown.code == Some(0) && shown.out.contains("digital-input-8 2"), "{}", shown.all());
    let same = ringcat(&["compare", "--sim", &bus, "--eni", &out]);
    assert_eq!(same.code, Some(0), "{}", same.all());
    let again = ringcat(&["eni", "export", "--eni", &out, "--out", "-"]);
    assert_eq!((again.code, again.out.as_str()), (Some(0), text.as_str()), "an ENI of an ENI is the same");
    let lrw = ringcat(&["eni", "export", "--network", &network, "--lrw", "always"]);
    assert!(lrw.code == Some(0) && lrw.out.contains("<Cmd>12</Cmd>"), "{}", lrw.all());
    let kept = ringcat(&["eni", "export", "--network", &network, "--out", &out, "--lrw", "always"]);
    assert!(kept.code == Some(2) && kept.verdict().contains("exists: name another file"), "{}", kept.all());
    assert_eq!(place.read("machine.xml"), text, "it is as it was");
}

// covers: eni-run
#[test]
fn a_network_that_an_eni_cannot_express_is_refused_with_the_reason_and_no_file() {
    let place = Place::new("eni-refused");
    let network = "ringcat_network = 1\n[[domain]]\nname = \"cycle\"\nperiod = \"1ms\"\n\
                   [[subdevice]]\nname = \"Drive\"\ntarget = \"PREOP\"\n";
    let (network, out) = (place.write("machine.toml", network), place.path("machine.xml"));
    let refused = ringcat(&["eni", "export", "--network", &network, "--out", &out]);
    let expected = "machine.toml:7: SubDevice \"Drive\": subdevice[0].target: PREOP: an ENI describes a network in OP";
    assert!(refused.code == Some(2) && refused.verdict().contains(expected), "{}", refused.all());
    assert!(!std::path::Path::new(&out).exists());
    let json = ringcat(&["--json", "eni", "export", "--network", &network]);
    assert!(json.code == Some(2) && json.verdict().contains("name a file with --out"), "{}", json.all());
}

// covers: eni-run
#[test]
fn settings_that_an_eni_does_not_hold_are_listed_once_for_all_subdevices() {
    let place = Place::new("left-out");
    let devices = "[[device]]\ntype = \"digital-output-8\"\ncount = 30\n";
    let bus = place.write("bus.toml", &format!("[segment]\n{devices}"));
    let out = place.path("machine.toml");
    let made = ringcat(&["init", "--sim", &bus, "--out", &out]);
    assert_eq!(made.code, Some(0), "{}", made.all());
    let exported = ringcat(&["eni", "export", "--network", &out, "--out", &place.path("machine.xml")]);
    assert_eq!(exported.code, Some(0), "{}", exported.all());
    let all = exported.all();
    let lines: Vec<&str> = all.lines().filter(|line| line.contains("not in the ENI: ")).collect();
    assert_eq!(lines.len(), 1, "{all}");
    // The name of the first one is its order code.
    let named =
        (1..=8).map(|index| format!("{index} \"digital-output-8 {}\"", index + 1)).collect::<Vec<_>>().join(", ");
    assert!(lines[0].contains(&format!("29 SubDevices ({named}, ...): order_code: ")), "{all}");
    // Process data that the file leaves to the EEPROM.
    let text = std::fs::read_to_string(&out).expect("it was written");
    let of_simple = |part: &str| !part.starts_with("subdevice.sync_manager");
    let parts: Vec<&str> = text.split("[[").filter(|part| of_simple(part)).collect();
    let without = place.write("without.toml", &parts.join("[["));
    let exported = ringcat(&["eni", "export", "--network", &without, "--out", &place.path("without.xml")]);
    assert_eq!(exported.code, Some(0), "{}", exported.all());
    let all = exported.all();
    let lines: Vec<&str> = all.lines().filter(|line| line.contains("sync_manager: ")).collect();
    assert_eq!(lines.len(), 1, "{all}");
    assert!(lines[0].contains("30 SubDevices (0 \"digital-output-8\", 1 \"digital-output-8 2\""), "{all}");
}
