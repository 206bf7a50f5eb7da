//! Memory that hostile files take until they are refused: descriptions (ESI), configurations (ENI), network files. The
//! peak is bounded by the size of the file, whatever the file announces.

use ringcat::config::esi;
use ringcat::eni::EniFile;
use ringcat::network::NetworkFile;
use scenarios::counting_allocator::{CountingAllocator, counts, restart_peak};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Bytes of memory for each byte of a file: the tree of a document, a copy of the text, and the model.
const FACTOR: i64 = 128;
/// Memory that does not depend on the file.
const BASE: i64 = 256 << 10;
/// Bytes of a long text.
const LONG: usize = 1_100_000;

/// The error of a file, whose memory is bounded.
fn refused<T, E: std::fmt::Display>(what: &str, bytes: &[u8], read: impl FnOnce(&[u8]) -> Result<T, E>) -> String {
    let before = counts().bytes;
    restart_peak();
    let error = match read(bytes) {
        Ok(_) => panic!("{what} is taken"),
        Err(error) => error.to_string(),
    };
    let (peak, size) = (counts().peak - before, bytes.len() as i64);
    println!("{what}: {size} bytes, peak {peak}, {:.1} for each", peak as f64 / size.max(1) as f64);
    assert!(peak <= FACTOR * size + BASE, "{what}: {peak} bytes for a file of {size}");
    assert!(error.len() < 1_000, "{what}: {error}");
    error
}

/// Files of XML that no reader takes: what is wrong, and the file with `root` around it.
fn documents(root: &str) -> Vec<(&'static str, Vec<u8>)> {
    let within = |text: &str| format!("<{root}>\n{text}\n</{root}>").into_bytes();
    let entities: String = (1..100).map(|n| format!("<!ENTITY a{n} \"&a{0};&a{0};\">", n - 1)).collect();
    let attributes: String = (0..100_000).map(|n| format!(" a{n}=\"1\"")).collect();
    let mut bad = within(&"<a/>".repeat(10));
    bad.push(0xFF);
    vec![
        ("levels", [&b"<a>".repeat(1_000_000)[..], &b"</a>".repeat(1_000_000)].concat()),
        ("open elements", b"<a>".repeat(1_000_000)),
        ("entities", format!("<!DOCTYPE x [{entities}]>\n<{root}>&a99;</{root}>").into_bytes()),
        ("attributes", within(&format!("<a{attributes}/>"))),
        ("a long attribute", within(&format!("<a b=\"{}\"/>", "x".repeat(LONG)))),
        ("a long text", within(&format!("<a>{}</a>", "x".repeat(LONG)))),
        ("a long name", within(&format!("<{}/>", "x".repeat(LONG)))),
        ("empty elements", within(&"<a/>".repeat(300_000))),
        ("comments", within(&"<!---->".repeat(200_000))),
        ("a truncated file", within(&"<a>x</a>".repeat(100_000))[..700_000].to_vec()),
        ("a byte that is no text", bad),
        ("half a character", vec![0xFF, 0xFE, b'<', 0, 0]),
        ("no markup", vec![b' '; LONG]),
    ]
}

// covers: esi-read, ES-04
#[test]
fn a_refused_description_takes_memory_in_proportion_to_its_size() {
    for (what, bytes) in documents("EtherCATInfo") {
        refused(what, &bytes, |bytes| esi::read("bad.xml", bytes));
    }
    let device = |more: &str| {
        let head = "<Vendor><Id>1</Id><Name>A</Name></Vendor><Descriptions><Groups/><Devices><Device Physics=\"YY\">";
        let kind = "<Type ProductCode=\"1\" RevisionNo=\"1\">A</Type>";
        format!("<EtherCATInfo>{head}{kind}{more}</Device></Devices></Descriptions></EtherCATInfo>")
    };
    // A number of elements, of bytes and of bits that no memory has.
    let array =
        "<DataType><Name>A</Name><ArrayInfo><LBound>0</LBound><Elements>4000000000</Elements></ArrayInfo></DataType>";
    let dictionary = format!("<Profile><Dictionary><DataTypes>{array}</DataTypes></Dictionary></Profile>");
    let error = refused("an array", device(&dictionary).as_bytes(), |bytes| esi::read("bad.xml", bytes));
    assert!(error.contains("elements of an array"), "{error}");
    let eeprom = device("<Eeprom><ByteSize>4000000000</ByteSize></Eeprom>");
    let error = refused("an EEPROM", eeprom.as_bytes(), |bytes| esi::read("bad.xml", bytes));
    assert!(error.contains("ByteSize"), "{error}");
    let long = device(&format!("<Name LcId=\"{}\">A</Name>", "1".repeat(70_000)));
    let error = refused("an attribute", long.as_bytes(), |bytes| esi::read("bad.xml", bytes));
    assert!(error.contains("more than 65536 bytes of an attribute"), "{error}");
}

// covers: eni-read
#[test]
fn a_refused_eni_takes_memory_in_proportion_to_its_size() {
    for (what, bytes) in documents("EtherCATConfig") {
        refused(what, &bytes, EniFile::from_bytes);
    }
    let text = include_str!("../../ringcat/examples/machine.eni.xml");
    for step in 1..20 {
        let end = text.len() * step / 20;
        refused("a part of the example", &text.as_bytes()[..end], EniFile::from_bytes);
    }
    let length = text.replacen("<Data>000108000000</Data>", "<DataLength>4000000000</DataLength>", 1);
    assert_ne!(length, text);
    refused("a length", length.as_bytes(), EniFile::from_bytes);
}

// covers: network-file
#[test]
fn a_refused_network_file_takes_memory_in_proportion_to_its_size() {
    let head = "ringcat_network = 1\nname = \"m\"\n";
    let read = |bytes: &[u8]| NetworkFile::read("bad.toml", bytes);
    let tables = "[[subdevice]]\nname = \"x\"\n".repeat(40_000);
    for (what, text) in [
        ("keys", format!("{head}{} = 1\n", vec!["a"; 100_000].join("."))),
        ("lists", format!("{head}x = {}\n", "[".repeat(100_000))),
        ("tables in lines", format!("{head}x = {}\n", "{a=".repeat(100_000))),
        ("a long text", format!("{head}x = \"{}\"\n", "x".repeat(LONG))),
        ("a long key", format!("{head}{} = 1\n", "x".repeat(LONG))),
        ("many SubDevices of a name", format!("{head}{tables}")),
        ("many keys", format!("{head}{}", (0..40_000).map(|n| format!("k{n} = 1\n")).collect::<String>())),
        ("a list of numbers", format!("{head}x = [{}]\n", "1,".repeat(200_000))),
        ("an open text", format!("{head}x = \"\"\"{}", "x\n".repeat(200_000))),
    ] {
        refused(what, text.as_bytes(), read);
    }
    refused("no text", &[0xFF; 1_000], read);
}
