//! Master frames in a ring with one cut cable: the rows of the table of store-and-forward (protocol 9.7.5, 9.8).

use ringcat_wire::master_frame::is_master_frame;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT};

use super::duo::{DOMAIN, Device, Duo};
use crate::layout::MasterSizes;
use crate::link::Link;

/// How a copy comes back: on which link, and on which links of the INACTIVE it was received before, in this order.
type Way = (Link, &'static [Link]);

/// Passes a copy through the INACTIVE as often as its way says.
fn pass(second: &mut Device, duo_now: crate::time::Instant, frame: &mut [u8], way: &[Link]) {
    for (number, arrived_on) in way.iter().enumerate() {
        second.exchange.fill(*arrived_on, frame, duo_now);
        // The next reception shows where it was sent; the last one is the way back to the ACTIVE.
        let sent_on = way.get(number + 1).copied().unwrap_or(arrived_on.other());
        frame[6] |= if sent_on == Link::Main { FORWARDED_ON_MAIN } else { FORWARDED_ON_REDUNDANT };
        second.exchange.take_forwarded(frame);
    }
}

// covers: 9.7.5, 9.8, FR-10, FR-11, CF-05, standby
#[test]
fn in_each_row_of_a_cut_one_copy_counts_as_expected_and_none_more() {
    use Link::{Main, Redundant};
    // Paths of the main and of the redundant copy; `None` where a link is down.
    let rows: [(&str, Option<Way>, Option<Way>); 9] = [
        ("no cut", Some((Redundant, &[Redundant])), Some((Main, &[Main]))),
        ("near: first cable", None, Some((Redundant, &[Main, Redundant]))),
        ("near: between SubDevices", Some((Main, &[])), Some((Redundant, &[Main, Redundant]))),
        ("near: last cable", Some((Main, &[])), Some((Redundant, &[Main]))),
        ("near: between MainDevices", Some((Main, &[Redundant])), None),
        ("far: first cable", Some((Main, &[Redundant])), Some((Redundant, &[]))),
        ("far: between SubDevices", Some((Main, &[Redundant, Main])), Some((Redundant, &[]))),
        ("far: last cable", Some((Main, &[Redundant, Main])), None),
        ("far: between MainDevices", None, Some((Redundant, &[Main]))),
    ];
    for (row, main, redundant) in rows {
        let mut duo = Duo::new(MasterSizes { to_inactive: 3, to_active: 3, ..MasterSizes::default() });
        for round in 1..6 {
            duo.first.exchange.to_partner_mut().fill(round);
            duo.second.exchange.to_partner_mut().fill(0x80 + round);
            duo.now += super::duo::PERIOD;
            duo.first.exchange.begin_role(duo.now);
            duo.first.exchange.process(DOMAIN, duo.now);
            duo.first.exchange.queue(DOMAIN, duo.now);
            let mut sent = std::vec::Vec::new();
            duo.first.exchange.send(duo.now, &mut |link, bytes| sent.push((link, bytes.to_vec())));
            for (link, mut frame) in sent {
                let Some((back, way)) = (if link == Main { main } else { redundant }) else { continue };
                duo.process(&mut frame);
                pass(&mut duo.second, duo.now, &mut frame, way);
                if is_master_frame(&frame) {
                    for fragment in ringcat_wire::master_frame::fragments_mut(&mut frame) {
                        let expected = if way.is_empty() { 0 } else { fragment.head.area.weight() };
                        assert_eq!(fragment.wkc(), expected, "{row}, {link} copy, {:?}", fragment.head.area);
                    }
                }
                duo.first.exchange.receive(back, &frame, duo.now);
            }
            duo.second.exchange.begin_role(duo.now);
            assert_eq!(duo.first.exchange.from_partner(), [0x80 + round; 3], "{row}");
            assert_eq!(duo.second.exchange.from_partner(), [round; 3], "{row}");
        }
        assert!(duo.first.exchange.partner().is_ready(), "{row}: {:?}", duo.first.exchange.partner());
    }
}
