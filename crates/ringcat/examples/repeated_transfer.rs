//! Two controllers at one simulated ring, in virtual time. The ACTIVE writes a recipe into a SubDevice by SDO; the role
//! is handed over meanwhile, which cancels the transfer. The program is the same on both controllers: whichever is
//! ACTIVE repeats the transfer until it has succeeded, and then reports this to the other one in its process data.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use ringcat::sim::cable::Host;
use ringcat::sim::catalogue;
use ringcat::sim::device::Device;
use ringcat::sim::network::builder::SegmentBuilder;
use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{MasterSizes, Policy, RoleControl, RoleRequest, StandbyOptions};
use ringcat::{Error, MainDevice, MainDeviceRole, Options, SubDeviceId, automatic};

const CYCLE: Duration = Duration::from_millis(1);
/// The SubDevice with the recipe, and the object.
const RECIPE_AT: SubDeviceId = SubDeviceId(2);
const OBJECT: (u16, u8) = (0x2002, 0);
/// In the process data for the other controller: the recipe is written.
const WRITTEN: u8 = 1;

fn recipe() -> Vec<u8> {
    (0..20_000_u32).map(|number| (number % 251) as u8).collect()
}

/// The program of each controller: if it is ACTIVE it writes the recipe as soon as that is wanted, and then sends its
/// handle.
fn controller(
    mut links: HostLinks,
    listen: Duration,
    is_wanted: &AtomicBool,
    begun: &Sender<RoleControl>,
) -> Result<(), Error> {
    let host = links.host();
    links.switch(true);
    let mut sizes = MasterSizes::default();
    (sizes.to_inactive, sizes.to_active) = (1, 1);
    let options = Options::default().with_standby(StandbyOptions::default().with_sizes(sizes).with_needs_guard(false));
    let policy = Policy::default().with_time_out(3, Duration::ZERO).with_listen(listen);
    let main_device = MainDevice::request(links, &options);
    let mut application = main_device.join(&policy, |scan| automatic(&scan.subdevices, CYCLE))?;
    let (mut transfer, mut is_written) = (None, false);
    loop {
        let is_due = is_wanted.load(Ordering::Relaxed) && !is_written && transfer.is_none();
        if is_due && application.role() == MainDeviceRole::Active {
            println!("{host:?} is ACTIVE, and writes the recipe");
            transfer = Some(application.subdevice(RECIPE_AT).sdo_write(OBJECT.0, OBJECT.1, recipe()));
            if let Some(control) = application.role_control() {
                // The receiver is gone after the first one.
                let _ = begun.send(control);
            }
        }
        application.cycle(|data| {
            is_written |= data.from_partner().first() == Some(&WRITTEN);
            if let Some(byte) = data.to_partner_mut().first_mut() {
                *byte = if is_written { WRITTEN } else { 0 };
            }
        });
        let ended = transfer.as_mut().and_then(|transfer| transfer.take());
        match ended {
            Some(Ok(())) => {
                println!("{host:?}: the recipe is written");
                (transfer, is_written) = (None, true);
            }
            // It is repeated as long as this controller is ACTIVE.
            Some(Err(error)) => {
                println!("{host:?}: not written: {error}");
                transfer = None;
            }
            // It was cancelled: the other controller repeats it.
            None if transfer.as_ref().is_some_and(|transfer| !transfer.is_running()) => {
                println!("{host:?} is {}: its transfer was cancelled", application.role());
                transfer = None;
            }
            None => {}
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let kinds = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
    let devices = kinds.iter().filter_map(|kind| catalogue::by_name(kind)).map(Device::new).collect();
    let mut hosts = TwoHosts::new(SegmentBuilder::ring_of_two(devices, Host::First).build()?);
    let (is_wanted, (sender, begun)) = (Arc::new(AtomicBool::new(false)), channel());
    for (host, listen) in [(Host::First, Duration::from_millis(10)), (Host::Second, Duration::from_millis(500))] {
        let (sender, is_wanted) = (sender.clone(), is_wanted.clone());
        hosts.start(host, move |links| {
            if let Err(error) = controller(links, listen, &is_wanted, &sender) {
                eprintln!("{error}");
            }
        })?;
    }
    hosts.run_for(Duration::from_secs(1));
    is_wanted.store(true, Ordering::Relaxed);
    let control = loop {
        hosts.run_for(CYCLE);
        if let Ok(control) = begun.try_recv() {
            break control;
        }
    };
    println!("the role is handed over");
    control.request(RoleRequest::HandOver);
    hosts.run_for(Duration::from_secs(2));
    Ok(())
}
