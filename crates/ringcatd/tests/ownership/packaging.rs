//! The files of the package: read by the programs that they are for.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ringcatd::conf::Conf;

use crate::bench::{copy_program, directory};
use crate::running::PROGRAM;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(file(name)).expect(name)
}

/// The output of a program; `None` where it is not installed.
fn run(program: &str, arguments: &[&str]) -> Option<Output> {
    let output = Command::new(program).args(arguments).output();
    match output {
        Ok(output) => Some(output),
        Err(error) => {
            println!("skipped: {program}: {error}");
            None
        }
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

// covers: daemon
#[test]
fn the_example_is_right_as_soon_as_it_names_a_master_whichever_line_is_used() {
    let example = text("ethercat.conf");
    let mistakes = Conf::from_bytes(example.as_bytes()).expect_err("it names no master");
    // The group comes with the package.
    let is_group = |text: &str| text.starts_with("RINGCAT_GROUP: there is no group \"ethercat\"");
    assert!(mistakes.iter().all(|it| it.text.starts_with("there is no master") || is_group(&it.text)), "{mistakes:?}");
    let ready = example.replace("\nMASTER0_DEVICE=\"\"", "\nMASTER0_DEVICE=\"eth1\"");
    let ready = ready.replace("RINGCAT_GROUP=\"ethercat\"", "RINGCAT_GROUP=\"0\"");
    let conf = Conf::from_bytes(ready.as_bytes()).expect("it names a master");
    assert_eq!((conf.masters.len(), conf.own.group), (1, Some(0)));
    let is_setting = |line: &str| {
        let name = line.trim_start_matches('#').split('=').next().unwrap_or_default();
        line.starts_with('#') && line.contains('=') && !name.is_empty() && !name.contains(' ')
    };
    let mut used = Vec::new();
    for line in ready.lines().filter(|line| is_setting(line)) {
        let setting = &line[1..];
        let is_simulated = setting.starts_with("RINGCAT_MASTER0_SIM");
        let base = if is_simulated { ready.replace("MASTER0_DEVICE=\"eth1\"", "") } else { ready.clone() };
        let base = base.replace(&format!("\n{line}\n"), &format!("\n{setting}\n"));
        let value = if setting.ends_with("\"\"") { setting.replace("\"\"", "\"eth9\"") } else { setting.to_owned() };
        let base = base.replace(&format!("\n{setting}\n"), &format!("\n{value}\n"));
        let read = Conf::from_bytes(base.as_bytes());
        let read = read.unwrap_or_else(|mistakes| panic!("{setting}: {mistakes:?}"));
        let name = value.split('=').next().expect("a name").to_owned();
        assert!(read.understood.iter().any(|it| it.name == name && !it.text.contains("without effect")), "{setting}");
        used.push(name);
    }
    assert!(used.len() >= 11, "{used:?}");
}

/// The unit with the programs of this build in place of those that are installed.
fn unit(directory: &Path) -> PathBuf {
    let path = directory.join("ethercat.service");
    let unit = text("ethercat.service");
    assert!(unit.contains("ExecStart=/usr/sbin/ringcatd --conf /etc/ethercat.conf\n"));
    std::fs::write(&path, unit.replace("/usr/sbin/ringcatd", PROGRAM)).expect("it can be written");
    path
}

// covers: daemon
#[test]
fn systemd_accepts_the_unit_and_finds_little_exposed() {
    let directory = directory();
    let path = unit(&directory);
    let path = path.to_str().expect("text");
    let Some(verified) = run("systemd-analyze", &["verify", "--man=no", path]) else { return };
    let about = said(&verified);
    let ours: Vec<&str> = about.lines().filter(|line| line.contains("ethercat")).collect();
    assert!(verified.status.success() && ours.is_empty(), "{about}");
    let security = run("systemd-analyze", &["security", "--offline=yes", "--threshold=45", path]).expect("it is there");
    let about = said(&security);
    println!("{}", about.lines().last().unwrap_or_default());
    // Of a machine without systemd the tool reads nothing; of the unit it says how exposed it is.
    assert!(security.status.success() && about.contains("Overall exposure level"), "{about}");
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn systemd_makes_the_group_and_the_directory_of_the_package() {
    let root = directory();
    let at = format!("--root={}", root.display());
    std::fs::create_dir_all(root.join("etc")).expect("it can be made");
    let (users, files) = (file("ethercat.sysusers"), file("ethercat.tmpfiles"));
    let Some(made) = run("systemd-sysusers", &[&at, users.to_str().expect("text")]) else { return };
    assert!(made.status.success(), "{}", said(&made));
    let groups = std::fs::read_to_string(root.join("etc/group")).expect("it was made");
    assert!(groups.lines().any(|line| line.starts_with("ethercat:")), "{groups}");
    std::fs::write(root.join("etc/passwd"), "root:x:0:0::/:/bin/sh\n").expect("it can be written");
    let Some(made) = run("systemd-tmpfiles", &[&at, "--create", files.to_str().expect("text")]) else { return };
    assert!(root.join("run/ringcat").is_dir() || ringcat_link::process::effective_user() != 0, "{}", said(&made));
    std::fs::remove_dir_all(root).expect("it is there");
}

// covers: daemon
#[test]
fn scripts_of_the_packages_have_no_warnings_and_pages_no_mistakes() {
    let maintainers = ["ringcat.postinst", "ringcat.postrm", "ringcat.preinst", "ringcat.prerm"];
    let mut scripts = vec![file("install"), file("deb"), file("../crates/ffi/install")];
    scripts.extend(maintainers.map(|name| file("debian").join(name)));
    scripts.push(file("debian/libethercat1-dev.preinst"));
    let pages = ["ethercatctl.8", "ringcat.1", "ringcatd.8"].map(|name| file("man").join(name));
    let severe = ["--severity=warning"];
    for (program, options, files) in
        [("shellcheck", &severe[..], &scripts[..]), ("mandoc", &["-Tlint", "-Wwarning"], &pages)]
    {
        for path in files {
            let arguments = [options, &[path.to_str().expect("text")]].concat();
            let Some(checked) = run(program, &arguments) else { break };
            assert!(checked.status.success(), "{}: {}", path.display(), said(&checked));
        }
    }
}

// covers: daemon
#[test]
fn the_init_script_has_the_verbs_of_the_manual_and_its_header() {
    let script = text("ethercat.init");
    for key in ["Provides: ", "Required-Start: ", "Required-Stop: ", "Default-Start: ", "Default-Stop: "] {
        assert!(script.lines().any(|line| line.starts_with(&format!("# {key}"))), "{key}");
    }
    let path = file("ethercat.init");
    let path = path.to_str().expect("text");
    let checked = run("sh", &["-n", path]).expect("sh is there");
    assert!(checked.status.success(), "{}", said(&checked));
    if let Some(checked) = run("shellcheck", &[path]) {
        assert!(checked.status.success(), "{}", said(&checked));
    }
    let usage = run("sh", &[path, "reload"]).expect("sh is there");
    assert_eq!(usage.status.code(), Some(2));
    assert!(said(&usage).contains("{start|stop|restart|force-reload|status|check}"), "{}", said(&usage));
    // The program that it calls, with its own directory in place of that of the package.
    let directory = directory();
    let ours = directory.join("ethercat.init");
    let program = directory.join("ethercatctl");
    std::fs::write(&ours, script.replace("/usr/sbin/ethercatctl", program.to_str().expect("text"))).expect("written");
    let written = directory.join("written");
    std::fs::write(&written, "#!/bin/sh\necho \"called: $*\"\n").expect("it can be written");
    copy_program(&written, &program);
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&program, mode).expect("it is writable");
    let called = |verb: &str| said(&run("sh", &[ours.to_str().expect("text"), verb]).expect("sh is there"));
    assert_eq!(called("start"), "Starting EtherCAT master\ncalled: start\n");
    assert_eq!(called("stop"), "Shutting down EtherCAT master\ncalled: stop\n");
    assert_eq!(called("force-reload"), "called: restart\n");
    assert_eq!(called("status"), "called: status\n");
    std::fs::remove_dir_all(directory).expect("it is there");
}
