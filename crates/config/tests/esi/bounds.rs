//! What a small description can lead to: files that it refers to, and values of objects.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use ringcat_config::esi::{self, Dictionary, Esi, EsiProblem, Object, Part, PartsRoom, References, parts};

/// Files by name.
struct Files(BTreeMap<String, String>);

impl References for Files {
    fn open(&self, path: &str) -> Option<Vec<u8>> {
        self.0.get(path).map(|text| text.clone().into_bytes())
    }
}

// covers: esi-read, ES-07
#[test]
fn references_in_circles_or_out_of_the_folder_are_refused() {
    let file = |to: &str| {
        let vendor = "<Vendor><Id>1</Id></Vendor><Descriptions/>";
        format!("<EtherCATInfo>\n<InfoReference>{to}</InfoReference>{vendor}</EtherCATInfo>")
    };
    let read = |first: &str, files: &[(&str, String)]| {
        let files = files.iter().map(|(name, text)| ((*name).to_owned(), text.clone())).collect();
        esi::read_with("bad.xml", file(first).as_bytes(), &Files(files)).map_err(|error| error.to_string())
    };
    let circle = read("a.xml", &[("a.xml", file("b.xml")), ("b.xml", file("A.xml"))]).unwrap_err();
    let expected = "bad.xml:2: a file that it refers to: b.xml:2: InfoReference \"A.xml\": the file refers to itself";
    assert_eq!(circle, expected);
    let own = read("BAD.xml", &[]).unwrap_err();
    assert!(own.starts_with("bad.xml:2: InfoReference"), "{own}");
    for path in ["../a.xml", "/etc/passwd", "C:\\a.xml", "a/../../b.xml", ""] {
        let error = read(path, &[]).unwrap_err();
        assert!(error.contains("has to stay in the folder"), "{error}");
    }
    let chain: Vec<(String, String)> =
        (0..100).map(|n| (format!("{n}.xml"), file(&format!("{}.xml", n + 1)))).collect();
    let chain: Vec<(&str, String)> = chain.iter().map(|(name, text)| (name.as_str(), text.clone())).collect();
    assert!(read("0.xml", &chain).unwrap_err().contains("more than 64 files"));
    assert!(read("sub\\a.xml", &[("sub/a.xml", file("b.xml")), ("sub/b.xml", file("gone.xml"))]).is_ok());
}

/// A description with these devices.
fn description(devices: &str) -> String {
    format!(
        "<EtherCATInfo>\n<Vendor><Id>71</Id></Vendor><Descriptions><Groups/><Devices>\n{devices}</Devices>\
         </Descriptions></EtherCATInfo>"
    )
}

/// A device with a profile.
fn device(product: u32, profile: &str) -> String {
    format!(
        "<Device Physics=\"YY\"><Type ProductCode=\"{product}\" RevisionNo=\"1\">A{product}</Type><Name>n</Name>\n\
         <Profile>{profile}</Profile></Device>\n"
    )
}

/// Files by name, and how often each was opened.
struct Counted(BTreeMap<String, String>, RefCell<Vec<String>>);

impl References for Counted {
    fn open(&self, path: &str) -> Option<Vec<u8>> {
        self.1.borrow_mut().push(path.to_owned());
        self.0.get(path).map(|text| text.clone().into_bytes())
    }
}

fn counted<const N: usize>(files: [(&str, String); N]) -> Counted {
    Counted(files.into_iter().map(|(name, text)| (name.to_owned(), text)).collect(), RefCell::default())
}

fn read(text: &str, files: &Counted) -> Result<Esi, String> {
    esi::read_with("acme.xml", text.as_bytes(), files).map_err(|error| error.to_string())
}

// covers: esi-read, ES-07
#[test]
fn a_dictionary_of_many_devices_is_read_once_and_each_names_its_fault() {
    let devices: String = (0..200).map(|at| device(at, "<DictionaryFile>d.xml</DictionaryFile>")).collect();
    let object = "<Object><Index>#x2000</Index><Name>o</Name><Type>UDINT</Type><BitSize>32</BitSize></Object>";
    let dictionary = format!("<EtherCATDict><Dictionary><Objects>{object}</Objects></Dictionary></EtherCATDict>");
    let files = counted([("d.xml", dictionary)]);
    let esi = read(&description(&devices), &files).unwrap();
    assert_eq!(files.1.take(), ["d.xml"]);
    let last = esi.devices[199].profiles[0].dictionary.as_deref().unwrap();
    assert_eq!((last.objects.len(), last.file.as_deref()), (1, Some("d.xml")));
    let gone = counted([]);
    let notices = read(&description(&devices), &gone).unwrap().notices;
    let gone_files = notices.iter().filter(|notice| notice.text == "DictionaryFile \"d.xml\": no such file");
    assert_eq!(gone_files.map(|notice| (notice.line, notice.times)).collect::<Vec<_>>(), [(4, 1)]);
    assert_eq!(gone.1.take(), ["d.xml"], "nor is one that is not there looked for again");

    let leaves = description(&device(1, "<DictionaryFile>../d.xml</DictionaryFile>"));
    let expected = "acme.xml:4: device \"A1\": a reference has to stay in the folder of the file, got \"../d.xml\"";
    assert_eq!(read(&leaves, &counted([])).unwrap_err(), expected);
    let broken = counted([("d.xml", "<EtherCATDict>\n<Dictionary>".to_owned())]);
    let error = read(&description(&devices), &broken).unwrap_err();
    let expected = "acme.xml:4: device \"A0\": a file that it refers to: d.xml:2: not well-formed XML";
    assert!(error.starts_with(expected), "{error}");
    let many: String = (0..1025).map(|at| device(at, &format!("<DictionaryFile>{at}.xml</DictionaryFile>"))).collect();
    assert!(read(&description(&many), &counted([])).unwrap_err().contains("more than 1024 files of dictionaries"));
}

// covers: esi-read, ES-07
#[test]
fn two_ways_to_one_file_of_modules_are_no_circle() {
    let file = |references: &[&str], modules: &str| {
        let references: String = references.iter().map(|to| format!("<InfoReference>{to}</InfoReference>\n")).collect();
        let descriptions = format!("<Descriptions><Modules>{modules}</Modules></Descriptions>");
        format!("<EtherCATInfo>\n{references}<Vendor><Id>71</Id></Vendor>{descriptions}</EtherCATInfo>")
    };
    let module = "<Module><Type ModuleIdent=\"7\">M</Type><Name>m</Name></Module>";
    let files =
        counted([("b.xml", file(&["d.xml"], "")), ("c.xml", file(&["D.XML"], "")), ("d.xml", file(&[], module))]);
    let esi = read(&file(&["b.xml", "c.xml", "b.xml"], ""), &files).unwrap();
    assert_eq!((esi.modules.len(), esi.notices.len()), (1, 0));
    assert_eq!(files.1.take(), ["b.xml", "d.xml", "c.xml"]);
    // A circle that two references lead to is a circle.
    let files = counted([("b.xml", file(&["c.xml"], "")), ("c.xml", file(&["b.xml"], ""))]);
    let error = read(&file(&["c.xml", "b.xml"], ""), &files).unwrap_err();
    let expected = "acme.xml:2: a file that it refers to: b.xml:2: InfoReference \"c.xml\": the file refers to itself";
    assert_eq!(error, expected);
}

// covers: esi-read, ES-07
#[test]
fn the_files_that_a_description_refers_to_have_a_limit_together() {
    let long = format!("<EtherCATDict><Dictionary/><!--{}--></EtherCATDict>", "x".repeat(33 << 20));
    let files = counted([("1.xml", long.clone()), ("2.xml", long)]);
    let devices = [1, 2].map(|at| device(at, &format!("<DictionaryFile>{at}.xml</DictionaryFile>"))).concat();
    let error = read(&description(&devices), &files).unwrap_err();
    let expected = "acme.xml:6: device \"A2\": too much for a device description: \
                    more than 67108864 bytes in the files that it refers to";
    assert_eq!(error, expected);
}

/// A dictionary with the data types, and its objects.
fn dictionary(types: &str, objects: &str) -> Dictionary {
    let text = format!("<Dictionary><DataTypes>{types}</DataTypes><Objects>{objects}</Objects></Dictionary>");
    let esi = esi::read("acme.xml", description(&device(1, &text)).as_bytes()).unwrap();
    Dictionary::clone(esi.devices[0].profiles[0].dictionary.as_deref().unwrap())
}

/// An object of a type, with more.
fn object(index: u32, of: &str, more: &str) -> String {
    format!("<Object><Index>{index}</Index><Name>o</Name><Type>{of}</Type><BitSize>8</BitSize>{more}</Object>")
}

fn item(sub: u32, name: &str, bits: u32) -> String {
    format!("<SubItem><SubIdx>{sub}</SubIdx><Name>{name}</Name><Type>T</Type><BitSize>{bits}</BitSize></SubItem>")
}

/// The first object that has no room beside the others, with the error.
fn refused(dictionary: &Dictionary) -> Option<(usize, EsiProblem)> {
    let mut room = PartsRoom::default();
    let fault = |(at, object): (usize, &Object)| Some((at, parts(dictionary, object, &mut room).err()?));
    dictionary.objects.iter().enumerate().find_map(fault)
}

// covers: esi-read, ES-72
#[test]
fn values_and_names_of_objects_have_a_limit_together() {
    let limited = |it: Option<(usize, EsiProblem)>, expected: usize| {
        let (at, problem) = it.expect("it is refused");
        assert_eq!(at, expected, "{problem}");
        assert!(problem.to_string().contains("more than 16777216 bytes of values and names"), "{problem}");
    };
    let texts: String = (0..256).map(|sub| item(sub, "s", 8 << 20)).collect();
    let record = format!("<DataType><Name>R</Name><BitSize>8</BitSize>{texts}</DataType>");
    limited(refused(&dictionary(&record, &object(0x2000, "R", ""))), 0);
    let single = "<DataType><Name>S</Name><BitSize>8388608</BitSize></DataType>";
    let objects: String = (0..20).map(|at| object(0x2000 + at, "S", "").replace("<BitSize>8</BitSize>", "")).collect();
    limited(refused(&dictionary(single, &objects)), 15);
    let name = item(1, &"n".repeat(1 << 19), 8);
    let named = format!("<DataType><Name>N</Name><BitSize>8</BitSize>{name}</DataType>");
    let objects: String = (0..40).map(|at| object(0x2000 + at, "N", "")).collect();
    limited(refused(&dictionary(&named, &objects)), 31);
    let objects: String = (0..1000).map(|at| object(0x2000 + at, "B", "")).collect();
    let bytes: String = (0..256).map(|sub| item(sub, "s", 8)).collect();
    let bytes = format!("<DataType><Name>B</Name><BitSize>8</BitSize>{bytes}</DataType>");
    limited(refused(&dictionary(&bytes, &objects)), 978);
}

// covers: esi-read, ES-72
#[test]
fn values_of_parts_are_found_by_name_in_linear_time() {
    let item = |at: u32| item(at % 4, &format!("s{at}"), 16);
    let info =
        |at: u32| format!("<SubItem><Name>s{at}</Name><Info><DefaultData>{at:04x}</DefaultData></Info></SubItem>");
    let made = |items: u32, infos: u32| {
        let items: String = (0..items).map(item).collect();
        let infos: String = (0..infos).rev().map(info).collect();
        let objects = object(0x2000, "R", &format!("<Info>{infos}</Info>")).repeat(20);
        dictionary(&format!("<DataType><Name>R</Name><BitSize>8</BitSize>{items}</DataType>"), &objects)
    };
    let long = made(1000, 20_000);
    let begin = Instant::now();
    let found = |dictionary: &Dictionary| parts(dictionary, &dictionary.objects[0], &mut PartsRoom::default());
    let shown = |part: &Part| (part.sub_index, part.name.clone(), part.default.clone());
    let parts: Vec<_> = found(&long).unwrap().iter().map(shown).collect();
    assert_eq!(parts.len(), 4, "the first part of a subindex counts");
    assert_eq!(parts[3], (3, "s3".to_owned(), vec![0, 3]));
    assert!(refused(&long).is_none());
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    let (_, problem) = refused(&made(1025, 0)).expect("too many");
    assert_eq!(problem.to_string(), "too much for a device description: more than 1024 parts of an object");
}
