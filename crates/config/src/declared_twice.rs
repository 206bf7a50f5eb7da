//! Declarations with the same alias, identification or data word, which an activation can never find all: a file with
//! such declarations is refused when it is read.
//!
//! Optional SubDevices and groups may take turns at a place: they are accepted if no SubDevice can match both
//! declarations.

use std::collections::HashMap;

use ringcat_engine::config::{ConfigAddress, Expected, SubDeviceConfig};
use ringcat_engine::main_device::Required;

/// Maximum number of declarations of one place with which a further one is compared.
const MAX_COMPARED: usize = 16;

/// The first declaration that is at the place of an earlier one: the earlier and the later index.
pub(crate) fn declared_twice(configs: &[SubDeviceConfig], required: Required) -> Option<(usize, usize)> {
    let mut known: HashMap<ConfigAddress, Vec<usize>> = HashMap::new();
    let marked = configs.iter().enumerate().filter(|(_, it)| !matches!(it.address, ConfigAddress::Position(_)));
    for (index, config) in marked {
        let earlier = known.entry(config.address).or_default();
        if let Some(first) = earlier.iter().find(|first| !take_turns(&configs[**first], config, required)) {
            return Some((*first, index));
        }
        if earlier.len() < MAX_COMPARED {
            earlier.push(index);
        }
    }
    None
}

/// Whether two declarations of one place exclude each other, and one of them may be absent.
fn take_turns(a: &SubDeviceConfig, b: &SubDeviceConfig, required: Required) -> bool {
    let one_may_be_absent = match required {
        Required::All => false,
        Required::Nothing => true,
        _ => a.optional || b.optional,
    };
    one_may_be_absent && exclude_each_other(&a.expected, &b.expected)
}

/// Whether no SubDevice has both identities.
fn exclude_each_other(a: &Expected, b: &Expected) -> bool {
    let differ = |a: Option<u32>, b: Option<u32>| a.zip(b).is_some_and(|(a, b)| a != b);
    let mask = a.revision_mask & b.revision_mask;
    let revision = |of: &Expected| of.revision.map(|revision| revision & mask);
    let too_old = |exact: &Expected, minimum: &Expected| {
        let exact = exact.revision.filter(|_| exact.revision_mask == u32::MAX);
        exact.zip(minimum.minimum_revision).is_some_and(|(exact, minimum)| exact < minimum)
    };
    differ(a.vendor_id, b.vendor_id)
        || differ(a.product_code, b.product_code)
        || differ(revision(a), revision(b))
        || too_old(a, b)
        || too_old(b, a)
        || differ(a.serial, b.serial)
        || differ(a.identification.map(u32::from), b.identification.map(u32::from))
}
