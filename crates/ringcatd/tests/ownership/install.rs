//! `packaging/install`: the places of its files, edited configuration files, and what a removal leaves.

use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::bench::directory;

fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging/install")
}

/// The root directory of a package, and programs to install there, in place of those of a release.
struct Root {
    directory: PathBuf,
}

impl Root {
    fn new() -> Root {
        let directory = directory();
        let shell = directory.join("programs/shell");
        std::fs::create_dir_all(shell.join("man8")).expect("it can be made");
        for program in ["ringcat", "ethercat", "ringcatd"] {
            std::fs::copy("/bin/sleep", directory.join("programs").join(program)).expect("sleep is there");
        }
        for file in ["man8/ethercat.8", "man8/ethercat-slaves.8", "ethercat.bash", "_ethercat", "ethercat.fish"] {
            std::fs::write(shell.join(file), file).expect("it can be written");
        }
        Root { directory }
    }

    fn path(&self, path: &str) -> PathBuf {
        self.directory.join("root").join(path.trim_start_matches('/'))
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut install = Command::new(script());
        install.env_remove("PREFIX").env_remove("DESTDIR").arg("--destdir").arg(self.path("/")).args(arguments);
        install.output().expect("sh is there")
    }

    /// Installs without the libraries, whose own tests are those of `crates/ffi`.
    fn install(&self, arguments: &[&str]) -> String {
        let programs = self.directory.join("programs");
        let mut all = vec!["--programs", programs.to_str().expect("text"), "--without-library"];
        all.extend(arguments);
        said(&self.run(&all), true)
    }

    /// All files, with their places below the root.
    fn files(&self) -> BTreeSet<String> {
        let mut files = BTreeSet::new();
        let mut left = vec![self.path("/")];
        while let Some(directory) = left.pop() {
            for entry in std::fs::read_dir(&directory).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    left.push(path);
                } else {
                    let place = path.strip_prefix(self.path("/")).expect("it is below");
                    files.insert(format!("/{}", place.display()));
                }
            }
        }
        files
    }

    /// No file and no directory is left.
    fn is_empty(&self) -> bool {
        std::fs::read_dir(self.path("/")).is_ok_and(|mut left| left.next().is_none())
    }

    fn write(&self, path: &str, text: &str) {
        std::fs::create_dir_all(self.path(path).parent().expect("it is in a directory")).expect("it can be made");
        std::fs::write(self.path(path), text).expect("it can be written");
    }

    fn text(&self, path: &str) -> String {
        std::fs::read_to_string(self.path(path)).expect(path)
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

fn said(output: &Output, succeeds: bool) -> String {
    let said = String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned();
    assert_eq!(output.status.success(), succeeds, "{said}");
    said
}

const OF_A_DISTRIBUTION: [&str; 25] = [
    "/etc/ethercat.conf",
    "/etc/security/limits.d/ethercat.conf",
    "/usr/bin/ethercat",
    "/usr/bin/ringcat",
    "/usr/lib/systemd/system/ethercat.service",
    "/usr/lib/systemd/system/ringcat-standby@.service",
    "/usr/lib/sysusers.d/ethercat.conf",
    "/usr/lib/tmpfiles.d/ethercat.conf",
    "/usr/lib/udev/rules.d/99-ethercat.rules",
    "/usr/sbin/ethercatctl",
    "/usr/sbin/ringcatd",
    "/usr/share/bash-completion/completions/ethercat",
    "/usr/share/doc/ringcat/CHANGELOG.md",
    "/usr/share/doc/ringcat/LICENSE-APACHE",
    "/usr/share/doc/ringcat/LICENSE-MIT",
    "/usr/share/doc/ringcat/ringcat-standby.conf",
    "/usr/share/fish/vendor_completions.d/ethercat.fish",
    "/usr/share/man/man1/ringcat.1",
    "/usr/share/man/man8/ethercat-slaves.8",
    "/usr/share/man/man8/ethercat.8",
    "/usr/share/man/man8/ethercatctl.8",
    "/usr/share/man/man8/ringcatd.8",
    "/usr/share/ringcat/demo.toml",
    "/usr/share/ringcat/installed",
    "/usr/share/zsh/vendor-completions/_ethercat",
];

// covers: daemon
#[test]
fn all_files_are_installed_in_the_places_of_a_distribution_and_removed_again() {
    let root = Root::new();
    let about = root.install(&["--prefix", "/usr"]);
    let expected: BTreeSet<String> = OF_A_DISTRIBUTION.iter().map(ToString::to_string).collect();
    assert_eq!(root.files(), expected);
    assert!(about.contains("23 files") && !about.contains("next:"), "{about}");
    assert_eq!(std::fs::read_link(root.path("/usr/sbin/ethercatctl")).expect("a link"), Path::new("ringcatd"));
    // The list of the files and the link are the only ones that are not counted.
    assert_eq!(expected.len(), 25);
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
    let again = said(&root.run(&["--prefix", "/usr", "--uninstall"]), false);
    assert!(again.contains("nothing is installed here"), "{again}");
}

// covers: daemon
#[test]
fn paths_in_installed_files_exist_with_every_prefix() {
    for (prefix, init, units) in [
        ("/usr", "systemd", "/usr/lib/systemd/system"),
        ("/usr/local", "systemd", "/usr/local/lib/systemd/system"),
        ("/opt/etherlab", "systemd", "/usr/local/lib/systemd/system"),
        ("/opt/etherlab", "sysv", ""),
    ] {
        let root = Root::new();
        root.install(&["--prefix", prefix, "--init", init]);
        let texts: Vec<String> = match init {
            "systemd" => ["ethercat.service", "ringcat-standby@.service"]
                .map(|unit| root.text(&format!("{units}/{unit}")))
                .into_iter()
                .collect(),
            _ => vec![root.text("/etc/init.d/ethercat"), root.text("/etc/sysconfig/ethercat")],
        };
        let words = texts.iter().flat_map(|text| text.split(|it: char| it.is_whitespace() || it == '='));
        let named: BTreeSet<&str> = words.filter(|word| word.contains("bin/") && word.starts_with('/')).collect();
        let expected = if init == "systemd" { 2 } else { 1 };
        let named: Vec<&str> = named.into_iter().filter(|program| *program != "/bin/sh").collect();
        assert_eq!(named.len(), expected, "{named:?}");
        assert!(named.iter().all(|program| root.path(program).exists() && program.starts_with(prefix)), "{named:?}");
    }
}

/// `lib` and `include` are in the test of `crates/ffi`.
// covers: daemon
#[test]
fn the_prefix_of_the_manual_has_its_bin_sbin_and_etc_init_d() {
    let root = Root::new();
    root.install(&["--prefix", "/opt/etherlab"]);
    for (path, mode) in
        [("bin/ethercat", 0o755), ("sbin/ethercatctl", 0o755), ("sbin/ringcatd", 0o755), ("etc/init.d/ethercat", 0o755)]
    {
        let file = std::fs::metadata(root.path("/opt/etherlab").join(path)).expect(path);
        assert_eq!(file.mode() & 0o777, mode, "{path}");
    }
    let script = root.text("/opt/etherlab/etc/init.d/ethercat");
    assert!(script.contains("exec /opt/etherlab/sbin/ethercatctl "), "{script}");
    // The system's own place has none where systemd starts the daemon.
    assert!(!root.path("/etc/init.d/ethercat").exists());
    said(&root.run(&["--prefix", "/opt/etherlab", "--uninstall"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
    root.install(&["--prefix", "/usr/local"]);
    assert!(!root.path("/usr/local/etc").exists());
}

// covers: daemon
#[test]
fn a_prefix_with_files_of_another_master_is_refused_and_stays_as_it_is() {
    let root = Root::new();
    let programs = root.directory.join("programs");
    let programs = ["--programs", programs.to_str().expect("text"), "--without-library", "--prefix", "/opt/etherlab"];
    let other = "/opt/etherlab/etc/init.d/ethercat";
    root.write(other, "of another master\n");
    let refused = said(&root.run(&programs), false);
    assert!(refused.contains(&format!("{other} is of another program: remove that, or choose")), "{refused}");
    assert_eq!(root.files(), BTreeSet::from([other.to_owned()]));
    assert_eq!(root.text(other), "of another master\n");
    std::fs::remove_file(root.path(other)).expect("it is there");
    for _ in 0..2 {
        said(&root.run(&programs), true);
    }
    assert!(root.text(other).contains("ethercatctl"));
}

// covers: daemon
#[test]
fn an_edited_script_of_the_prefix_is_kept_and_the_new_one_is_beside_it() {
    let root = Root::new();
    let prefix = ["--prefix", "/opt/etherlab"];
    root.install(&prefix);
    let script = "/opt/etherlab/etc/init.d/ethercat";
    let (new, list) = (format!("{script}.new"), "/opt/etherlab/share/ringcat/installed");
    // An installation of a version before this one had it as a file, and had another text.
    let others: Vec<String> = root.text(list).lines().filter(|it| !it.contains(script)).map(String::from).collect();
    root.write(list, &format!("{}\nf service {script} 4294967295 0\n", others.join("\n")));
    root.write(script, "");
    root.install(&prefix);
    assert!(root.text(script).contains("ethercatctl") && !root.path(&new).exists());
    let edited = format!("{}# edited\n", root.text(script));
    root.write(script, &edited);
    for _ in 0..2 {
        let about = root.install(&prefix);
        assert!(about.contains(&format!("kept, because it was edited: {}", root.path(script).display())), "{about}");
        assert_eq!((root.text(script), root.path(&new).exists()), (edited.clone(), true));
    }
    // Also where it was kept by a removal.
    said(&root.run(&["--prefix", "/opt/etherlab", "--uninstall"]), true);
    assert_eq!(root.files(), BTreeSet::from([script, list].map(String::from)));
    root.install(&prefix);
    assert_eq!((root.text(script), root.path(&new).exists()), (edited, true));
    said(&root.run(&["--prefix", "/opt/etherlab", "--uninstall", "--purge"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
}

// covers: daemon
#[test]
fn each_directory_can_be_chosen() {
    let root = Root::new();
    let places = [
        ("--bindir", "ringcat"),
        ("--sbindir", "ringcatd"),
        ("--mandir", "man8/ethercat.8"),
        ("--datadir", "doc/ringcat/CHANGELOG.md"),
        ("--sysconfdir", "ethercat.conf"),
        ("--unitdir", "ethercat.service"),
        ("--sysusersdir", "ethercat.conf"),
        ("--tmpfilesdir", "ethercat.conf"),
        ("--udevdir", "99-ethercat.rules"),
    ];
    let paths: Vec<String> = places.iter().map(|(option, _)| format!("/a{}", option.replace("--", "/"))).collect();
    let options: Vec<&str> = places.iter().zip(&paths).flat_map(|((option, _), path)| [*option, path]).collect();
    root.install(&options);
    for ((_, file), path) in places.iter().zip(&paths) {
        assert!(root.path(path).join(file).exists(), "{path}/{file}: {:?}", root.files());
    }
    assert!(root.files().iter().all(|file| file.starts_with("/a/")), "{:?}", root.files());
    assert!(
        root.text("/a/unitdir/ethercat.service").contains("=/a/sbindir/ringcatd --conf /a/sysconfdir/ethercat.conf")
    );
    said(&root.run(&["--datadir", "/a/datadir", "--uninstall"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
}

// covers: daemon
#[test]
fn an_edited_configuration_survives_an_update_and_a_removal_but_not_a_purge() {
    let root = Root::new();
    root.install(&["--prefix", "/usr"]);
    let (conf, new) = ("/etc/ethercat.conf", "/etc/ethercat.conf.new");
    let edited = root.text(conf).replace("MASTER0_DEVICE=\"\"", "MASTER0_DEVICE=\"eth1\"");
    std::fs::write(root.path(conf), &edited).expect("it can be written");
    for _ in 0..2 {
        let about = root.install(&["--prefix", "/usr"]);
        assert!(about.contains("kept, because it was edited"), "{about}");
        assert_eq!((root.text(conf), root.path(new).exists()), (edited.clone(), true));
    }
    let about = said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert!(about.contains("edited files that were kept: 1"), "{about}");
    let left = ["/etc/ethercat.conf", "/usr/share/ringcat/installed"].map(String::from);
    assert_eq!((root.files(), root.text(conf)), (BTreeSet::from(left), edited.clone()));
    // As an application that comes back after its removal.
    root.install(&["--prefix", "/usr"]);
    assert_eq!(root.text(conf), edited);
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    said(&root.run(&["--prefix", "/usr", "--uninstall", "--purge"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
}

// covers: daemon
#[test]
fn files_of_other_programs_stay_and_those_of_an_older_version_are_removed() {
    let root = Root::new();
    ["/usr/bin/other", "/usr/lib/udev/rules.d/other"].iter().for_each(|other| root.write(other, ""));
    root.install(&["--prefix", "/usr"]);
    // The older version had a page more.
    std::fs::remove_file(root.directory.join("programs/shell/man8/ethercat-slaves.8")).expect("it is there");
    root.install(&["--prefix", "/usr"]);
    assert!(!root.path("/usr/share/man/man8/ethercat-slaves.8").exists());
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert_eq!(root.files(), BTreeSet::from(["/usr/bin/other", "/usr/lib/udev/rules.d/other"].map(String::from)));
}

// covers: daemon
#[test]
fn configuration_of_other_programs_is_neither_overwritten_nor_removed() {
    let root = Root::new();
    let (conf, limits) = ("/etc/ethercat.conf", "/etc/security/limits.d/ethercat.conf");
    [conf, limits].iter().for_each(|path| root.write(path, "of another master\n"));
    for _ in 0..2 {
        let about = root.install(&["--prefix", "/usr"]);
        assert_eq!(about.matches("kept, because it was edited").count(), 2, "{about}");
        assert!([conf, limits].iter().all(|path| root.text(path) == "of another master\n"));
        assert!(root.text("/etc/ethercat.conf.new").contains("MASTER0_DEVICE"));
    }
    said(&root.run(&["--prefix", "/usr", "--uninstall", "--purge"]), true);
    assert_eq!(root.files(), BTreeSet::from([conf, limits].map(String::from)));

    // A link to a file that is kept elsewhere stays a link.
    root.install(&["--prefix", "/opt/other"]);
    root.write("/srv/ethercat.conf", "of a repository\n");
    std::fs::remove_file(root.path(conf)).expect("it is there");
    std::os::unix::fs::symlink(root.path("/srv/ethercat.conf"), root.path(conf)).expect("it can be made");
    root.install(&["--prefix", "/opt/other"]);
    assert_eq!(std::fs::read_link(root.path(conf)).expect("a link"), root.path("/srv/ethercat.conf"));
    assert_eq!(root.text(conf), "of a repository\n");
}

// covers: daemon
#[test]
fn replaced_files_stay_and_so_do_parts_that_are_not_installed_again() {
    let root = Root::new();
    root.install(&["--prefix", "/usr"]);
    root.write("/usr/bin/ethercat", "the tool of another master\n");
    root.install(&["--prefix", "/usr", "--init", "none"]);
    let before = "/usr/lib/systemd/system/ethercat.service";
    assert!(root.path(before).exists(), "the service was not renewed");
    root.write("/usr/bin/ethercat", "the tool of another master\n");
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert_eq!(root.files(), BTreeSet::from(["/usr/bin/ethercat".to_owned()]));
}

// covers: daemon
#[test]
fn files_of_a_package_are_neither_replaced_nor_removed() {
    if Command::new("dpkg-query").arg("--version").output().is_err() {
        println!("skipped: there is no dpkg-query");
        return;
    }
    let root = Root::new();
    root.install(&["--prefix", "/usr/local"]);
    let (conf, tool) = ("/etc/ethercat.conf", "/usr/bin/ethercat");
    let before = root.text(conf);
    let status = "Package: other\nStatus: install ok installed\nMaintainer: a <a@b>\nArchitecture: all\nVersion: 1\n";
    root.write("/var/lib/dpkg/status", &format!("{status}Description: a tool\n"));
    root.write("/var/lib/dpkg/info/format", "1\n");
    root.write("/var/lib/dpkg/info/other.list", &format!("/.\n{conf}\n{tool}\n"));
    root.write(tool, "the tool of a package\n");
    let all = root.files();
    let programs = root.directory.join("programs");
    let programs = ["--programs", programs.to_str().expect("text"), "--without-library", "--prefix", "/usr"];
    let about = said(&root.run(&programs), false);
    assert!(about.contains("/usr/bin/ethercat belongs to a package") && root.files() == all, "{about}");
    let about = root.install(&["--prefix", "/usr/local"]);
    assert!(about.contains("kept, because it belongs to a package"), "{about}");
    said(&root.run(&["--prefix", "/usr/local", "--uninstall", "--purge"]), true);
    let left: BTreeSet<String> = root.files().into_iter().filter(|file| !file.starts_with("/var/lib/dpkg")).collect();
    assert_eq!((left, root.text(conf)), (BTreeSet::from([conf, tool].map(String::from)), before));
    assert_eq!(root.text(tool), "the tool of a package\n");
}

// covers: daemon
#[test]
fn a_removal_disables_its_own_units_and_leaves_those_of_a_package_enabled() {
    let root = Root::new();
    let wants = "/etc/systemd/system/multi-user.target.wants";
    let links = |prefix: &str| {
        root.write(&format!("{wants}/other.service"), "of another");
        for (name, unit) in [("ethercat", "ethercat"), ("ringcat-standby@left", "ringcat-standby@")] {
            let link = root.path(&format!("{wants}/{name}.service"));
            let _ = std::fs::remove_file(&link);
            let unit = format!("{prefix}/lib/systemd/system/{unit}.service");
            std::os::unix::fs::symlink(unit, link).expect("it can be made");
        }
    };
    let enabled = || {
        let all = std::fs::read_dir(root.path(wants)).expect("it is there");
        all.flatten().map(|it| it.file_name().into_string().expect("text")).collect::<BTreeSet<String>>()
    };
    let all = BTreeSet::from(["ethercat.service", "other.service", "ringcat-standby@left.service"].map(String::from));
    let other = BTreeSet::from(["other.service".to_owned()]);
    for (of, left) in [("/usr", &all), ("/usr/local", &other)] {
        root.install(&["--prefix", "/usr/local"]);
        links(of);
        said(&root.run(&["--prefix", "/usr/local", "--uninstall"]), true);
        assert_eq!(enabled(), *left, "units of {of}");
    }
    // systemd names /lib, which is a link to /usr/lib.
    root.install(&["--prefix", "/usr"]);
    std::os::unix::fs::symlink("usr/lib", root.path("/lib")).expect("it can be made");
    links("");
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert_eq!(enabled(), other, "units by /lib");
    // Edited units, with the programs of this installation and with those of a package.
    for (prefix, left) in [("/usr/local", &other), ("/usr", &all)] {
        root.install(&["--prefix", "/usr/local"]);
        links("/etc");
        for (unit, program) in [("ethercat", "sbin/ringcatd --conf"), ("ringcat-standby@", "bin/ringcat run")] {
            let path = format!("/etc/lib/systemd/system/{unit}.service");
            root.write(&path, &format!("ExecStart={prefix}/{program} a\n"));
        }
        said(&root.run(&["--prefix", "/usr/local", "--uninstall"]), true);
        assert_eq!(enabled(), *left, "edited units of {prefix}");
    }
}

// covers: daemon
#[test]
fn a_relative_root_is_below_the_present_directory() {
    let root = Root::new();
    let mut install = Command::new(script());
    install.current_dir(&root.directory).env("DESTDIR", "root/").args(["--prefix", "/usr", "--without-library"]);
    said(&install.args(["--programs", "programs"]).output().expect("sh is there"), true);
    assert!(root.path("/usr/bin/ringcat").exists());
    let output = root.run(&["--programs", root.directory.join("programs").to_str().expect("text")]);
    let about = said(&output, false);
    assert!(about.contains("libringcat_ffi.a: add it, or choose --without-library"), "{about}");
    said(&root.run(&["--prefix", "/usr", "--uninstall"]), true);
    assert!(root.is_empty(), "{:?}", root.files());
}

// covers: daemon
#[test]
fn a_program_that_runs_keeps_its_file_when_a_new_version_comes() {
    let root = Root::new();
    root.install(&["--prefix", "/usr"]);
    let program = root.path("/usr/sbin/ringcatd");
    let inode = || std::fs::metadata(&program).expect("it is there").ino();
    let before = inode();
    let mut running = Command::new(&program).arg("60").spawn().expect("it is a program");
    root.install(&["--prefix", "/usr"]);
    let runs = matches!(running.try_wait(), Ok(None));
    running.kill().expect("it is ours");
    running.wait().expect("it was ended");
    assert!(runs && inode() != before);
}

// covers: daemon
#[test]
fn wrong_options_of_an_installation_are_named_and_nothing_is_written() {
    let root = Root::new();
    for (arguments, expected) in [
        (&["--prefix", "opt"][..], "not an absolute path: opt"),
        (&["--bindir", "/a b"], "a path with a space: /a b"),
        (&["--init", "upstart"], "--init is systemd, sysv or none"),
        (&["--prefix"], "--prefix needs a value"),
        (&["--force"], "unknown option: --force"),
    ] {
        let output = root.run(arguments);
        let about = said(&output, false);
        assert!(about.contains(expected) && output.status.code() == Some(2), "{about}");
    }
    assert!(root.files().is_empty());
    assert!(said(&root.run(&["--help"]), true).contains("packaging/install --uninstall"));
}
