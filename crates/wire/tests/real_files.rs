//! Tests of the codec with recorded bytes: EEPROM images and captures of real devices.
//!
//! The files are beside the repository (`../shared/data`) and not part of it. If they are missing, each test prints
//! this and passes.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use ringcat_wire::command::Command;
use ringcat_wire::frame::{Frame, FrameError};
use ringcat_wire::mailbox::sdo::{SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Message, Protocol};
use ringcat_wire::sii::{
    CategoryKind, General, PdoDirection, PdoEntry, Sii, SiiHeader, SiiSyncManager, SiiWriter, SyncManagerKind,
};

/// Every file with this extension, by name; `None` and a printed line if the directory is missing.
fn files(directory: &str, extension: &str) -> Option<BTreeMap<String, PathBuf>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(directory);
    let Ok(entries) = fs::read_dir(&path) else {
        println!("skipped: {} is absent", path.display());
        return None;
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let wanted = paths.filter(|path| path.extension().is_some_and(|found| found == extension));
    Some(wanted.map(|path| (path.file_stem().unwrap().to_string_lossy().into_owned(), path)).collect())
}

// covers: codec-frames
#[test]
fn every_sii_image_parses_or_is_refused_with_a_reason() {
    let Some(files) = files("sii", "bin") else { return };
    let mut parsed = 0;
    for (name, path) in files {
        let image = fs::read(path).unwrap();
        match Sii::parse(&image) {
            Ok(sii) => {
                assert!(!name.starts_with("NEGATIVE"), "{name} parses");
                parsed += 1;
                print_image(&name, &sii);
                assert_image_round_trips(&name, &image, &sii);
            }
            Err(error) => println!("{name}: refused: {error}"),
        }
    }
    println!("{parsed} images parse");
    assert!(parsed >= 30, "only {parsed} images parse");
}

fn print_image(name: &str, sii: &Sii<'_>) {
    let identity = sii.header().identity;
    let kinds: Vec<_> = sii.categories().map(|category| category.kind.to_string()).collect();
    let own_name = sii.general().and_then(|general| sii.strings().string(general.name)).unwrap_or_default();
    println!(
        "{name}: {:#010x}:{:#010x} \"{}\" {} SM, {} TxPDO, {} RxPDO, {} DC, {}",
        identity.vendor_id,
        identity.product_code,
        own_name.escape_ascii(),
        sii.sync_managers().count(),
        sii.pdos(PdoDirection::Tx).count(),
        sii.pdos(PdoDirection::Rx).count(),
        sii.dc_modes().count(),
        kinds.join(" ")
    );
}

/// Re-encodes the fixed area and each category from the decoded values, and compares up to the end marker.
fn assert_image_round_trips(name: &str, image: &[u8], sii: &Sii<'_>) {
    let mut buffer = vec![0; image.len()];
    assert_eq!(sii.header().encode(), image[..SiiHeader::LEN], "{name}");
    let mut writer = SiiWriter::new(&mut buffer, sii.header()).unwrap();
    for category in sii.categories() {
        let data = match category.kind {
            CategoryKind::General => General::decode(category.data).map(|general| general.encode().to_vec()),
            CategoryKind::SyncManager => Some(sii.sync_managers().flat_map(|entry| entry.encode()).collect()),
            _ => None,
        };
        writer.category(category.kind, data.as_deref().unwrap_or(category.data)).unwrap();
    }
    assert!(sii.end_marker, "{name} has an end marker");
    let used = writer.finish().unwrap();
    assert_eq!(used, sii.used(), "{name}");
    assert_eq!(buffer[..used], image[..used], "{name}");
}

#[test]
fn well_known_devices_have_these_identities_and_names() {
    let Some(files) = files("sii", "bin") else { return };
    let expected = [
        ("beckhoff_ek1100_ethercrab", 0x2, 0x044C_2C52, 0x0012_0000, "EK1100 EtherCAT-Koppler (2A E-Bus)"),
        ("beckhoff_el1008_qitech", 0x2, 0x03F0_3052, 0x0010_0000, "EL1008 8K. Dig. Eingang 24V, 3ms"),
        ("beckhoff_el2004_qitech", 0x2, 0x07D4_3052, 0x0012_0000, "EL2004 4Ch. Dig. Output 24V, 0.5A"),
        ("beckhoff_el4002_qitech", 0x2, 0x0FA2_3052, 0x0014_0000, "EL4002 2K. Ana. Ausgang 0-10V, 12bit"),
        ("synapticon_siitool_example", 0x22D2, 0x0201, 0x0A00_0002, "SNCN SOMANET COM ECAT"),
        ("wandercraft_foot_xmc4800", 0x06A5, 0x00B0_CAD0, 0x1, "Foot"),
        ("pyethercat_read_428", 0x0A68, 0x5A, 0x1, "ArtifactNoise_G431_Custom"),
    ];
    for (file, vendor_id, product_code, revision, name) in expected {
        let image = fs::read(&files[file]).unwrap();
        let sii = Sii::parse(&image).unwrap();
        let identity = sii.header().identity;
        assert_eq!((identity.vendor_id, identity.product_code, identity.revision), (vendor_id, product_code, revision));
        let index = sii.general().unwrap().name;
        assert_eq!(sii.strings().string(index), Some(name.as_bytes()), "{file}");
    }
}

#[test]
fn an_el2004_has_four_outputs_of_one_bit() {
    let Some(files) = files("sii", "bin") else { return };
    let image = fs::read(&files["beckhoff_el2004_qitech"]).unwrap();
    let sii = Sii::parse(&image).unwrap();
    let pdos: Vec<_> = sii.pdos(PdoDirection::Rx).collect();
    assert_eq!(pdos.iter().map(|pdo| pdo.index).collect::<Vec<_>>(), [0x1600, 0x1601, 0x1602, 0x1603]);
    for (pdo, index) in pdos.iter().zip([0x7000, 0x7010, 0x7020, 0x7030]) {
        let [entry]: [PdoEntry; 1] = pdo.entries().collect::<Vec<_>>().try_into().unwrap();
        assert_eq!((entry.index, entry.sub_index, entry.data_type, entry.bit_length), (index, 1, 1, 1));
        assert_eq!(pdo.sync_manager, Some(0));
    }
    let sync_managers: Vec<SiiSyncManager> = sii.sync_managers().collect();
    assert_eq!(sync_managers.len(), 1);
    assert_eq!(sync_managers[0].start, 0x0F00);
    assert_eq!(sync_managers[0].kind, SyncManagerKind::Outputs);
}

/// Counts of a capture.
#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    frames: usize,
    datagrams: usize,
    other_protocol: usize,
    /// Frames with bytes between the last datagram and the length in the EtherCAT header.
    surplus: usize,
    upload_requests: usize,
    upload_responses: usize,
    download_requests: usize,
    download_responses: usize,
    /// Other mailbox messages.
    other_mail: usize,
}

// covers: codec-frames
#[test]
fn every_captured_ethercat_frame_encodes_to_its_original_bytes() {
    let Some(files) = files("pcap", "pcapng") else { return };
    let mut counts = BTreeMap::new();
    for (name, path) in files {
        let capture = fs::read(path).unwrap();
        let found = count(&name, &capture);
        println!("{name}: {found:?}");
        counts.insert(name, found);
    }
    // Counts according to tshark.
    let frames = [
        ("ethercrab_hist_el2828_el2889_long", 19964),
        ("ethercrab_hist_el2828_el2889_noreborrow", 10000),
        ("ethercrab_hist_issue49", 560),
        ("ethercrab_hist_mailbox_el3004", 1792),
        ("ethercrab_hist_no_complete_access_long", 6494),
        ("ethercrab_replay_dc", 3604),
        ("ethercrab_replay_ek1100_el2828_el2889", 3578),
        ("ethercrab_replay_ek1914_el3004_configure", 1104),
        ("ethercrab_replay_ek1914_el3004_mailbox", 994),
        ("ethercrab_replay_ek1914_no_complete_access", 2208),
        ("ethercrab_replay_ek1914_upload_normal", 964),
        ("ethercrab_scan_ek1100_el1004", 2),
        ("ethercrab_sii_read_el2004", 254),
        ("soem_single_lan9252", 998),
        ("soem_slaveinfo_ek1100_el1004", 580),
        ("soem_slaveinfo_ek1100_only", 188),
        ("soem_slaveinfo_no_slaves", 19),
        ("twincat_run_ek1100_el1004", 553),
    ];
    for (name, frames) in frames {
        let found = &counts[name];
        // The MainDevice of this capture writes length 28, including the padding, for every datagram.
        let surplus = if name == "ethercrab_sii_read_el2004" { 246 } else { 0 };
        assert_eq!((found.frames, found.surplus), (frames, surplus), "{name}");
    }
    assert!(counts.values().all(|found| found.other_protocol == 0));
    let mail = |name: &str| {
        let found = &counts[name];
        let uploads = (found.upload_requests, found.upload_responses);
        (uploads, (found.download_requests, found.download_responses), found.other_mail)
    };
    assert_eq!(mail("ethercrab_hist_mailbox_el3004"), ((7, 7), (1, 1), 0));
    assert_eq!(mail("ethercrab_replay_ek1914_el3004_configure"), ((5, 5), (7, 7), 0));
    assert_eq!(mail("ethercrab_replay_ek1914_no_complete_access"), ((84, 84), (0, 0), 0));
    assert_eq!(mail("ethercrab_replay_ek1914_upload_normal"), ((1, 1), (0, 0), 0));
    assert_eq!(mail("soem_single_lan9252"), ((6, 6), (0, 0), 0));
}

fn count(name: &str, capture: &[u8]) -> Counts {
    let mut counts = Counts::default();
    let mut out = [0; 2048];
    for (number, bytes) in packets(capture).into_iter().enumerate() {
        match Frame::parse(bytes) {
            Ok(frame) => {
                let length = frame.encode(&mut out);
                assert_eq!(length, Some(bytes.len()), "{name}, frame {number}");
                assert_eq!(&out[..bytes.len()], bytes, "{name}, frame {number}");
                counts.frames += 1;
                counts.surplus += usize::from(!frame.surplus.is_empty());
                for datagram in frame.datagrams() {
                    counts.datagrams += 1;
                    let mail = datagram.header.ado().0 >= 0x1000 && datagram.wkc.0 == 1;
                    match datagram.header.command {
                        Command::Fpwr if mail => count_request(&mut counts, datagram.data),
                        Command::Fprd if mail => count_response(&mut counts, datagram.data),
                        _ => {}
                    }
                }
            }
            Err(FrameError::NotEthercat { .. } | FrameError::NotEthercatUdp) => counts.other_protocol += 1,
            Err(error) => panic!("{name}, frame {number}: {error}"),
        }
    }
    counts
}

fn count_request(counts: &mut Counts, mailbox: &[u8]) {
    let message = coe(mailbox);
    let request = SdoRequest::decode(message.payload).unwrap();
    assert_encoded(message.payload, |out| request.encode(out));
    match request {
        SdoRequest::Upload { .. } => counts.upload_requests += 1,
        SdoRequest::DownloadExpedited { .. } | SdoRequest::DownloadNormal { .. } => counts.download_requests += 1,
        _ => counts.other_mail += 1,
    }
}

fn count_response(counts: &mut Counts, mailbox: &[u8]) {
    let message = coe(mailbox);
    let response = SdoResponse::decode(message.payload).unwrap();
    // After the subindex of a finished download some devices return bytes of the request.
    let said = if matches!(response, SdoResponse::DownloadDone { .. }) { 6 } else { message.payload.len() };
    assert_encoded(&message.payload[..said], |out| response.encode(out));
    match response {
        SdoResponse::UploadExpedited { .. } | SdoResponse::UploadNormal { .. } => counts.upload_responses += 1,
        SdoResponse::DownloadDone { .. } => counts.download_responses += 1,
        _ => counts.other_mail += 1,
    }
}

fn coe(mailbox: &[u8]) -> Message<'_> {
    let message = Message::decode(mailbox).unwrap();
    assert_eq!(message.header.protocol, Protocol::Coe);
    assert_eq!(message.header.encode(), mailbox[..6]);
    message
}

fn assert_encoded(payload: &[u8], encode: impl Fn(&mut [u8]) -> Option<usize>) {
    let mut out = [0xEE; 2048];
    let length = encode(&mut out).unwrap();
    assert!(length >= payload.len());
    assert_eq!(&out[..payload.len()], payload);
}

/// The packets of a little-endian pcapng file: enhanced (6) and simple (3) packet blocks, in order.
fn packets(capture: &[u8]) -> Vec<&[u8]> {
    let word = |at: usize| u32::from_le_bytes(capture[at..at + 4].try_into().unwrap());
    let mut packets = Vec::new();
    let mut at = 0;
    while at < capture.len() {
        let (kind, length) = (word(at), word(at + 4) as usize);
        match kind {
            0x0A0D_0D0A => assert_eq!(word(at + 8), 0x1A2B_3C4D, "a little-endian section"),
            6 => {
                let (captured, original) = (word(at + 20) as usize, word(at + 24) as usize);
                assert_eq!(captured, original, "a whole packet");
                packets.push(&capture[at + 28..at + 28 + captured]);
            }
            3 => packets.push(&capture[at + 12..at + 12 + word(at + 8) as usize]),
            _ => {}
        }
        at += length;
    }
    packets
}
