//! TCP through the mailbox of one SubDevice in virtual time: throughput, and its independence of the
//! application's cycle.
//!
//! The SubDevice has the simulator's IP stack behind its mailbox. It takes 200 us for a received message and no time
//! for messages that it sends unsolicited, so the wire and the MainDevice are measured. The host's end is another stack
//! that runs beside the acyclic half. Process data of the whole segment is exchanged meanwhile.

use std::net::Ipv4Addr;
use std::process::ExitCode;
use std::time::Duration;

use ringcat::{Options, Scan, automatic};
use ringcat_engine::mail::eoe::EthernetPort;
use ringcat_sim::network::NetworkOptions;
use scenarios::ethernet_host::{Addresses, Download, download};
use scenarios::figures::{Figures, verdict};
use scenarios::segments::{descriptions, line};
use scenarios::world::World;

const TERMINAL: usize = 2;
const BYTES: usize = 1_000_000;
const LIMIT: Duration = Duration::from_secs(60);
/// Minimum kilobytes per second with the largest mailbox.
const BAR: f64 = 300.0;
const ADDRESSES: Addresses = Addresses { mac: [2, 0, 0, 0, 0, 9], host: [10, 0, 0, 1], device: [10, 0, 0, 2] };

pub fn main() -> ExitCode {
    let mut figures = Figures::new("EoE: TCP through the mailbox of one SubDevice, virtual time");
    for (mailbox, bar) in [(1486, Some(BAR)), (256, None)] {
        for cycle in [1, 10] {
            let name = format!("mailbox of {mailbox} bytes, cycle of {cycle} ms");
            match measure(mailbox, Duration::from_millis(cycle)) {
                Ok(download) => match bar {
                    Some(bar) => figures.at_least(&name, download.kilobytes_per_second(), bar, "kB/s"),
                    None => figures.show(&name, format!("{:.0} kB/s", download.kilobytes_per_second())),
                },
                Err(error) => {
                    eprintln!("ethernet: {name}: {error}");
                    return ExitCode::FAILURE;
                }
            }
        }
    }
    verdict(figures.print())
}

fn measure(mailbox_bytes: u16, cycle: Duration) -> Result<Download, String> {
    let mut segment = descriptions(&["coupler", "digital-input-8", "ethernet-terminal", "servo"]);
    let terminal = &mut segment[TERMINAL];
    terminal.services.eoe.address = Some(Ipv4Addr::from(ADDRESSES.device));
    terminal.services.eoe.mask = Some(Ipv4Addr::new(255, 255, 255, 0));
    terminal.set_mailbox_bytes(mailbox_bytes);
    let declare = |scan: &Scan| automatic(&scan.subdevices, cycle);
    let network = line(segment, NetworkOptions::default());
    let mut world = World::with(1, network, &Options::default(), declare).map_err(|error| error.to_string())?;
    world.settle();
    let mailbox = world.mailbox(TERMINAL);
    let work = world.start(async move {
        let port = EthernetPort::open(&mailbox).ok_or("the port is taken")?;
        download(mailbox.bus().clone(), &port, ADDRESSES, BYTES, LIMIT).await
    });
    world.finish(LIMIT, work)
}
