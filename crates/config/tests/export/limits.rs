//! Values at the ends of their ranges: long entries, SYNC1 at the cycle of SYNC0.

use ringcat_config::ExportOptions;
use ringcat_config::network::Shift;
use ringcat_engine::config::{PdoEntry, SyncSignals};

use crate::{CELL, again, configured, network};

/// One entry has up to 255 bits, in a network file, an ENI and a dictionary.
// covers: eni-run
#[test]
fn entries_of_up_to_255_bits_are_one_entry_in_an_eni() {
    for bits in [248_u8, 249, 250, 254, 255] {
        let text = CELL.replacen("index = 0x6041, bits = 16", &format!("index = 0x6041, bits = {bits}"), 1);
        let export = network(&text).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{bits}: {error}"));
        let drive = &configured(&export.text).declaration.subdevices[1];
        let inputs = drive.declared.iter().flatten().find(|it| it.index == 3).expect("SyncManager 3 is in the file");
        assert_eq!(inputs.pdos[0].entries.as_deref(), Some(&[PdoEntry::new(0x6041, 0, bits)][..]));
        assert_eq!(inputs.register.length, 32 - u16::from(bits == 248));
        let variable = export.configuration.image.variables.iter().find(|it| it.name.ends_with("Statusword"));
        assert_eq!(variable.map(|it| it.bits), Some(bits.into()));
        let second = again(&export.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(second.text, export.text);
    }
}

/// Cycle and shift of SYNC1 in the file, and as the reader gives them. The registers are those of a run with the file.
// covers: 7.3, eni-run
#[test]
fn a_sync1_with_the_cycle_of_sync0_is_the_same_after_an_export() {
    const MS: i64 = 1_000_000;
    let cases = [
        ((MS, 0), (1_000_000, 0)),
        ((0, 0), (1_000_000, 0)),
        ((MS, 250_000), (1_000_000, 250_000)),
        ((MS, -250_000), (1_000_000, 750_000)),
        ((4 * MS, 10_000), (4_000_000, 10_000)),
        ((4 * MS, -10_000), (4_000_000, 990_000)),
    ];
    for ((cycle, shift), (got_cycle, got_shift)) in cases {
        let mut file = network(CELL);
        let sync = file.subdevice[1].sync.as_mut().expect("SYNC signals");
        (sync.sync1_cycle, sync.sync1_shift) = (Shift(cycle), Shift(shift));
        let declared = file.configuration().declaration.subdevices[1].sync.expect("SYNC signals");
        let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{cycle}: {error}"));
        let got = configured(&export.text).declaration.subdevices[1].sync;
        let expected = SyncSignals::sync0(1_000_000, -20_000).with_assign_activate(0x0700);
        assert_eq!(got, Some(expected.with_sync1(got_cycle, got_shift)));
        assert_eq!(got.map(|it| it.sync1_register_ns()), Some(declared.sync1_register_ns()));
    }
    let mut file = network(CELL);
    file.subdevice[1].sync.as_mut().expect("SYNC signals").assign_activate = 0x0300;
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let got = configured(&export.text).declaration.subdevices[1].sync;
    assert_eq!(got, Some(SyncSignals::sync0(1_000_000, -20_000)), "SYNC1 is not activated");
}
