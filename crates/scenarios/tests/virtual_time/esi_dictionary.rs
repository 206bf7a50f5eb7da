//! SDO information of a simulated device from a description (ESI): names and bit lengths are those of the file, also
//! for the objects that the simulator derives from the rest of the device.

use std::fs;

use ringcat::esi::EsiDevices;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Position};

/// A file of an invented vendor.
const ACME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files/acme.xml");
const SEGMENT: &str = "[[device]]\nesi = \"acme.xml\"\ntype = \"AA02\"\nserial = 77\n";

/// Data types of more objects of the analogue terminal.
const TYPES: &str = r#"
<DataType><Name>DT1018</Name><BitSize>144</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><SubIdx>1</SubIdx><Name>Maker</Name><Type>UDINT</Type><BitSize>32</BitSize><BitOffs>16</BitOffs></SubItem>
 <SubItem><SubIdx>4</SubIdx><Name>Number</Name><Type>UDINT</Type><BitSize>32</BitSize><BitOffs>112</BitOffs></SubItem>
</DataType>
<DataType><Name>DT1C00ARR</Name><BaseType>USINT</BaseType><BitSize>32</BitSize>
 <ArrayInfo><LBound>1</LBound><Elements>4</Elements></ArrayInfo></DataType>
<DataType><Name>DT1C00</Name><BitSize>48</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><Name>Elements</Name><Type>DT1C00ARR</Type><BitSize>32</BitSize><BitOffs>16</BitOffs></SubItem></DataType>
<DataType><Name>DT1A00</Name><BitSize>48</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><SubIdx>1</SubIdx><Name>First</Name><Type>UDINT</Type><BitSize>32</BitSize><BitOffs>16</BitOffs></SubItem>
</DataType>
<DataType><Name>BIT2</Name><BitSize>2</BitSize></DataType>
<DataType><Name>BIT3</Name><BitSize>3</BitSize></DataType>
<DataType><Name>EN1</Name><BaseType>BIT3</BaseType><BitSize>3</BitSize></DataType>
<DataType><Name>EN2</Name><BaseType>USINT</BaseType><BitSize>3</BitSize></DataType>
<DataType><Name>EN3</Name><BitSize>5</BitSize></DataType>
<DataType><Name>DT8020</Name><BitSize>40</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><SubIdx>1</SubIdx><Name>Two</Name><Type>BIT2</Type><BitSize>2</BitSize><BitOffs>16</BitOffs></SubItem>
 <SubItem><SubIdx>2</SubIdx><Name>Three</Name><Type>EN1</Type><BitSize>3</BitSize><BitOffs>18</BitOffs></SubItem>
 <SubItem><SubIdx>3</SubIdx><Name>Of a byte</Name><Type>EN2</Type><BitSize>3</BitSize><BitOffs>21</BitOffs></SubItem>
 <SubItem><SubIdx>4</SubIdx><Name>Own</Name><Type>EN3</Type><BitSize>5</BitSize><BitOffs>24</BitOffs></SubItem>
 <SubItem><SubIdx>5</SubIdx><Name>Whole</Name><Type>UINT</Type><BitSize>16</BitSize><BitOffs>32</BitOffs></SubItem>
</DataType>
<DataType><Name>DT8030ARR</Name><BaseType>BOOL</BaseType><BitSize>3</BitSize>
 <ArrayInfo><LBound>1</LBound><Elements>3</Elements></ArrayInfo></DataType>
<DataType><Name>DT8030</Name><BitSize>19</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><Name>Elements</Name><Type>DT8030ARR</Type><BitSize>3</BitSize><BitOffs>16</BitOffs></SubItem></DataType>
<DataType><Name>DT8040ARR</Name><BaseType>BIT2</BaseType><BitSize>4</BitSize>
 <ArrayInfo><LBound>1</LBound><Elements>2</Elements></ArrayInfo></DataType>
<DataType><Name>DT8040</Name><BitSize>20</BitSize>
 <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type>
   <BitSize>8</BitSize><BitOffs>0</BitOffs></SubItem>
 <SubItem><Name>Elements</Name><Type>DT8040ARR</Type><BitSize>4</BitSize><BitOffs>16</BitOffs></SubItem></DataType>
"#;

fn object(index: &str, name: &str, data_type: &str, bits: u32) -> String {
    format!(
        "<Object><Index>#x{index}</Index><Name>{name}</Name><Type>{data_type}</Type><BitSize>{bits}</BitSize>\
         <Info/><Flags><Access>ro</Access></Flags></Object>\n"
    )
}

/// The terminal with more objects in its dictionary.
fn scanned(test: &str) -> MainDevice<SimulatedSegment> {
    let objects = [
        object("1018", "Identity of Acme", "DT1018", 144),
        object("1A00", "TxPDO map of channel 1", "DT1A00", 48),
        object("1A20", "TxPDO map of later", "DT1A00", 48),
        object("1C00", "SM kinds", "DT1C00", 48),
        object("1C10", "SM 0 list", "USINT", 8),
        object("1C13", "TxPDO list", "DT1C00", 48),
        object("8020", "Parts of a byte", "DT8020", 40),
        object("8030", "Flags", "DT8030", 19),
        object("8040", "Pairs", "DT8040", 20),
    ];
    let text = fs::read_to_string(ACME).unwrap();
    let text = text.replacen("</DataTypes>", &format!("{TYPES}</DataTypes>"), 1);
    let text = text.replacen("</Objects>", &format!("{}</Objects>", objects.concat()), 1);
    let folder = std::env::temp_dir().join(format!("ringcat-esi-{test}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("acme.xml"), text).unwrap();
    let segment = Segment::from_toml_with(SEGMENT, &folder, &EsiDevices::default());
    fs::remove_dir_all(&folder).unwrap();
    let segment = segment.unwrap_or_else(|error| panic!("{error}"));
    let links = SimulatedSegment::new(Network::from_description(segment).unwrap());
    let mut main_device = MainDevice::request(links, &Options::default());
    main_device.scan().unwrap();
    main_device
}

// covers: esi-use, ES-72, ES-75
#[test]
fn derived_objects_of_a_described_device_have_the_names_of_its_file() {
    let mut main_device = scanned("names");
    let mut name = |index| main_device.subdevice(Position(0)).sdo_object(index).unwrap().name;
    assert_eq!([name(0x1018), name(0x1C00)], ["Identity of Acme", "SM kinds"]);
    assert_eq!([name(0x1C13), name(0x1A00)], ["TxPDO list", "TxPDO map of channel 1"]);
    assert_eq!(name(0x1A02), "AI Channel 2", "the dictionary has no such object: the name of the PDO");
    assert_eq!([name(0x1C10), name(0x1A20)], ["SM 0 list", "TxPDO map of later"], "nothing derives them");
    let mut entry = |index, sub| main_device.subdevice(Position(0)).sdo_entry(index, sub).unwrap();
    assert_eq!([1, 2, 4].map(|sub| entry(0x1018, sub).name), ["Maker", "SubIndex 002", "Number"]);
    assert_eq!([entry(0x1A00, 1).name, entry(0x1C13, 2).name], ["First", "SubIndex 002"]);
    // Values, rules and mapped entries are still those of the device.
    let mut read = |index, sub| main_device.subdevice(Position(0)).sdo_read::<u32>(index, sub).unwrap();
    assert_eq!([read(0x1018, 1), read(0x1018, 4), read(0x1A00, 1)], [0xC47, 77, 0x6000_0101]);
    let mut first = || main_device.subdevice(Position(0)).sdo_read::<u16>(0x1C13, 1).unwrap();
    assert_eq!(first(), 0x1A00);
}

// covers: esi-use, ES-20, ES-22
#[test]
fn parts_of_a_byte_are_described_with_the_bits_of_the_file() {
    let mut main_device = scanned("bits");
    let mut of = |index, sub| {
        let entry = main_device.subdevice(Position(0)).sdo_entry(index, sub).unwrap();
        (entry.data_type.0, entry.bit_length)
    };
    let parts: Vec<(u16, u16)> = (1..=5).map(|sub| of(0x8020, sub)).collect();
    assert_eq!(parts, [(0x31, 2), (0x32, 3), (0x05, 3), (0x34, 5), (0x06, 16)]);
    assert_eq!([of(0x8030, 1), of(0x8030, 3)], [(0x01, 1); 2], "an array of bits");
    assert_eq!([of(0x8040, 1), of(0x8040, 2)], [(0x31, 2); 2], "an array of pairs of bits");
    assert_eq!((of(0x8020, 0), of(0x8030, 0)), ((0x05, 8), (0x05, 8)));
}
