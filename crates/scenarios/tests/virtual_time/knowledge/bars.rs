//! Bars: time to the first SDO, time and size of the bytes.

use super::*;
use std::time::Instant as WallClock;

use scenarios::segments::{SIXTEEN, drives};

const FIRST_SDO: Duration = Duration::from_millis(5);
/// Of 1,000 SubDevices to bytes and back.
const TO_BYTES_AND_BACK: Duration = Duration::from_millis(5);
const BYTES: usize = 4 << 20;

// covers: states
#[test]
fn the_first_sdo_of_100_known_subdevices_is_answered_within_5_ms() {
    let mixed: Vec<&str> = SIXTEEN.into_iter().cycle().take(100).collect();
    let servos = vec!["servo"; 100];
    for (what, kinds) in [("mixed", mixed), ("servos", servos)] {
        for is_ring in [false, true] {
            for handover in HANDOVERS {
                let described = descriptions(&kinds);
                let options = NetworkOptions::default();
                let mut former = idle(if is_ring { ring(described, options) } else { line(described, options) });
                spoil_siis(&mut former);
                let last = *with_objects(&former).last().expect("there are some");
                let bytes = to_bytes(&former);
                let links = former.into_links();
                let begun = links.network().now().0;
                let mut main_device = resumed(links, &bytes, handover);
                main_device.subdevice(last).sdo_read::<u32>(0x1018, 1).expect("it answers");
                let took = Duration::from_nanos(main_device.now().0 - begun);
                println!("100 SubDevices ({what}, ring {is_ring}, {handover:?}): first SDO after {took:?}");
                assert!(took <= FIRST_SDO, "{took:?}");
                let expected = Event::Resumed { subdevices: 100, in_state: 100, differs: false };
                assert!(events(&mut main_device).contains(&expected));
            }
        }
    }
}

/// The least time of several conversions, and the bytes.
fn convert(knowledge: &Knowledge) -> (Duration, usize) {
    let mut least = Duration::MAX;
    let mut length = 0;
    // Other programs use the processor, too: until one conversion is not interrupted.
    for number in 0..400 {
        if number >= 20 && least <= TO_BYTES_AND_BACK {
            break;
        }
        let begun = WallClock::now();
        let bytes = knowledge.to_bytes();
        let again = Knowledge::from_bytes(&bytes);
        least = least.min(begun.elapsed());
        length = bytes.len();
        assert_eq!(again.as_ref(), Ok(knowledge));
    }
    (least, length)
}

// covers: states
#[test]
fn knowledge_of_1000_takes_5_ms_to_bytes_and_back_and_4_mib() {
    let mixed: Vec<&str> = SIXTEEN.into_iter().cycle().take(1_000).collect();
    let networks = [("mixed", line(descriptions(&mixed), NetworkOptions::default())), ("drives", drives(1_000))];
    for (what, network) in networks {
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
        assert_eq!(main_device.scan().expect("it can be scanned").subdevices.len(), 1_000);
        let knowledge = main_device.knowledge().expect("it is scanned");
        let (took, length) = convert(&knowledge);
        println!("1,000 SubDevices ({what}): {length} bytes, to bytes and back in {took:?}");
        assert!(took <= TO_BYTES_AND_BACK && length <= BYTES, "{took:?}, {length} bytes");
    }
}
