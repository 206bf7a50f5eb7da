//! The live status of the segment without an application: that of the last broadcast, also while an application ends.

use super::*;

fn segment(main_device: &MainDevice<Tap>) -> (u16, u8, bool) {
    let status = main_device.engine().live_status().segment();
    (status.responding, status.al_states, status.is_up)
}

// covers: threads, states
#[test]
fn the_live_status_follows_the_segment_without_an_application() {
    for network in networks() {
        let mut main_device = MainDevice::request(Tap::new(network), &options());
        assert_eq!(segment(&main_device), (0, 0, false), "nothing was asked yet");
        main_device.attend(FOLLOWED);
        assert_eq!(segment(&main_device), (6, 2, true));
        let status = main_device.engine().live_status();
        assert_eq!((status.subdevice_count(), status.subdevice(SubDeviceId(0))), (0, None));
        main_device.subdevice(Position(1)).request_state(AlState::Op).expect("it follows");
        main_device.attend(Duration::from_millis(50));
        assert_eq!(segment(&main_device), (6, 10, true));
        apply(&mut main_device, Fault::PowerOff(DeviceIndex(5)));
        main_device.attend(Duration::from_millis(100));
        assert_eq!(segment(&main_device).0, 5);
        let links = main_device.links_mut().network().cables().len() - MIXED.len() + 1;
        let cables = if links == 2 { vec![CableId(0), CableId(MIXED.len())] } else { vec![CableId(0)] };
        cables.iter().for_each(|cable| apply(&mut main_device, Fault::Cut(*cable)));
        main_device.attend(Duration::from_millis(100));
        assert_eq!(segment(&main_device), (0, 0, false));
        cables.iter().for_each(|cable| apply(&mut main_device, Fault::Heal(*cable)));
        main_device.attend(FOLLOWED);
        assert_eq!(segment(&main_device), (5, 2, true));
    }
}

/// In each millisecond of the end of an application all answer, and their states are those of a moment ago.
// covers: threads, stop
#[test]
fn the_live_status_has_no_gap_when_an_application_ends() {
    for (hangs, network) in [false, true].into_iter().flat_map(|hangs| networks().map(|network| (hangs, network))) {
        let mut application = activate(idle(network), &[0, 1, 2, 3]);
        cycles(&mut application, 300);
        assert!(application.all_settled());
        if hangs {
            application.links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), true));
        }
        let now = application.now();
        application.engine_mut().start_deactivate(Duration::from_millis(150), now).expect("it is active");
        let mut states = Vec::new();
        for _ in 0..300 {
            let status = application.engine().live_status().segment();
            assert!(status.is_up && status.responding == 6, "{status:?} after {states:?}");
            if states.last() != Some(&status.al_states) {
                states.push(status.al_states);
            }
            application.cycle(|_| ());
        }
        let last = if hangs { 2 | 8 } else { 2 };
        assert_eq!((states.first(), states.last()), (Some(&10), Some(&last)), "{states:?}");
    }
}
