//! The first frames of the next owner: they only read until the segment is verified, their numbers go on or begin
//! elsewhere, and so do the counters of mails.

use super::*;
use ringcat_wire::mailbox::Header;
use ringcat_wire::register::map;
use scenarios::capture::ethercat::{Frame, READS};
use scenarios::recorded_links::RecordedLinks;

/// Commands: APRD, BRD, FPWR.
const APRD: u8 = 1;
const BRD: u8 = 7;
const FPWR: u8 = 5;

/// Goes on with all frames recorded, for a time.
fn recorded(network: Network, bytes: &[u8], handover: Handover, time: Duration) -> MainDevice<RecordedLinks> {
    let knowledge = Knowledge::from_bytes(bytes).expect("they were written");
    let mut main_device = MainDevice::request(RecordedLinks::new(network), &options());
    main_device.resume(knowledge, handover).expect("the segment answers");
    main_device.attend(time);
    main_device
}

fn numbers(sent: &[(ringcat::Instant, Vec<u8>)]) -> Vec<u16> {
    let frames = sent.iter().map(|(_, bytes)| Frame::parse(bytes).expect("it is sound"));
    frames.filter(Frame::is_acyclic).map(|frame| frame.number()).collect()
}

/// A former owner that has used the segment, with its last frame number.
fn former(network: Network) -> (Network, Vec<u8>, u16) {
    let mut links = RecordedLinks::new(network);
    links.sent.clear();
    let mut main_device = MainDevice::request(links, &options());
    main_device.attend(Duration::from_secs(1));
    main_device.subdevice(Position(0)).sdo_read::<u32>(0x1018, 1).expect("it answers");
    let bytes = main_device.knowledge().expect("it is scanned").to_bytes();
    let mut links = main_device.into_links();
    let last = *numbers(&links.sent).last().expect("it has sent some");
    let other = line(descriptions(&["coupler"]), NetworkOptions::default());
    (std::mem::replace(links.network_mut(), other), bytes, last)
}

/// Counted SubDevices, station addresses and AL states are read of each position before the first write.
// covers: states
#[test]
fn nothing_is_written_before_count_addresses_and_states_are_verified() {
    for handover in HANDOVERS {
        for network in networks() {
            let (network, bytes, _) = former(network);
            let mut main_device = recorded(network, &bytes, handover, Duration::from_millis(50));
            main_device.subdevice(Position(0)).sdo_read::<u32>(0x1018, 1).expect("it answers");
            let sent = std::mem::take(&mut main_device.links_mut().sent);
            let mut positions = [0_u32; 2];
            let mut counted = false;
            let mut first_write = None;
            for (at, bytes) in &sent {
                let frame = Frame::parse(bytes).expect("it is sound");
                for datagram in &frame.datagrams {
                    let is_read = READS.contains(&datagram.command);
                    if !is_read {
                        first_write.get_or_insert(*at);
                    }
                    if first_write.is_some() {
                        continue;
                    }
                    counted |= datagram.command == BRD;
                    let position = u32::from(0_u16.wrapping_sub(datagram.adp));
                    let covers = |register: ringcat::RegisterAddress| {
                        let end = usize::from(datagram.ado) + datagram.data.len();
                        (usize::from(datagram.ado)..end).contains(&usize::from(register.0))
                    };
                    for (seen, register) in positions.iter_mut().zip([map::STATION_ADDRESS, map::AL_STATUS]) {
                        if datagram.command == APRD && covers(register) && position < u32::BITS {
                            *seen |= 1 << position;
                        }
                    }
                }
            }
            let all = (1 << MIXED.len()) - 1;
            assert!(counted && positions == [all; 2], "{handover:?}: {counted}, {positions:x?}");
            assert!(first_write.is_some(), "the next owner works");
        }
    }
}

// covers: states
#[test]
fn numbers_of_frames_go_on_after_a_handover_and_begin_elsewhere_after_a_crash() {
    for number in 0..2 {
        let owned = || former(networks().into_iter().nth(number).expect("two"));
        let (network, bytes, last) = owned();
        let mut main_device = recorded(network, &bytes, Handover::Orderly, Duration::from_millis(10));
        let next = numbers(&std::mem::take(&mut main_device.links_mut().sent));
        assert_eq!(next[0], last.wrapping_add(1) & 0x7FFF, "in order");
        // The former owner may have sent some thousand frames since it wrote the bytes.
        let mut begun = Vec::new();
        for moment in 0..20_u64 {
            let (mut network, bytes, _) = owned();
            network.advance_by(Duration::from_micros(moment * 137));
            let mut main_device = recorded(network, &bytes, Handover::AfterCrash, Duration::from_millis(10));
            let next = numbers(&std::mem::take(&mut main_device.links_mut().sent))[0];
            begun.push(next);
        }
        let near = begun.iter().filter(|next| next.wrapping_sub(last) & 0x7FFF < 200).count();
        begun.sort_unstable();
        begun.dedup();
        assert!(near <= 2 && begun.len() >= 18, "{near} of 20 behind {last:#x}: {begun:x?}");
    }
}

// covers: states, mailbox
#[test]
fn the_first_mail_has_counter_0_after_a_crash_and_the_next_one_otherwise() {
    for handover in HANDOVERS {
        for network in networks() {
            let (network, bytes, _) = former(network);
            let known = Knowledge::from_bytes(&bytes).expect("they were written");
            let mut main_device = recorded(network, &bytes, handover, Duration::from_millis(5));
            for at in [0, 3] {
                main_device.subdevice(Position(at)).sdo_read::<u32>(0x1018, 1).expect("it answers");
            }
            let sent = std::mem::take(&mut main_device.links_mut().sent);
            for at in [0, 3] {
                let known = &known.subdevices[at];
                let receive = known.info.mailbox.expect("it has one").receive_offset;
                let station = known.info.station.0;
                let counters: Vec<u8> = sent
                    .iter()
                    .flat_map(|(_, bytes)| {
                        let frame = Frame::parse(bytes).expect("it is sound");
                        let to_it = frame.datagrams.into_iter();
                        let to_it = to_it.filter(|it| (it.command, it.adp, it.ado) == (FPWR, station, receive));
                        let header = |data: &[u8]| Header::decode(data.first_chunk().expect("a header"));
                        to_it.map(|it| header(it.data).counter).collect::<Vec<u8>>()
                    })
                    .collect();
                let former = known.mailbox.as_ref().expect("it is in use").counter;
                let expected = if handover == Handover::AfterCrash { 0 } else { former % 7 + 1 };
                assert_eq!(counters.first(), Some(&expected), "{handover:?}, {at}: {counters:?} after {former}");
                assert!(counters.windows(2).all(|pair| pair[1] == pair[0] % 7 + 1), "{counters:?}");
            }
        }
    }
}
