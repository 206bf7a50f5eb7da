//! Mailbox decoders and any bytes: the corpora of the fuzz targets and mutants of them, without a fuzzer.

use std::fs;
use std::path::{Path, PathBuf};

use scenarios::dice::Dice;
use scenarios::fuzz_targets::{TARGETS, Target, eni, esi, mutate, network, seeds};
use scenarios::seeds::from_environment;

/// Mutants of each file of a corpus.
const MUTANTS: usize = 400;

fn corpus(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target)
}

/// The files of a corpus, by name.
fn read(target: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(corpus(target)).unwrap_or_else(|error| panic!("corpus of {target}: {error}"));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|path| (path.file_name().unwrap().display().to_string(), fs::read(path).unwrap())).collect()
}

/// Prints the bytes if the target panics.
struct Running<'a>(&'a str, &'a [u8]);

impl Drop for Running<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            match std::str::from_utf8(self.1) {
                Ok(text) if self.0 == "eni" => println!("target eni, text {text}"),
                Ok(_) | Err(_) => println!("target {}, bytes {:02x?}", self.0, self.1),
            }
        }
    }
}

fn run(name: &str, target: Target, bytes: &[u8]) {
    let _running = Running(name, bytes);
    target(bytes);
}

// covers: mail-check
#[test]
fn corpora_contain_encoder_output_and_each_target_accepts_it() {
    for (name, target) in TARGETS {
        let seeds = seeds::of(name);
        if std::env::var_os("RINGCAT_WRITE_CORPUS").is_some() {
            fs::create_dir_all(corpus(name)).unwrap();
            for (number, seed) in seeds.iter().enumerate() {
                fs::write(corpus(name).join(format!("{number:02}")), seed).unwrap();
            }
        }
        let files = read(name);
        assert!(seeds.iter().all(|seed| files.iter().any(|(_, bytes)| bytes == seed)), "corpus of {name} is old");
        for (_, bytes) in &files {
            run(name, target, bytes);
        }
    }
}

// covers: mail-check
#[test]
fn mutants_of_the_corpora_never_panic_and_re_encode_to_the_same_value() {
    let corpora = TARGETS.map(|(name, target)| (name, target, read(name)));
    for seed in from_environment().unwrap_or(4..5) {
        let mut dice = Dice::new(seed);
        for (name, target, files) in &corpora {
            for (_, bytes) in files.iter().flat_map(|file| std::iter::repeat_n(file, MUTANTS)) {
                let mut mutant = bytes.clone();
                mutate(&mut mutant, &dice.pick(files).1.clone(), &mut dice);
                run(name, *target, &mutant);
            }
        }
    }
}

/// Mutants of each own ENI and seed.
const ENI_MUTANTS: usize = 150;

// covers: 8, eni-read
#[test]
fn mutants_of_an_eni_are_consistent_configurations_or_errors() {
    for seed in from_environment().unwrap_or(8..9) {
        let mut dice = Dice::new(seed);
        for text in [eni::WHOLE, eni::GROUP, eni::COMMANDS] {
            let mut followed = 0;
            for number in 0..=ENI_MUTANTS {
                let mutant = if number == 0 { text.to_owned() } else { eni::mutate(text, &mut dice) };
                let _running = Running("eni", mutant.as_bytes());
                followed += usize::from(eni::is_followed(mutant.as_bytes()));
            }
            let share = followed * 100 / (ENI_MUTANTS + 1);
            assert!((10..90).contains(&share), "{share} % are followed: the changes are too small or too large");
        }
    }
}

// covers: esi-read
#[test]
fn mutants_of_an_esi_are_descriptions_with_images_or_errors() {
    for seed in from_environment().unwrap_or(12..13) {
        let mut dice = Dice::new(seed);
        for text in [esi::WHOLE, esi::SMALL] {
            let mut readable = 0;
            for number in 0..=ENI_MUTANTS {
                let mutant = if number == 0 { text.to_owned() } else { eni::mutate(text, &mut dice) };
                let _running = Running("esi", mutant.as_bytes());
                readable += usize::from(esi::is_read(mutant.as_bytes()));
            }
            let share = readable * 100 / (ENI_MUTANTS + 1);
            assert!((10..90).contains(&share), "{share} % are read: the changes are too small or too large");
        }
    }
}

// covers: network-file
#[test]
fn mutants_of_a_network_file_are_networks_with_a_canonical_text_or_errors() {
    for seed in from_environment().unwrap_or(13..14) {
        let mut dice = Dice::new(seed);
        let mut readable = 0;
        for number in 0..=ENI_MUTANTS {
            let whole = network::WHOLE;
            let mutant = if number == 0 { whole.to_owned() } else { network::mutate(whole, &mut dice) };
            let _running = Running("network", mutant.as_bytes());
            readable += usize::from(network::is_read(mutant.as_bytes()));
        }
        let share = readable * 100 / (ENI_MUTANTS + 1);
        assert!((10..90).contains(&share), "{share} % are read: the changes are too small or too large");
    }
}

// covers: mail-check
#[test]
fn a_target_with_a_faulty_decoder_is_found() {
    let broken: Target = |bytes| assert!(bytes.get(5) != Some(&0xFF), "a decoder that cannot bear this");
    let found = std::panic::catch_unwind(|| {
        let mut dice = Dice::new(4);
        for _ in 0..10_000 {
            let mut mutant = vec![0; 8];
            mutate(&mut mutant, &[0xFF; 4], &mut dice);
            broken(&mutant);
        }
    });
    assert!(found.is_err(), "mutants reach every byte and its edges");
}
