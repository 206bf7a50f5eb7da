//! Networks that are changed at random in known ways: each change is named once, and nothing else.

use std::time::Duration;

use ringcat_config::network::{NetworkFile, ScanOptions};
use ringcat_config::{Difference, DifferenceKind, FoundNetwork};
use ringcat_engine::Topology;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::address::Position;
use ringcat_wire::sii::Identity;

use DifferenceKind::{Additional, Device, Missing, Order, Serial};

/// A repeatable sequence of numbers (xorshift).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}

fn unit(product: u32, serial: u32) -> SubDeviceInfo {
    let mut info = SubDeviceInfo::default();
    info.identity = Identity { vendor_id: 7, product_code: product, revision: 1, serial };
    info.name = format!("unit {product} {serial}");
    info
}

fn placed(mut units: Vec<SubDeviceInfo>) -> Vec<SubDeviceInfo> {
    for (position, info) in (0..).zip(&mut units) {
        info.position = Position(position);
    }
    units
}

fn file_of(found: &[SubDeviceInfo]) -> NetworkFile {
    let mut options = ScanOptions::new("machine", Duration::from_millis(1));
    options.check_serial = true;
    NetworkFile::from_scan(found, &Topology::default(), &options)
}

fn differences(file: &NetworkFile, found: &[SubDeviceInfo]) -> Vec<Difference> {
    let topology = Topology::default();
    let network = FoundNetwork::new(found, &topology);
    file.configuration().differences(network, &file.stated())
}

/// A kind, and the names that the text has to have.
type Expected = (DifferenceKind, Vec<String>);

/// Changes a network: units that are missing, additional, replaced, and two that have changed places.
fn changed(base: &[SubDeviceInfo], numbers: &mut Numbers) -> (Vec<SubDeviceInfo>, Vec<Expected>) {
    let mut units: Vec<Option<SubDeviceInfo>> = base.iter().cloned().map(Some).collect();
    let mut before: Vec<Option<SubDeviceInfo>> = vec![None; base.len()];
    let mut expected: Vec<Expected> = Vec::new();
    let quoted = |info: &SubDeviceInfo| format!("\"{}\"", info.name);
    // Changes are at least two places apart: a missing unit next to an additional one would be a replaced one.
    let mut places: Vec<usize> = (0..base.len() / 3).map(|at| 3 * at + numbers.below(2)).collect();
    let is_swapped = numbers.below(2) == 0;
    if is_swapped {
        let first = places.remove(numbers.below(places.len()));
        let second = places.remove(numbers.below(places.len()));
        units.swap(first, second);
        expected.push((Order, vec![quoted(&base[first]), quoted(&base[second])]));
    }
    for count in 0..numbers.below(4).min(places.len()) {
        let at = places.remove(numbers.below(places.len()));
        let new = unit(900 + count as u32, 0);
        match numbers.below(if is_swapped { 2 } else { 4 }) {
            0 => {
                units[at] = None;
                expected.push((Missing, vec![quoted(&base[at])]));
            }
            1 => {
                expected.push((Additional, vec![quoted(&new)]));
                before[at] = Some(new);
            }
            2 => {
                units[at] = Some(new);
                expected.push((Device, vec![quoted(&base[at])]));
            }
            _ => {
                let other = unit(base[at].identity.product_code, 90_000 + count as u32);
                units[at] = Some(other);
                expected.push((Serial, vec![quoted(&base[at])]));
            }
        }
    }
    let bus = before.into_iter().zip(units).flat_map(|(before, own)| before.into_iter().chain(own));
    (placed(bus.collect()), expected)
}

// covers: network-file
#[test]
fn each_of_several_changes_is_named_once_and_nothing_is_invented() {
    for seed in 1..=3_000 {
        let mut numbers = Numbers(u64::wrapping_mul(seed, 0x9E37_79B9_7F4A_7C15));
        let count = 9 + numbers.below(20);
        let kinds = 1 + numbers.below(4);
        let units = (0..count).map(|at| unit(1 + numbers.below(kinds) as u32, 100 + at as u32));
        let base = placed(units.collect());
        let file = file_of(&base);
        let (bus, mut expected) = changed(&base, &mut numbers);
        let got = differences(&file, &bus);
        let words = |infos: &[SubDeviceInfo]| infos.iter().map(|it| it.name.clone()).collect::<Vec<_>>().join(", ");
        let all = || format!("seed {seed}: {}\n{}\nexpected {expected:?}\n{got:#?}", words(&base), words(&bus));
        assert_eq!(got.len(), expected.len(), "{}", all());
        for one in &got {
            let is_it =
                |(kind, names): &Expected| *kind == one.kind && names.iter().all(|name| one.text.contains(name));
            assert!(expected.iter().any(is_it), "{}\n{}", one.text, all());
        }
        expected.retain(|(kind, names)| {
            !got.iter().any(|one| one.kind == *kind && names.iter().all(|name| one.text.contains(name)))
        });
        assert!(expected.is_empty(), "seed {seed}: {expected:?}\n{got:#?}");
    }
}
