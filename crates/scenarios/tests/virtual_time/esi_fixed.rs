//! Devices of descriptions (ESI) with CoE whose PDOs are fixed: their objects of assignment and mapping are read-only,
//! and a MainDevice that writes them nevertheless does not reach OP.

use std::fs;
use std::time::Duration;

use ringcat::config::esi::{Choices, select};
use ringcat::config::network::model::SubDevice;
use ringcat::esi::{EsiDevices, load};
use ringcat::network::{LoadedNetwork, NetworkFile};
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{Declaration, Event, MainDevice, Options, Position, ReadPdos, automatic};
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::AbortCode;

const LIMIT: Duration = Duration::from_secs(5);
const PERIOD: Duration = Duration::from_millis(1);

/// How a description fixes PDOs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fixed {
    /// CoE permits neither assignment nor mapping.
    ByCoe,
    /// CoE permits both; the SyncManagers and the PDOs are fixed.
    BySyncManagers,
}

/// A device with fixed PDOs; its EEPROM has room for them, or not.
fn description(fixed: Fixed, has_room: bool) -> String {
    let (sm, pdo, coe) = match fixed {
        Fixed::ByCoe => ("", "", "PdoAssign=\"false\" PdoConfig=\"false\""),
        Fixed::BySyncManagers => (" FixedAssignment=\"1\"", " Fixed=\"1\"", "PdoAssign=\"1\" PdoConfig=\"1\""),
    };
    let bytes = if has_room { 2048 } else { 256 };
    let entry = |index: &str, sub: u8, bits: u8, kind: &str| {
        format!(
            "<Entry><Index>#x{index}</Index><SubIndex>{sub}</SubIndex><BitLen>{bits}</BitLen><Name>Value {sub} of \
             {index}</Name><DataType>{kind}</DataType></Entry>"
        )
    };
    let (output, word) = (entry("7000", 1, 8, "USINT"), entry("6000", 1, 16, "UINT"));
    let (byte, other) = (entry("6000", 2, 8, "USINT"), entry("6010", 1, 8, "USINT"));
    format!(
        r##"<EtherCATInfo><Vendor><Id>#xC47</Id></Vendor><Descriptions><Groups/><Devices><Device Physics="YY">
<Type ProductCode="#x5001" RevisionNo="1">AF01</Type><Name>AF01 Fixed</Name><GroupType>A</GroupType>
<Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
<Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
<Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
<Sm DefaultSize="1" StartAddress="#x1100" ControlByte="#x64" Enable="1"{sm}>Outputs</Sm>
<Sm DefaultSize="3" StartAddress="#x1180" ControlByte="#x20" Enable="1"{sm}>Inputs</Sm>
<RxPdo{pdo} Sm="2"><Index>#x1600</Index><Name>Outputs of the device</Name>{output}</RxPdo>
<TxPdo{pdo} Sm="3"><Index>#x1A00</Index><Name>Inputs of the device</Name>{word}{byte}</TxPdo>
<TxPdo{pdo}><Index>#x1A01</Index><Name>Further inputs</Name>{other}</TxPdo>
<Mailbox><CoE SdoInfo="1" {coe}/></Mailbox>
<Eeprom><ByteSize>{bytes}</ByteSize><ConfigData>050803440000000000000000</ConfigData></Eeprom>
</Device></Devices></Descriptions></EtherCATInfo>"##
    )
}

/// The device on a segment, scanned, and its declaration from the description.
fn scanned(fixed: Fixed, has_room: bool, pdos: ReadPdos) -> (MainDevice<SimulatedSegment>, [Declaration; 2]) {
    let folder = std::env::temp_dir().join(format!("ringcat-esi-{fixed:?}-{has_room}-{pdos:?}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("fixed.xml");
    fs::write(&path, description(fixed, has_room)).unwrap();
    let esi = load(&path).unwrap_or_else(|error| panic!("{error}"));
    let segment = Segment::from_toml_with("[[device]]\nesi = \"fixed.xml\"\n", &folder, &EsiDevices::default());
    let segment = segment.unwrap_or_else(|error| panic!("{error}"));
    fs::remove_dir_all(&folder).unwrap();
    let mut file = NetworkFile::empty("fixed", PERIOD);
    let choices = Choices::default();
    let selection = select(&esi, &esi.devices[0], &choices).unwrap_or_else(|error| panic!("{error}"));
    let from = SubDevice::from_esi(&selection, PERIOD, 1033).unwrap_or_else(|error| panic!("{error}"));
    file.push(from.subdevice);
    let links = SimulatedSegment::new(Network::from_description(segment).unwrap());
    let mut main_device = MainDevice::request(links, &Options::default().with_pdos(pdos));
    let scan = main_device.scan().unwrap();
    assert_eq!(scan.subdevices[0].pdos.is_empty(), !has_room && pdos == ReadPdos::Never);
    (main_device, [automatic(&scan.subdevices, PERIOD), LoadedNetwork::new(file).declaration()])
}

/// The scenario shows something only if the device refuses what is written.
fn refuses(main_device: &mut MainDevice<SimulatedSegment>) {
    for index in [0x1C12, 0x1C13, 0x1600, 0x1A00] {
        let error = main_device.subdevice(Position(0)).sdo_write(index, 0, 0_u8).unwrap_err();
        assert!(error.to_string().contains(&AbortCode::READ_ONLY.to_string()), "{index:#06x}: {error}");
    }
}

// covers: esi-use, esi-declare, ES-50, ES-75
#[test]
fn devices_with_fixed_pdos_reach_op_without_a_write_to_their_assignment() {
    for fixed in [Fixed::ByCoe, Fixed::BySyncManagers] {
        for (has_room, pdos) in [true, false]
            .into_iter()
            .flat_map(|room| [ReadPdos::Missing, ReadPdos::Never, ReadPdos::Always].map(|pdos| (room, pdos)))
        {
            refuses(&mut scanned(fixed, has_room, pdos).0);
            for from_file in [false, true] {
                let case = format!("{fixed:?}, room {has_room}, {pdos:?}, from a file {from_file}");
                let (main_device, declarations) = scanned(fixed, has_room, pdos);
                let declaration = declarations.into_iter().nth(from_file.into()).unwrap();
                let mut application = main_device.activate(declaration).unwrap();
                application.wait_until_op(LIMIT).unwrap_or_else(|error| panic!("{case}: {error}"));
                let device = application.links().network().device(DeviceIndex(0));
                assert_eq!(device.al_status().al_state(), Some(AlState::Op), "{case}");
                while let Some(event) = application.pop_event() {
                    assert!(!matches!(event.event, Event::ConfigurationFailed { .. }), "{case}: {event:?}");
                }
            }
        }
    }
}
