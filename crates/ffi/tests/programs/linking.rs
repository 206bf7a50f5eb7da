//! What `crates/ffi/install` installs, and the ways in which programs link it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::library::{here, installation, installed, installed_below, on_segment, run, workshop};

/// A C compiler for the smallest program, in a directory of its own.
fn cc(prefix: &Path) -> Command {
    let mut cc = Command::new("cc");
    cc.arg(here().join("tests/c/manual.c")).arg("-I").arg(prefix.join("include"));
    cc
}

fn counts_five(program: &Path) {
    let (output, ended) = on_segment(program, &here().join("tests/c/services.toml"), &[]);
    assert_eq!((output.as_str(), ended), ("5\n", Ok(())));
}

fn has(tool: &str) -> bool {
    let found = Command::new(tool).arg("--version").output().is_ok();
    if !found {
        println!("skipped: there is no {tool}");
    }
    found
}

fn target(name: &str) -> PathBuf {
    workshop().join(format!("linked-{name}"))
}

// covers: c-interface
#[test]
fn both_command_lines_of_the_manual_link_without_a_further_library() {
    let Some(prefix) = installed() else { return };
    let lib = prefix.join("lib");
    for name in ["ethercat", "ethercat_rtdm"] {
        let program = target(name);
        let mut dynamic = cc(prefix);
        dynamic.arg("-o").arg(&program).arg("-L").arg(&lib).arg(format!("-l{name}"));
        run(dynamic.arg("-Wl,--rpath").arg(format!("-Wl,{}", lib.display())));
        counts_five(&program);
    }
    for kind in ["-static", "-pie", "-static-pie"] {
        let program = target(&kind[1..]);
        run(cc(prefix).arg(kind).arg("-o").arg(&program).arg(lib.join("libethercat.a")));
        counts_five(&program);
    }
}

// covers: c-interface
#[test]
fn functions_of_the_archive_have_tables_of_unwinding() {
    let Some(prefix) = installed() else { return };
    for kind in ["-static", "-pie"] {
        let program = target("unwinding");
        let mut cc = Command::new("cc");
        cc.arg(here().join("tests/c/unwinding.c")).arg("-I").arg(prefix.join("include")).arg(kind);
        run(cc.arg("-o").arg(&program).arg(prefix.join("lib/libethercat.a")));
        assert_eq!(run(&mut Command::new(&program)), "3\n", "{kind}");
    }
}

// covers: c-interface
#[test]
fn the_archive_shows_the_functions_of_both_headers_only() {
    let Some(prefix) = installed() else { return };
    let archive = prefix.join("lib/libethercat.a");
    let symbols = run(Command::new("nm").args(["--extern-only", "--defined-only"]).arg(archive));
    let names: BTreeSet<&str> = symbols.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    let (added, ecrt): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| name.starts_with("ringcat_"));
    assert_eq!((added.len(), ecrt.len()), (9, 103), "{names:?}");
    assert!(ecrt.iter().all(|name| name.starts_with("ecrt_")), "{names:?}");
}

// covers: c-interface
#[test]
fn the_archive_works_inside_another_shared_object_and_beside_another_rust_library() {
    let Some(prefix) = installed() else { return };
    let archive = prefix.join("lib/libethercat.a");
    let (object, program) = (workshop().join("libinside.so"), target("inside"));
    let mut shared = cc(prefix);
    shared.args(["-shared", "-fPIC", "-Dmain=inside", "-o"]).arg(&object).arg(&archive);
    run(&mut shared);
    let main = workshop().join("calls_inside.c");
    std::fs::write(&main, "int inside(void); int main(void) { return inside(); }\n").expect("a file");
    run(Command::new("cc").arg(&main).arg("-o").arg(&program).arg(&object));
    counts_five(&program);

    // An archive of Rust that shows all its symbols.
    let other = workshop().join("other.rs");
    let text = "#[unsafe(no_mangle)] pub extern \"C\" fn other() -> i32 { vec![1; 3].iter().sum::<i32>() - 3 }\n";
    std::fs::write(&other, text).expect("a file");
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    if !has(&compiler) {
        return;
    }
    let archive_of_other = workshop().join("libother.a");
    let mut rustc = Command::new(compiler);
    run(rustc.args(["--edition=2024", "--crate-type=staticlib", "-o"]).arg(&archive_of_other).arg(other));
    let both = workshop().join("both.c");
    let text = "#include \"manual.h\"\nint other(void); int main(void) { return other() ? 9 : smallest(); }\n";
    std::fs::write(&both, text).expect("a file");
    let source = std::fs::read_to_string(here().join("tests/c/manual.c")).expect("the source");
    std::fs::write(workshop().join("manual.h"), source.replace("int main(void)", "static int smallest(void)"))
        .expect("a file");
    let orders = [[&archive, &archive_of_other], [&archive_of_other, &archive]];
    for (order, program) in orders.into_iter().zip([target("both"), target("both2")]) {
        let mut link = Command::new("cc");
        link.arg(&both).arg("-I").arg(prefix.join("include")).arg("-o").arg(&program).args(order);
        run(&mut link);
        counts_five(&program);
    }
}

/// All files below a directory.
fn files_below(place: &Path) -> BTreeSet<String> {
    let (mut files, mut directories) = (BTreeSet::new(), vec![place.to_owned()]);
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(&directory).into_iter().flatten().flatten() {
            let (path, kind) = (entry.path(), entry.file_type().expect("it is there"));
            if kind.is_dir() {
                directories.push(path);
            } else {
                files.insert(path.strip_prefix(place).expect("below it").to_str().expect("it is text").to_owned());
            }
        }
    }
    files
}

// covers: c-interface
#[test]
fn an_uninstall_removes_what_was_installed_and_keeps_what_was_changed() {
    let place = target("removed");
    let _ = std::fs::remove_dir_all(&place);
    let (other, old) = (place.join("opt/etherlab/lib/libother.so"), "opt/etherlab/lib/libethercat.old");
    std::fs::create_dir_all(other.parent().expect("a directory")).expect("it can be made");
    std::fs::write(&other, "of another program").expect("it can be written");
    if installed_below(&place, "/opt/etherlab").is_none() {
        return;
    }
    let list = place.join("opt/etherlab/share/ringcat/installed-library");
    let text = std::fs::read_to_string(&list).expect("it is there");
    let listed = text.lines().filter(|line| !line.starts_with("d ")).count();
    assert_eq!(listed + 2, files_below(&place).len(), "all but the list and another's file:\n{text}");
    // A file of an older version, whose sum `cksum` prints for nothing.
    std::fs::write(place.join(old), "").expect("it can be written");
    std::fs::write(&list, format!("{text}f library /{old} 4294967295 0\n")).expect("it can be written");
    assert!(installed_below(&place, "/opt/etherlab").is_some() && !place.join(old).exists());
    assert_eq!(std::fs::read_to_string(&list).expect("it is there"), text);
    let changed = place.join("opt/etherlab/include/ecrt.h");
    std::fs::write(&changed, "/* changed */").expect("it can be written");
    let removal = || {
        let mut removal = Command::new(here().join("install"));
        removal.args(["--uninstall", "--prefix", "/opt/etherlab", "--destdir"]).arg(&place);
        removal
    };
    let said = run(&mut removal());
    assert!(said.contains("kept, because it was changed: ") && said.contains("include/ecrt.h\n"), "{said}");
    let left = ["opt/etherlab/include/ecrt.h", "opt/etherlab/lib/libother.so"].map(String::from);
    assert_eq!(files_below(&place), BTreeSet::from(left));
    assert!(!place.join("opt/etherlab/lib/cmake").exists() && !place.join("opt/etherlab/share").exists());
    let again = removal().output().expect("sh is there");
    assert!(!again.status.success() && String::from_utf8_lossy(&again.stderr).contains("nothing is installed here"));
}

/// The parts of the manual's layout (7.2.1) that a library has: bin, sbin and etc belong to the tool and its service.
// covers: c-interface
#[test]
fn the_prefix_of_the_manual_has_its_layout_and_no_file_names_the_build() {
    let place = target("layout");
    let _ = std::fs::remove_dir_all(&place);
    if installed_below(&place, "/opt/etherlab").is_none() {
        return;
    }
    let mut found = Vec::new();
    let mut directories = vec![place.clone()];
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(&directory).expect("it is there").flatten() {
            let (path, kind) = (entry.path(), entry.file_type().expect("it is there"));
            if kind.is_dir() {
                directories.push(path);
                continue;
            }
            if kind.is_symlink() {
                assert!(path.exists() && std::fs::read_link(&path).expect("a link").is_relative(), "{path:?}");
            } else if !path.to_string_lossy().contains(".so.") && path.extension().is_none_or(|it| it != "a") {
                let text = std::fs::read_to_string(&path).expect("it is text");
                let build = place.to_str().expect("it is text");
                assert!(!text.contains(build), "{path:?} names {build}");
            }
            found.push(path.strip_prefix(&place).expect("below it").to_str().expect("it is text").to_owned());
        }
    }
    found.sort_unstable();
    let expected = [
        "include/ecrt.h",
        "include/ringcat.h",
        "lib/cmake/EtherCAT/EtherCATConfig.cmake",
        "lib/cmake/EtherCAT/EtherCATConfigVersion.cmake",
        "lib/cmake/ethercat/ethercat-config-version.cmake",
        "lib/cmake/ethercat/ethercat-config.cmake",
        "lib/fakeethercat/libethercat.so.1",
        "lib/libethercat.a",
        "lib/libethercat.la",
        "lib/libethercat.so",
        "lib/libethercat.so.1",
        "lib/libethercat.so.1.2.0",
        "lib/libethercat_rtdm.a",
        "lib/libethercat_rtdm.la",
        "lib/libethercat_rtdm.so",
        "lib/libfakeethercat.so",
        "lib/libfakeethercat.so.1",
        "lib/libfakeethercat.so.1.2.0",
        "lib/pkgconfig/libethercat.pc",
        "share/ringcat/installed-library",
    ];
    assert_eq!(found, expected.map(|path| format!("opt/etherlab/{path}")));
    let pc = std::fs::read_to_string(place.join("opt/etherlab/lib/pkgconfig/libethercat.pc")).expect("it is there");
    assert!(pc.starts_with("prefix=/opt/etherlab\n"), "{pc}");
}

/// Tools as for a cross compilation: each one records its name, and works for this processor.
// covers: c-interface
#[test]
fn an_installation_uses_the_tools_that_are_named() {
    use std::os::unix::fs::PermissionsExt;

    if installed().is_none() {
        return;
    }
    let place = target("tools");
    std::fs::create_dir_all(&place).expect("a directory");
    let used = place.join("used");
    let _ = std::fs::remove_file(&used);
    let mut install = installation();
    let tools = [("CC", "cc"), ("OBJCOPY", "objcopy"), ("STRIP", "strip"), ("NM", "nm"), ("AR", "ar")];
    for (variable, tool) in tools {
        let path = place.join(format!("other-{tool}"));
        let text = format!("#!/bin/sh\necho {tool} >> '{}'\nexec {tool} \"$@\"\n", used.display());
        std::fs::write(&path, text).expect("a file");
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).expect("permissions");
        install.env(variable, path);
    }
    run(install.arg("--prefix").arg(place.join("prefix")));
    let used = std::fs::read_to_string(used).expect("a tool was used");
    assert_eq!(used.lines().collect::<BTreeSet<_>>(), tools.map(|(_, tool)| tool).into());
}

// covers: c-interface
#[test]
fn pkg_config_libtool_and_cmake_find_version_1_6_2() {
    let Some(prefix) = installed() else { return };
    let lib = prefix.join("lib");
    for name in ["libethercat.la", "libethercat_rtdm.la"] {
        let text = std::fs::read_to_string(lib.join(name)).expect("the file");
        assert!(text.contains("old_library='libethercat.a'") && text.contains("dlname='libethercat.so.1'"), "{text}");
        assert!(text.contains(&format!("libdir='{}'", lib.display())), "{text}");
    }
    if has("pkg-config") {
        let ask = |question: &[&str]| {
            let mut pkg_config = Command::new("pkg-config");
            run(pkg_config.env("PKG_CONFIG_PATH", lib.join("pkgconfig")).args(question).arg("libethercat"))
        };
        assert_eq!(ask(&["--modversion"]).trim(), "1.6.2");
        let program = target("pkg-config");
        let mut link = Command::new("cc");
        link.arg(here().join("tests/c/manual.c")).arg("-o").arg(&program);
        link.args(ask(&["--cflags", "--libs"]).split_whitespace()).arg(format!("-Wl,-rpath,{}", lib.display()));
        run(&mut link);
        counts_five(&program);
    }
    if !has("cmake") {
        return;
    }
    for (number, find) in ["EtherCAT REQUIRED", "ethercat 1.6 CONFIG REQUIRED"].into_iter().enumerate() {
        let place = target(&format!("cmake{number}"));
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).expect("a directory");
        let text = format!(
            "cmake_minimum_required(VERSION 3.10)\nproject(smallest C)\nfind_package({find})\n\
             add_executable(smallest {})\ntarget_link_libraries(smallest EtherLab::ethercat)\n",
            here().join("tests/c/manual.c").display()
        );
        std::fs::write(place.join("CMakeLists.txt"), text).expect("a file");
        let mut configure = Command::new("cmake");
        configure.arg("-S").arg(&place).arg("-B").arg(place.join("build"));
        run(configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
        run(Command::new("cmake").arg("--build").arg(place.join("build")));
        counts_five(&place.join("build/smallest"));
    }
}
