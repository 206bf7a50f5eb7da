//! Orders to a running simulator: their syntax, and what they do.
//!
//! Input: a line of text. Output: an answer. Its last line is `ok` or begins with `error:`.

use ringcat::sim::cable::{CableId, DeviceIndex, Endpoint, HostLink};
use ringcat::sim::device::Device;
use ringcat::sim::fault::Fault;
use ringcat::sim::network::Network;
use ringcat::wire::address::RegisterAddress;

use super::mail_orders;
use super::names::{describe_cable, describe_device, end_name};
use super::plant::Plant;

/// Most bytes of registers in one answer.
const MOST_BYTES: usize = 256;

/// What `help` says.
pub const HELP: &str = "\
cut A-B         cut the cable between devices A and B, numbers or names
cut main        cut the cable of the main interface (or: redundant)
heal A-B        repair the cable (or: main, redundant, all)
drop A-B N      lose the next N frames on that cable, in each direction
                (or: main, redundant)
power off A     switch device A off
power on A      switch device A on
hang A          the application of device A hangs, its controller works
wake A          the application of device A goes on
outputs A       process data outputs of device A, in hexadecimal
gaps            by device: longest time between two outputs, changes of the
                MainDevice that sent them, and how many were older than those
                before, since the last `gaps`; the first one begins
inputs A HEX    process data inputs of device A, as far as its application
                does not set them
register A R N  N bytes of the controller of device A from register R on, as in
                `register 2 0x0928 4`, in hexadecimal
clocks          each clock minus the first one, in nanoseconds; -: no clock
mail            orders about mailboxes: `help mail` lists them
status          devices and their states, cut cables, counters
quit            end the simulator";

/// What follows from an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// An answer.
    Answer(String),
    /// The simulator shall end.
    Quit,
}

/// Carries out an order.
pub fn carry_out(line: &str, plant: &mut Plant) -> Outcome {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        [] => Outcome::Answer(String::new()),
        ["quit"] => Outcome::Quit,
        words => Outcome::Answer(match answer(words, plant) {
            Ok(text) if text.is_empty() => "ok\n".to_owned(),
            Ok(text) => format!("{text}\nok\n"),
            Err(text) => format!("error: {text}\n"),
        }),
    }
}

fn answer(words: &[&str], plant: &mut Plant) -> Result<String, String> {
    match words {
        ["help"] => Ok(HELP.to_owned()),
        ["help", "mail"] => Ok(mail_orders::HELP.to_owned()),
        ["status"] => Ok(plant.status()),
        ["heal", "all"] => Ok(plant.heal_all()),
        ["cut", cable] => {
            let cable = find_cable(cable, plant.network())?;
            plant.cut(cable);
            Ok(format!("cut: {}", describe_cable(cable, plant.network())))
        }
        ["heal", cable] => {
            let cable = find_cable(cable, plant.network())?;
            plant.heal(cable);
            Ok(format!("healed: {}", describe_cable(cable, plant.network())))
        }
        ["drop", cable, count] => {
            let cable = find_cable(cable, plant.network())?;
            let count = count.parse().map_err(|_| format!("expected a number of frames, got \"{count}\""))?;
            plant.network_mut().apply(Fault::Drop { cable, direction: None, count });
            Ok(format!("the next {count} frames are lost: {}", describe_cable(cable, plant.network())))
        }
        ["power", "off", device] => on_device(plant, device, "without power", Fault::PowerOff),
        ["power", "on", device] => on_device(plant, device, "has power", Fault::PowerOn),
        ["hang", device] => on_device(plant, device, "hangs", |device| Fault::Hang(device, true)),
        ["wake", device] => on_device(plant, device, "goes on", |device| Fault::Hang(device, false)),
        ["mail", device, rest @ ..] => {
            let fault = mail_orders::fault(rest)?;
            on_device(plant, device, "its mail", |device| Fault::Mail(device, fault))
        }
        ["emergency", device, code] => {
            let device = find_device(device, plant.network())?;
            mail_orders::emergency(plant.network_mut().device_mut(device), code)?;
            Ok(format!("{}: an emergency", describe_device(device, plant.network())))
        }
        ["outputs", device] => {
            let device = find_device(device, plant.network())?;
            Ok(hex(plant.network().device(device).outputs()))
        }
        ["register", device, address, count] => {
            let device = find_device(device, plant.network())?;
            let (address, count) = area(address, count)?;
            Ok(hex(plant.network().device(device).controller.register(RegisterAddress(address), count)))
        }
        ["gaps"] => Ok(plant.gaps()),
        ["clocks"] => Ok(clocks(plant.network())),
        ["inputs", device, bytes] => {
            let device = find_device(device, plant.network())?;
            let length = plant.network().device(device).inputs().len();
            let bytes = unhex(bytes).ok_or_else(|| format!("expected bytes in hexadecimal, got \"{bytes}\""))?;
            if length > 0 && bytes.len() != length {
                return Err(format!("expected {length} bytes of inputs, got {}", bytes.len()));
            }
            plant.network_mut().device_mut(device).set_inputs(&bytes);
            Ok(String::new())
        }
        _ => Err(format!("\"{}\" is no order; `help` lists them", words.join(" "))),
    }
}

/// The true differences of the clocks, which no MainDevice can read. Those of 32 bits are compared in 32 bits.
fn clocks(network: &Network) -> String {
    let time = |device: &Device| {
        let has_clock = device.description.dc.is_some();
        has_clock.then(|| device.controller.system_time(network.now()) as u32)
    };
    let first = network.devices().find_map(time).unwrap_or(0);
    let difference = |time: u32| (time.wrapping_sub(first) as i32).to_string();
    let shown = network.devices().map(|device| time(device).map_or("-".to_owned(), difference));
    shown.collect::<Vec<_>>().join(" ")
}

/// A register and a number of bytes behind it that a controller has.
fn area(address: &str, count: &str) -> Result<(u16, usize), String> {
    let start = address.strip_prefix("0x").and_then(|digits| u16::from_str_radix(digits, 16).ok());
    let start = start.ok_or_else(|| format!("expected a register such as 0x0928, got \"{address}\""))?;
    let room = (usize::from(u16::MAX) + 1 - usize::from(start)).min(MOST_BYTES);
    let count = count.parse().ok().filter(|count| (1..=room).contains(count));
    count.map(|count| (start, count)).ok_or_else(|| format!("expected 1 to {room} bytes"))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u8>> = text.chars().map(|digit| digit.to_digit(16).map(|digit| digit as u8)).collect();
    let digits = digits.filter(|digits| digits.len() % 2 == 0)?;
    Some(digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect())
}

fn on_device(
    plant: &mut Plant,
    device: &str,
    what: &str,
    fault: impl Fn(DeviceIndex) -> Fault,
) -> Result<String, String> {
    let device = find_device(device, plant.network())?;
    plant.network_mut().apply(fault(device));
    Ok(format!("{}: {what}", describe_device(device, plant.network())))
}

fn find_device(text: &str, network: &Network) -> Result<DeviceIndex, String> {
    let count = network.devices().len();
    let by_number = text.parse().ok().filter(|number| *number < count);
    by_number
        .or_else(|| network.devices().position(|device| device.name() == text))
        .map(DeviceIndex)
        .ok_or_else(|| format!("there is no device \"{text}\"; devices have names and the numbers 0 to {}", count - 1))
}

fn find_cable(text: &str, network: &Network) -> Result<CableId, String> {
    let host = HostLink::ALL.into_iter().find(|link| link.to_string() == text);
    if let Some(link) = host {
        return network.host_cable(link).ok_or_else(|| format!("nothing is plugged into the {link} interface"));
    }
    // Names may have hyphens in them: the one at which both sides are devices counts.
    let splits = text.match_indices('-').map(|(at, _)| (&text[..at], &text[at + 1..]));
    let mut devices = splits.filter_map(|(a, b)| Some((find_device(a, network).ok()?, find_device(b, network).ok()?)));
    let (one, other) = devices.next().ok_or_else(|| {
        format!(
            "\"{text}\" is no cable: expected main, redundant, or two devices as in 3-4; `status` lists the devices"
        )
    })?;
    network.cable_between(one, other).ok_or_else(|| {
        let near = neighbours(one, network);
        format!("no cable joins devices {} and {}; {} has cables to {}", one.0, other.0, one.0, near.join(", "))
    })
}

fn neighbours(device: DeviceIndex, network: &Network) -> Vec<String> {
    let is_here = |end: Endpoint| matches!(end, Endpoint::Device(other, _) if other == device);
    let far = |a, b| if is_here(a) { Some(b) } else { is_here(b).then_some(a) };
    network.cables().filter_map(|cable| far(cable.a, cable.b)).map(|end| end_name(end, network)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat::sim::segment::Segment;

    const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\nname = \"head\"\n[[device]]\n\
                           type = \"servo\"\nname = \"left-axis\"\n\
                           [[device]]\ntype = \"servo\"\nname = \"right-axis\"\n";

    fn plant() -> Plant {
        let segment = Segment::from_toml(SEGMENT, std::path::Path::new(".")).expect("a good segment");
        Plant::new(Network::from_description(segment).expect("plugged"))
    }

    fn say(plant: &mut Plant, line: &str) -> String {
        match carry_out(line, plant) {
            Outcome::Answer(text) => text,
            Outcome::Quit => "quit".to_owned(),
        }
    }

    // covers: sim-interfaces
    #[test]
    fn orders_name_devices_by_number_or_name_and_answers_say_what_was_done() {
        let mut plant = plant();
        let cut = "cut: cable between 1 \"left-axis\" and 2 \"right-axis\"\nok\n";
        assert_eq!(say(&mut plant, "cut 1-2"), cut);
        assert_eq!(say(&mut plant, " cut  left-axis-right-axis "), cut);
        assert!(say(&mut plant, "status").contains("cut: cable between 1 "));
        assert_eq!(say(&mut plant, "heal all"), format!("healed{}", &cut[3..]));
        assert!(!say(&mut plant, "status").contains("cut: "));
        assert_eq!(say(&mut plant, "power off head"), "0 \"head\": without power\nok\n");
        assert!(!plant.network().device(DeviceIndex(0)).controller.is_powered());
        assert_eq!(say(&mut plant, "power on 0"), "0 \"head\": has power\nok\n");
        assert_eq!(say(&mut plant, "register left-axis 0x0000 1"), "11\nok\n");
        assert!(say(&mut plant, "drop main 3").ends_with("ok\n"));
        assert_eq!(say(&mut plant, "mail left-axis lose 1"), "1 \"left-axis\": its mail\nok\n");
        assert!(say(&mut plant, "help mail").contains("emergency A CODE"));
        assert_eq!(say(&mut plant, "quit"), "quit");
    }

    // covers: sim-interfaces
    #[test]
    fn an_order_that_makes_no_sense_is_answered_with_what_would() {
        let mut plant = plant();
        for (line, part) in [
            ("cut 0-2", "0 has cables to the main interface, 1 \"left-axis\""),
            ("cut 7-8", "expected main, redundant, or two devices as in 3-4"),
            ("power off 3", "names and the numbers 0 to 2"),
            ("drop main many", "expected a number of frames, got \"many\""),
            ("register 0 928 4", "expected a register such as 0x0928, got \"928\""),
            ("register 0 0xffff 2", "expected 1 to 1 bytes"),
            ("inputs 0 123", "expected bytes in hexadecimal, got \"123\""),
            ("mail 1 eat 3", "\"mail A eat 3\" is no order"),
            ("emergency 1 8130", "its mailbox is not in use"),
            ("emergency 1 12345", "expected a code of 16 bits"),
            ("make tea", "`help` lists them"),
        ] {
            let answer = say(&mut plant, line);
            assert!(answer.starts_with("error: ") && answer.contains(part), "{line}: {answer}");
        }
    }

    // covers: sim-interfaces
    #[test]
    fn a_host_cable_works_when_it_is_whole_and_its_interface_has_carrier() {
        let mut plant = plant();
        let carrier = |plant: &mut Plant| {
            plant.network_mut().advance_by(std::time::Duration::from_millis(1));
            plant.network().carrier(HostLink::Main)
        };
        assert!(carrier(&mut plant));
        assert!(plant.set_carrier(HostLink::Main, false));
        assert!(!plant.set_carrier(HostLink::Main, false));
        assert!(!carrier(&mut plant));
        say(&mut plant, "heal all");
        assert!(!carrier(&mut plant));
        say(&mut plant, "cut main");
        plant.set_carrier(HostLink::Main, true);
        assert!(!carrier(&mut plant));
        say(&mut plant, "heal main");
        assert!(carrier(&mut plant));
    }
}
