//! The bytes themselves: they return what was written, and any bytes are an error or knowledge.

use super::*;
use ringcat_engine::knowledge::seal;
use scenarios::dice::Dice;
use scenarios::fuzz_targets::knowledge::{HEADER, is_read, target};
use scenarios::fuzz_targets::mutate;
use scenarios::seeds::from_environment;

/// Mutants per seed.
const MUTANTS: usize = 400;

/// Knowledge of segments of all kinds, in idle operation and with an application.
fn written() -> Vec<Vec<u8>> {
    let idle_ones = all_networks().into_iter().map(|network| to_bytes(&idle(network)));
    let active = networks().into_iter().map(|network| {
        let mut application = activate(idle(network));
        settle(&mut application);
        application.engine().knowledge().expect("it is scanned").to_bytes()
    });
    let clocks = networks().into_iter().map(clocked);
    idle_ones.chain(active).chain(clocks).collect()
}

/// Knowledge of a segment whose clocks were measured, and of a part of an object dictionary.
fn clocked(network: Network) -> Vec<u8> {
    let mut main_device = idle(network);
    let servo = Position(0);
    main_device.subdevice(servo).sdo_info().expect("it has SDO information");
    main_device.subdevice(servo).sdo_object(0x1018).expect("it is there");
    main_device.subdevice(servo).sdo_entry(0x1018, 1).expect("it is there");
    main_device.subdevice(servo).sdo_entry(0x1018, 9).expect_err("it is not there");
    let declaration = automatic(&main_device.subdevices(), CYCLE).with_clocks(ClockConfig::default());
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    settle(&mut application);
    to_bytes(&application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow"))
}

// covers: states
#[test]
fn bytes_return_the_knowledge_that_was_written() {
    for network in all_networks() {
        let mut main_device = idle(network);
        exchange_sdos(&mut main_device);
        let knowledge = main_device.knowledge().expect("it is scanned");
        let bytes = knowledge.to_bytes();
        assert_eq!(Knowledge::from_bytes(&bytes), Ok(knowledge));
    }
}

// covers: states
#[test]
fn each_changed_bit_and_each_missing_byte_is_an_error_with_its_place() {
    let bytes = clocked(line(descriptions(&MIXED), NetworkOptions::default()));
    for at in 0..bytes.len() {
        assert!(Knowledge::from_bytes(&bytes[..at]).is_err(), "{at} bytes");
        let mut changed = bytes.clone();
        changed[at] ^= 1 << (at % 8);
        let error = Knowledge::from_bytes(&changed).expect_err("a bit is changed");
        assert!(error.offset <= bytes.len() && error.to_string().contains("expected"), "{error}");
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    assert!(Knowledge::from_bytes(&longer).is_err());
    // With a checksum that fits, each truncated content ends where something is missing.
    let content = &bytes[HEADER..];
    for at in 0..content.len() {
        let error = Knowledge::from_bytes(&seal(&content[..at])).expect_err("something is missing");
        assert!(error.offset <= HEADER + at, "{error}");
    }
}

// covers: states
#[test]
fn mutants_with_a_fitting_checksum_are_errors_or_survive_a_round_trip() {
    let written = written();
    let mut read = 0;
    for seed in from_environment().unwrap_or(0..4) {
        let mut dice = Dice::new(seed);
        for bytes in &written {
            for _ in 0..MUTANTS {
                let mut content = bytes[HEADER..].to_vec();
                let other = dice.pick(&written)[HEADER..].to_vec();
                mutate(&mut content, &other, &mut dice);
                read += u32::from(is_read(&seal(&content)));
                let noise: Vec<u8> = (0..dice.below(200)).map(|_| dice.roll() as u8).collect();
                target(&seal(&noise));
                target(&noise);
            }
        }
    }
    assert!(read > 0, "some changes matter to no check: names, times");
}

// covers: states
#[test]
fn knowledge_that_is_wrong_but_valid_does_no_harm() {
    let network = || ring(descriptions(&MIXED), NetworkOptions::default());
    let bytes = to_bytes(&idle(network()));
    for seed in from_environment().unwrap_or(0..2) {
        let mut dice = Dice::new(seed);
        let mut tried = 0;
        while tried < 15 {
            let mut content = bytes[HEADER..].to_vec();
            for _ in 0..4 {
                let at = dice.below(content.len() as u64) as usize;
                content[at] = dice.roll() as u8;
            }
            let Ok(knowledge) = Knowledge::from_bytes(&seal(&content)) else { continue };
            tried += 1;
            let links = idle(network()).into_links();
            let mut main_device = MainDevice::request(links, &options());
            let handover = *dice.pick(&HANDOVERS);
            if main_device.resume(knowledge, handover).is_ok() {
                main_device.attend(Duration::from_secs(1));
                if main_device.knowledge().is_some() {
                    let _ = Knowledge::from_bytes(&to_bytes(&main_device)).expect("it is written again");
                }
            }
        }
    }
}

// covers: states
#[test]
fn the_corpus_of_the_fuzz_target_is_knowledge_of_this_version() {
    if std::env::var_os("RINGCAT_WRITE_CORPUS").is_some() {
        let bytes = clocked(line(descriptions(&["servo", "digital-output-8"]), NetworkOptions::default()));
        let corpus = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/corpus/knowledge/00");
        return std::fs::write(corpus, bytes).expect("the corpus can be written");
    }
    assert!(is_read(scenarios::fuzz_targets::knowledge::SMALL), "write it again, see `SMALL`");
}
