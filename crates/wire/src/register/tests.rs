//! Literal vectors and round trips of every typed view.

use super::*;
use crate::address::{LogicalAddress, StationAddress};
use crate::time::{DcTime, DcTime32};
use proptest::prelude::*;

/// The bytes of a vector decode to the value, and the value encodes to the bytes.
macro_rules! vector {
    ($value:expr, $view:ident, $bytes:expr) => {
        let (value, bytes): ($view, [u8; $view::LEN]) = ($value, $bytes);
        assert_eq!(value.encode(), bytes);
        assert_eq!($view::decode(&bytes), value);
    };
}

// covers: codec-registers
#[test]
fn information_vector_of_an_et1100() {
    let features = Features {
        dc: true,
        dc_64bit: true,
        enhanced_link_detection_ebus: true,
        enhanced_link_detection_mii: true,
        separate_fcs_errors: true,
        ..Features::default()
    };
    vector!(features, Features, [0xEC, 0x00]);
    let ports =
        PortDescriptor { ports: [PortKind::Mii, PortKind::Ebus, PortKind::NotConfigured, PortKind::NotImplemented] };
    vector!(ports, PortDescriptor, [0x1B]);
    let information = Information {
        controller_type: 0x11,
        revision: 0x00,
        build: 0x0002,
        fmmu_count: 8,
        sync_manager_count: 8,
        ram_kib: 8,
        port_descriptor: ports,
        features,
    };
    vector!(information, Information, [0x11, 0x00, 0x02, 0x00, 0x08, 0x08, 0x08, 0x1B, 0xEC, 0x00]);
}

// covers: 3.1
#[test]
fn features_name_their_bits() {
    let features = Features {
        fmmu_byte_oriented: true,
        lrw_unsupported: true,
        brw_unsupported: true,
        fixed_fmmu_sync_manager: true,
        sync_manager_sequential: true,
        ..Features::default()
    };
    vector!(features, Features, [0x01, 0x1E]);
    let rest = Features {
        unused_register_access: true,
        ebus_low_jitter: true,
        enhanced_dc_sync_activation: true,
        ..Features::default()
    };
    vector!(rest, Features, [0x12, 0x01]);
}

// covers: codec-registers
#[test]
fn addressing_vectors() {
    vector!(StationAddress(0x1001), StationAddress, [0x01, 0x10]);
    vector!(WriteEnable(0), WriteEnable, [0x00]);
    vector!(WriteProtection { protected: true, reserved: 0 }, WriteProtection, [0x01]);
    assert_eq!(EscReset::SEQUENCE.map(|step| step.encode()), [[0x52], [0x45], [0x53]]);
}

// covers: 3.3, codec-registers
#[test]
fn dl_vectors() {
    vector!(DlControl::default(), DlControl, [0x01, 0x00, 0x07, 0x00]);
    let control = DlControl {
        temporary: true,
        loops: [LoopControl::Auto, LoopControl::AutoClose, LoopControl::Open, LoopControl::Closed],
        ebus_low_jitter: true,
        ebus_remote_link_down: true,
        alias_enable: true,
        ..DlControl::default()
    };
    vector!(control, DlControl, [0x03, 0xE4, 0x4F, 0x01]);
    vector!(PhysicalOffset(0x0102), PhysicalOffset, [0x02, 0x01]);
}

// covers: 2.3, codec-registers
#[test]
fn dl_status_examples_decode() {
    let open = PortStatus { link: true, loop_closed: false, communication: true };
    let closed = PortStatus { link: false, loop_closed: true, communication: false };
    let forced = PortStatus { link: true, loop_closed: true, communication: true };
    let status = |ports| DlStatus { pdi_operational: true, pdi_watchdog_ok: true, ports, ..DlStatus::default() };
    vector!(status([open, open, closed, closed]), DlStatus, [0x33, 0x5A]);
    vector!(status([open, closed, closed, closed]), DlStatus, [0x13, 0x56]);
    vector!(status([closed, open, closed, closed]), DlStatus, [0x23, 0x59]);
    vector!(status([open, closed, closed, forced]), DlStatus, [0x93, 0xD6]);
    let detection = DlStatus { enhanced_link_detection: true, reserved: 0x0008, ..DlStatus::default() };
    vector!(detection, DlStatus, [0x0C, 0x00]);
}

// covers: codec-registers
#[test]
fn al_vectors() {
    vector!(AlControl::from_bits(0x0014), AlControl, [0x14, 0x00]);
    vector!(AlStatus::from_bits(0x0012), AlStatus, [0x12, 0x00]);
    vector!(AlStatusCode::INVALID_STATE_CHANGE, AlStatusCode, [0x11, 0x00]);
    vector!(LedOverride { code: 0x0D, enable: true, reserved: 0 }, LedOverride, [0x1D]);
}

// covers: codec-registers
#[test]
fn pdi_vectors() {
    for (control, code) in [
        (PdiControl::None, 0x00),
        (PdiControl::DigitalIo, 0x04),
        (PdiControl::Spi, 0x05),
        (PdiControl::Bridge, 0x07),
        (PdiControl::Async16, 0x08),
        (PdiControl::Async8, 0x09),
        (PdiControl::Sync16, 0x0A),
        (PdiControl::Sync8, 0x0B),
        (PdiControl::OnChipBus, 0x80),
        (PdiControl::Other(0x81), 0x81),
    ] {
        vector!(control, PdiControl, [code]);
    }
    let configuration = EscConfiguration {
        device_emulation: true,
        enhanced_link_detection: false,
        sync_unit: true,
        latch_unit: true,
        enhanced_link_detection_ports: [true, false, false, true],
    };
    vector!(configuration, EscConfiguration, [0x9D]);
    let information = PdiInformation { configured: true, active: true, ..PdiInformation::default() };
    vector!(information, PdiInformation, [0x06, 0x00]);
    vector!(PdiConfiguration(0x05), PdiConfiguration, [0x05]);
    let pins = SyncLatchConfiguration {
        sync0_driver: 2,
        sync0_output: true,
        sync0_al_event: true,
        sync1_al_event: true,
        ..SyncLatchConfiguration::default()
    };
    vector!(pins, SyncLatchConfiguration, [0x8E]);
    vector!(ExtendedPdiConfiguration(0x0102), ExtendedPdiConfiguration, [0x02, 0x01]);
}

// covers: codec-registers
#[test]
fn event_vectors() {
    // protocol 5.6: mask for DL status alone.
    vector!(EcatEvent { dl_status: true, ..EcatEvent::default() }, EcatEvent, [0x04, 0x00]);
    let event = EcatEvent { dc_latch: true, al_status: true, sync_managers: 0x81, ..EcatEvent::default() };
    vector!(event, EcatEvent, [0x19, 0x08]);
    let event = AlEvent { al_control: true, sync_managers: 0x8001, process_data_watchdog: true, ..AlEvent::default() };
    vector!(event, AlEvent, [0x41, 0x01, 0x80, 0x00]);
    let events = AlEvent {
        dc_latch: true,
        sync0: true,
        sync1: true,
        sync_manager_activation: true,
        eeprom_emulation: true,
        ..AlEvent::default()
    };
    vector!(events, AlEvent, [0x3E, 0x00, 0x00, 0x00]);
    assert_eq!(AlEvent::from_bits(AlEvent::MASK_RESET).sync_managers, 0xFFFF);
}

// covers: codec-registers
#[test]
fn error_counter_vectors() {
    let port = |invalid_frames, rx_errors| RxErrorCounter { invalid_frames, rx_errors };
    vector!(port(1, 2), RxErrorCounter, [0x01, 0x02]);
    let counters = ErrorCounters {
        rx: [port(1, 2), port(3, 4), port(5, 6), port(7, 8)],
        forwarded: [9, 10, 11, 12],
        epu: 13,
        pdi: 14,
        pdi_code: 15,
        reserved: 16,
        lost_link: [17, 18, 19, 20],
    };
    vector!(counters, ErrorCounters, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20]);
}

// covers: codec-registers
#[test]
fn the_default_watchdog_is_100_ms() {
    vector!(WatchdogDivider::default(), WatchdogDivider, [0xC2, 0x09]);
    vector!(WatchdogTime::default(), WatchdogTime, [0xE8, 0x03]);
    assert_eq!(WatchdogDivider::default().unit_ns(), 100_000);
    assert_eq!(WatchdogTime::default().duration_ns(WatchdogDivider::default()), Some(100_000_000));
    assert_eq!(WatchdogTime(0).duration_ns(WatchdogDivider::default()), None);
    vector!(WatchdogStatus { process_data_ok: true, reserved: 0 }, WatchdogStatus, [0x01, 0x00]);
    vector!(WatchdogCounters { process_data: 3, pdi: 4 }, WatchdogCounters, [0x03, 0x04]);
}

// covers: codec-registers
#[test]
fn sii_vectors() {
    // protocol 3.8: write enable and write; reload is command 4.
    vector!(SiiControl::request(SiiCommand::Write), SiiControl, [0x01, 0x02]);
    vector!(SiiControl::request(SiiCommand::Read), SiiControl, [0x00, 0x01]);
    vector!(SiiControl::request(SiiCommand::Reload), SiiControl, [0x00, 0x04]);
    vector!(SiiControl::request(SiiCommand::Idle), SiiControl, [0x00, 0x00]);
    let flags = SiiControl { eight_byte_reads: true, two_address_bytes: true, busy: true, ..SiiControl::default() };
    vector!(flags, SiiControl, [0xC0, 0x80]);
    let errors = SiiControl {
        emulated: true,
        command: SiiCommand::Reserved(3),
        checksum_error: true,
        device_info_not_loaded: true,
        command_error: true,
        write_enable_error: true,
        ..SiiControl::default()
    };
    vector!(errors, SiiControl, [0x20, 0x7B]);
    vector!(SiiConfiguration { force_ecat: true, ..SiiConfiguration::default() }, SiiConfiguration, [0x02]);
    vector!(SiiConfiguration { offer_pdi: true, ..SiiConfiguration::default() }, SiiConfiguration, [0x01]);
    vector!(SiiPdiAccess { pdi_access: true, reserved: 0 }, SiiPdiAccess, [0x01]);
    vector!(SiiAddress(0x40), SiiAddress, [0x40, 0, 0, 0]);
    vector!(SiiData(0x0807_0605_0403_0201), SiiData, [1, 2, 3, 4, 5, 6, 7, 8]);
}

// covers: codec-registers
#[test]
fn mii_vectors() {
    let control = MiiControl { write_enable: true, command: MiiCommand::Write, busy: true, ..MiiControl::default() };
    vector!(control, MiiControl, [0x01, 0x82]);
    let control = MiiControl { phy_address_offset: 0x10, command: MiiCommand::Reserved(3), ..MiiControl::default() };
    vector!(control, MiiControl, [0x80, 0x03]);
    vector!(MiiPhyAddress { address: 3, reserved: 0x80 }, MiiPhyAddress, [0x83]);
    vector!(MiiPhyRegister { register: 1, reserved: 0 }, MiiPhyRegister, [0x01]);
    vector!(MiiPhyData(0x1234), MiiPhyData, [0x34, 0x12]);
    vector!(MiiEcatAccess { exclusive: true, reserved: 0 }, MiiEcatAccess, [0x01]);
    vector!(MiiPdiAccess { pdi_access: false, force_reset: true, reserved: 0 }, MiiPdiAccess, [0x02]);
    let status = MiiPhyPortStatus { physical_link: true, link: true, ..MiiPhyPortStatus::default() };
    vector!(status, MiiPhyPortStatus, [0x03]);
}

// covers: 3.10, codec-registers
#[test]
fn the_fmmu_example_of_14_bits_decodes() {
    let fmmu = Fmmu {
        logical_start: LogicalAddress(0x0001_0011),
        length: 3,
        logical_start_bit: 3,
        logical_stop_bit: 0,
        physical_start: 0x0F01,
        physical_start_bit: 1,
        read: false,
        write: true,
        active: true,
        reserved: [0; 8],
    };
    vector!(fmmu, Fmmu, [0x11, 0x00, 0x01, 0x00, 0x03, 0x00, 0x03, 0x00, 0x01, 0x0F, 0x01, 0x02, 0x01, 0, 0, 0]);
    assert_eq!(fmmu.bit_length(), 14);
    assert_eq!(Fmmu { length: 2, logical_stop_bit: 7, ..Fmmu::default() }.bit_length(), 16);
    assert_eq!(Fmmu::default().bit_length(), 0);
    assert_eq!(Fmmu { read: true, ..Fmmu::default() }.encode()[0x0B], 0x01);
}

// covers: 3.11
#[test]
fn typical_sync_manager_control_bytes_decode() {
    let event = SyncManagerControl { pdi_event: true, ..SyncManagerControl::default() };
    let write = SyncManagerDirection::Write;
    let mailbox_out = SyncManagerControl { mode: SyncManagerMode::Mailbox, direction: write, ..event };
    let mailbox_in = SyncManagerControl { mode: SyncManagerMode::Mailbox, ..event };
    let outputs = SyncManagerControl { direction: write, watchdog: true, ..event };
    let digital_outputs = SyncManagerControl { direction: write, watchdog: true, ..SyncManagerControl::default() };
    vector!(mailbox_out, SyncManagerControl, [0x26]);
    vector!(mailbox_in, SyncManagerControl, [0x22]);
    vector!(outputs, SyncManagerControl, [0x64]);
    vector!(SyncManagerControl { watchdog: false, ..outputs }, SyncManagerControl, [0x24]);
    vector!(event, SyncManagerControl, [0x20]);
    vector!(digital_outputs, SyncManagerControl, [0x44]);
    let odd = SyncManagerControl {
        mode: SyncManagerMode::Reserved(3),
        direction: SyncManagerDirection::Reserved(2),
        ecat_event: true,
        sequential: true,
        ..SyncManagerControl::default()
    };
    vector!(odd, SyncManagerControl, [0x9B]);
}

// covers: codec-registers
#[test]
fn sync_manager_vector() {
    let status = SyncManagerStatus { write_event: true, mailbox_full: true, last_buffer: 3, ..Default::default() };
    vector!(status, SyncManagerStatus, [0x39]);
    let status = SyncManagerStatus { read_event: true, write_buffer_open: true, ..Default::default() };
    vector!(status, SyncManagerStatus, [0x82]);
    let activate = SyncManagerActivate { enable: true, repeat_request: true, latch_pdi: true, ..Default::default() };
    vector!(activate, SyncManagerActivate, [0x83]);
    let pdi_control = SyncManagerPdiControl { repeat_acknowledge: true, ..Default::default() };
    vector!(pdi_control, SyncManagerPdiControl, [0x02]);
    let sync_manager = SyncManager {
        start: 0x1000,
        length: 0x0080,
        control: SyncManagerControl::from_bits(0x26),
        status,
        activate,
        pdi_control,
    };
    vector!(sync_manager, SyncManager, [0x00, 0x10, 0x80, 0x00, 0x26, 0x82, 0x83, 0x02]);
}

// covers: codec-registers
#[test]
fn clock_vectors() {
    vector!(DcTime(0x0102_0304_0506_0708), DcTime, [8, 7, 6, 5, 4, 3, 2, 1]);
    vector!(DcTime32(0x0102_0304), DcTime32, [4, 3, 2, 1]);
    let times = DcReceiveTimes { ports: [DcTime32(1), DcTime32(2), DcTime32(3), DcTime32(0x0400_0000)] };
    vector!(times, DcReceiveTimes, [1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 4]);
    vector!(DcSystemTimeOffset(-2), DcSystemTimeOffset, [0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
    vector!(DcSystemTimeDelay(1280), DcSystemTimeDelay, [0x00, 0x05, 0x00, 0x00]);
    let ahead = DcSystemTimeDifference { magnitude_ns: 20, local_ahead: true };
    vector!(ahead, DcSystemTimeDifference, [0x14, 0x00, 0x00, 0x80]);
    assert_eq!(ahead.signed_ns(), 20);
    assert_eq!(DcSystemTimeDifference { local_ahead: false, ..ahead }.signed_ns(), -20);
    vector!(DcSpeedCounterStart::default(), DcSpeedCounterStart, [0x00, 0x10]);
    vector!(DcSpeedCounterStart::MIN, DcSpeedCounterStart, [0x80, 0x00]);
    vector!(DcSpeedCounterStart::MAX, DcSpeedCounterStart, [0xFF, 0x3F]);
    vector!(DcSpeedCounterDifference(-1), DcSpeedCounterDifference, [0xFF, 0xFF]);
    vector!(DcFilterDifference::default(), DcFilterDifference, [0x04]);
    vector!(DcFilterSpeed::default(), DcFilterSpeed, [0x0C]);
    vector!(DcLatchMode { forwarding_direction: true, reserved: 0 }, DcLatchMode, [0x01]);
}

// covers: codec-registers
#[test]
fn sync_and_latch_vectors() {
    let control = DcCyclicUnitControl { sync_by_pdi: true, latch1_by_pdi: true, ..DcCyclicUnitControl::default() };
    vector!(control, DcCyclicUnitControl, [0x21]);
    vector!(DcCyclicUnitControl { latch0_by_pdi: true, ..Default::default() }, DcCyclicUnitControl, [0x10]);
    let activation = DcActivation { cyclic_unit: true, sync0: true, ..DcActivation::default() };
    vector!(activation, DcActivation, [0x03]);
    let activation =
        DcActivation { sync1: true, extend_start_time: true, near_future_select: true, ..Default::default() };
    vector!(activation, DcActivation, [0x54]);
    vector!(DcPulseLength(0x0064), DcPulseLength, [0x64, 0x00]);
    assert_eq!(DcPulseLength(0x0064).duration_ns(), Some(1000));
    assert_eq!(DcPulseLength(0).duration_ns(), None);
    let status = DcActivationStatus { sync0_pending: true, start_implausible: true, ..Default::default() };
    vector!(status, DcActivationStatus, [0x05]);
    vector!(DcSyncStatus { active: true, reserved: 0 }, DcSyncStatus, [0x01]);
    vector!(DcSyncCycle(1_000_000), DcSyncCycle, [0x40, 0x42, 0x0F, 0x00]);
    vector!(DcLatchControl { negative_single: true, ..Default::default() }, DcLatchControl, [0x02]);
    vector!(DcLatchStatus { positive_event: true, pin: true, ..Default::default() }, DcLatchStatus, [0x05]);
}

// covers: codec-registers
#[test]
fn esc_specific_vectors() {
    vector!(ProductId(0x0102), ProductId, [2, 1, 0, 0, 0, 0, 0, 0]);
    vector!(DigitalOutputs(0x0102_0304), DigitalOutputs, [4, 3, 2, 1]);
    vector!(Gpo(1), Gpo, [1, 0, 0, 0, 0, 0, 0, 0]);
    vector!(Gpi(1), Gpi, [1, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn numbers_too_large_for_their_field_change_no_other_field() {
    assert_eq!(DlControl { rx_fifo: 0xFF, ..DlControl::default() }.bits(), 0x0007_0001);
    assert_eq!(SiiControl { command: SiiCommand::Reserved(0xFF), ..SiiControl::default() }.bits(), 0x0700);
    assert_eq!(WriteProtection { protected: false, reserved: 0xFF }.bits(), 0xFE);
}

macro_rules! round_trips {
    ($($view:ident)*) => {
        proptest! {
            $(
                #[test]
                #[allow(non_snake_case)]
                fn $view(bytes in any::<[u8; $view::LEN]>()) {
                    prop_assert_eq!($view::decode(&bytes).encode(), bytes);
                }
            )*
        }
    };
}

mod any_bytes_round_trip {
    use super::*;

    round_trips! {
        Information Features PortDescriptor StationAddress WriteEnable WriteProtection EscReset
        DlControl PhysicalOffset DlStatus AlControl AlStatus AlStatusCode LedOverride
        PdiControl EscConfiguration PdiInformation PdiConfiguration SyncLatchConfiguration ExtendedPdiConfiguration
        EcatEvent AlEvent RxErrorCounter ErrorCounters
        WatchdogDivider WatchdogTime WatchdogStatus WatchdogCounters
        SiiConfiguration SiiPdiAccess SiiControl SiiAddress SiiData
        MiiControl MiiPhyAddress MiiPhyRegister MiiPhyData MiiEcatAccess MiiPdiAccess MiiPhyPortStatus
        Fmmu SyncManager SyncManagerControl SyncManagerStatus SyncManagerActivate SyncManagerPdiControl
        DcTime DcTime32 DcReceiveTimes DcSystemTimeOffset DcSystemTimeDelay DcSystemTimeDifference
        DcSpeedCounterStart DcSpeedCounterDifference DcFilterDifference DcFilterSpeed DcLatchMode
        DcCyclicUnitControl DcActivation DcPulseLength DcActivationStatus DcSyncStatus DcSyncCycle
        DcLatchControl DcLatchStatus ProductId DigitalOutputs Gpo Gpi
    }
}

// covers: 7.2.1
#[test]
fn the_speed_counter_gives_the_deviation_of_its_clock() {
    let ppb = |diff: i16, start: u16| DcSpeedCounterDifference(diff).deviation_ppb(DcSpeedCounterStart(start));
    assert_eq!((ppb(0, 0x1000), ppb(1, 0x1000), ppb(-100, 0x1000)), (0, 11, -1_191));
    // 3969 / (5 * 8067 * 129)
    assert_eq!(ppb(3_969, 0x1000), 762_797);
    assert_eq!((ppb(i16::MAX, 0x1000), ppb(i16::MIN, 0x80), ppb(1, 0)), (0, 0, 66_666_666));
}
