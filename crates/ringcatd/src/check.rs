//! What the daemon understood, in text (`ringcatd --check`): nothing is changed, and no frame is sent.

use ringcat_link::interface::{self, free};

use crate::conf::{Conf, Understood};
use crate::device::{Device, Found};
use crate::setup::Setup;
use crate::source::Source;

/// Lines that state what each variable means, where the daemon would listen, and how its interfaces are now.
pub fn lines(conf: &Conf, setup: &Setup, socket: &str) -> Vec<String> {
    let mut lines: Vec<String> =
        conf.understood.iter().map(|Understood { line, name, text }| format!("line {line}: {name}: {text}")).collect();
    lines.push(format!("socket: {socket}, {}", setup.rights));
    for option in &setup.masters {
        let Source::Interfaces(main, backup) = &option.source else {
            lines.push(format!("master {}: {}", option.master, option.source));
            continue;
        };
        let others = setup.others(option.master);
        for (role, device) in [("main", Some(main)), ("backup", backup.as_ref())] {
            let Some(device) = device else { continue };
            for state in states(device, &others) {
                lines.push(format!("master {}: {role} interface {device}: {state}", option.master));
            }
        }
    }
    lines
}

/// How an interface is now, and what else uses it.
fn states(device: &Device, others: &[Device]) -> Vec<String> {
    let found = match device.find(others) {
        Ok(Some(found)) => found,
        Ok(None) => return vec![format!("waits, {}", device.missing())],
        Err(reason) => return vec![format!("waits, {reason}")],
    };
    let Found { name, interface } = found;
    let present = interface::list().into_iter().find(|it| it.index == interface.index);
    let state = match present.as_ref().map(|it| (it.up, it.carrier)) {
        Some((true, true)) => "with a carrier",
        Some((true, false)) => "without a carrier",
        Some((false, _)) => "switched off",
        None => "gone again",
    };
    let shown = Device::Address(interface.mac);
    let mut states = vec![format!("is {name} ({shown}), {state}")];
    states.extend(present.and_then(|it| free::in_use(&it)).map(|use_| format!("attention, {use_}")));
    states
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::SetupOptions;

    // covers: daemon
    #[test]
    fn what_was_understood_is_said_with_lines_and_the_state_of_interfaces() {
        let text = "\nMASTER0_DEVICE=no-such\nRINGCAT_MODE=0664\nRINGCAT_MASTER1_SIM=/srv/a.toml\n";
        let conf = Conf::from_bytes(text.as_bytes()).expect("it is right");
        let setup = Setup::new(SetupOptions::default(), conf.clone()).expect("it fits");
        let found = lines(&conf, &setup, "/run/x");
        assert_eq!(found[0], "line 2: MASTER0_DEVICE: master 0 on interface no-such");
        assert!(found[3].starts_with("socket: /run/x, mode 0664: ") && found[3].ends_with("all others may read"));
        assert!(found[4].starts_with("master 0: main interface no-such: waits, "), "{found:?}");
        assert_eq!(found[5], "master 1: sim:/srv/a.toml");
    }
}
