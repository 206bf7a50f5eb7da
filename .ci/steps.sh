# The steps of `.ci/run`, which sources this file: a function each, called at the root of the repository with `set -e`.
# `$logs` is a directory for files of this run.

# What tests and benches use beyond the compiler: valgrind counts instructions, iproute2 makes the network namespaces
# that tests on real interfaces run in, tshark reads captures, strace counts system calls, pkg-config finds the library
# that was installed, ethercatctl needs procps. Packages are installed on the machine of CI only; apt-get takes about
# half a minute.
root_layer() {
    local missing=() tool
    declare -A package=([valgrind]=valgrind [ip]=iproute2 [tshark]=tshark [strace]=strace [pkg-config]=pkg-config
        [ps]=procps)
    for tool in "${!package[@]}"; do
        command -v "$tool" >/dev/null || missing+=("${package[$tool]}")
    done
    if [[ ${#missing[@]} == 0 ]]; then
        echo "all here: $(valgrind --version), $(ip -V), $(tshark --version 2>/dev/null | head -n 1)"
    elif [[ ${CI:-} == true && $(id -u) == 0 ]]; then
        apt-get update -q
        DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
    elif [[ ${CI:-} == true ]]; then
        echo "not installed, and only root can install them: ${missing[*]}; the checks that need them would be skipped"
        return 1
    else
        echo "skipped: not installed: ${missing[*]}; without valgrind instruction counts are missing, without iproute2"
        echo "the tests on real interfaces, without tshark its view of captures (apt-get install brings them; this"
        echo "script does so only as root with CI=true)"
    fi
    readers_of_packages
}

# Installs the tools with which files of packages are checked, where apt-get has them. A check that is skipped because
# of a missing tool prints that.
readers_of_packages() {
    local tool missing=()
    declare -A package=([cmake]=cmake [lintian]=lintian [mandoc]=mandoc [groff]=groff-base [shellcheck]=shellcheck
        [zsh]=zsh [fish]=fish [dpkg-source]=dpkg-dev)
    for tool in "${!package[@]}"; do
        ! command -v "$tool" >/dev/null || continue
        missing+=("${package[$tool]}")
    done
    [[ ${#missing[@]} != 0 ]] || return 0
    if [[ ${CI:-} == true && $(id -u) == 0 ]]; then
        apt-get update -q || true
        # One by one: apt-get installs nothing if it does not know one of several.
        for tool in "${missing[@]}"; do
            DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "$tool" ||
                echo "apt-get cannot install $tool: checks that need it are skipped"
        done
    else
        echo "not installed: ${missing[*]}: checks of files of the packages that need them are skipped"
    fi
}

# What `root_layer` said, which ran beside the steps before.
root_layer_came() {
    cat "$logs/root-layer"
    return "$layer_status"
}

# Tests on veth pairs in network namespaces, in real time, and the MainDevices of others (pysoem, ethercrab) on our
# simulator. A machine that stalls for longer than a watchdog takes a test with it, so tests that fail are run again.
on_the_wire() {
    local begin=$SECONDS
    export RINGCAT_ON_THE_WIRE=1 RINGCAT_FOREIGN=1
    # The step before has built all programs.
    export RINGCAT_PROGRAMS_ARE_BUILT=1
    local with_bars
    mapfile -t with_bars < <(tests_with_bars crates/ringcatd/tests/ownership)
    [[ ${#with_bars[@]} != 0 ]] || { echo "no test of the daemon has a bar"; return 1; }
    tried wire
    # The step before has run all of these, without the bars, which hold only on a machine without other load.
    tried ownership "${with_bars[@]}"
    tried on_the_wire
    tried tool a_list_of_100_slaves a_segment_that_cannot_be_scanned siis_of_100_slaves
    echo "the tests on real interfaces took $((SECONDS - begin)) s, of 360 that they may take"
}

# tests_with_bars DIRECTORY: tests that call `check_bar`, themselves or by a function of their file.
tests_with_bars() {
    python3 - "$1" <<'END'
import glob, re, sys
for path in sorted(glob.glob(f"{sys.argv[1]}/*.rs")):
    parts = re.split(r"(?m)^(?=#\[test\]\n|(?:pub )?fn )", open(path, encoding="utf-8").read())
    # An attribute is a part of its own: it belongs to the function behind it.
    found = [(re.match(r"(?:pub )?fn (\w+)", part), before.startswith("#[test]"), part)
             for before, part in zip([""] + parts, parts)]
    found = [(name.group(1), is_test, part) for name, is_test, part in found if name]
    helpers = {name for name, is_test, part in found if not is_test and "check_bar(" in part and name != "check_bar"}
    for name, is_test, part in found:
        if is_test and any(f"{called}(" in part for called in helpers | {"check_bar"}):
            print(name)
END
}

# tried NAME [FILTER]: the test programs of this name, one test at a time. They are those that `cargo test --workspace`
# has built: with another selection, `cargo test` builds crates of procedural macros again, and all that uses them.
tried() {
    local programs program directory
    mapfile -t programs < <(test_programs "$1")
    [[ ${#programs[@]} != 0 ]] || { echo "no test program has the name $1"; return 1; }
    for program in "${programs[@]}"; do
        IFS=$'\t' read -r program directory <<<"$program"
        tries "$program" "$directory" "${@:2}" || return 1
    done
}

# test_programs NAME: the test programs of this name, each with the directory in which it runs.
test_programs() {
    cargo test --workspace --no-run --quiet --message-format json | python3 -c '
import json, os, sys
for line in sys.stdin:
    it = json.loads(line)
    if it.get("executable") and it["target"]["kind"] == ["test"] and it["target"]["name"] == sys.argv[1]:
        print(it["executable"], os.path.dirname(it["manifest_path"]), sep="\t")
' "$1"
}

# tries PROGRAM DIRECTORY [FILTER]: tests that fail have three tries, because this machine may stall. The output of each
# try is shown at its end, with "FAILED" in the third one only. The output goes to a file: a program that a failing test
# has started would keep a pipe open, and the step would wait for it. A try has 900 s.
tries() {
    local program=$1 directory=$2 try status names=("${@:3}") mark='s/FAILED$/failed in this try, and is tried again/
        s/^failures:$/failed in this try:/; s/^test result: FAILED\./test result: tried again./'
    echo "running ${program##*/} in $directory"
    for try in 1 2 3; do
        [[ $try != 3 ]] || mark=
        status=0
        (cd "$directory" && timeout --kill-after 10 900 "$program" --nocapture --test-threads 1 "${names[@]}") \
            >"$logs/try" 2>&1 || status=$?
        sed "$mark" "$logs/try"
        [[ $status != 0 ]] || return 0
        [[ $status != 124 && $status != 137 ]] || echo "stopped after 900 s"
        # The runner names at its end what failed.
        mapfile -t names < <(sed -n '/^failures:$/,/^test result/s/^    \([a-z0-9_:]*\)$/\1/p' "$logs/try" | sort -u)
        echo "try $try of 3 failed: ${names[*]:-nothing was run}"
        printf "${program##*/} %s\n" "${names[@]}" >>"$logs/failed-first"
        [[ ${#names[@]} != 0 ]] || return 1
        names=(--exact "${names[@]}")
    done
    echo "FAILED in three tries: ${names[*]:1}"
    return 1
}

# failed_first: prints the tests that failed in their first try, with the number of failures.
failed_first() {
    if [[ ! -s $logs/failed-first ]]; then
        echo "each test passed in its first try"
        return
    fi
    echo "tests that failed in their first try (failures, program, test):"
    sort "$logs/failed-first" | uniq -c
}

# Cuts and repairs of all cables of rings of 4, 10 and 33 in all phases of a cycle, and a million undisturbed cycles;
# `cargo test` runs a part of them.
lossless() {
    local programs program directory
    mapfile -t programs < <(test_programs virtual_time)
    IFS=$'\t' read -r program directory <<<"${programs[0]}"
    (cd "$directory" && LOSSLESS=1 "$program" lossless:: --nocapture)
}

# The README's test command. The runner's closing lines are shown as they come and once more, added up, at the end.
tests() {
    cargo test --workspace 2>&1 | tee "$logs/tests"
    echo
    echo "closing lines of all test programs:"
    grep '^test result:' "$logs/tests" | sort | uniq -c
    awk '/^test result:/ { passed += $4; failed += $6; ignored += $8 }
         END { printf "all together: %d passed, %d failed, %d ignored\n", passed, failed, ignored }' "$logs/tests"
}

# The minimum version that Cargo.toml and the README name is the one that everything here is built with.
toolchain() {
    local wanted built
    wanted=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
    built=$(rustc --version | cut -d ' ' -f 2)
    echo "rustc $built, rust-version $wanted"
    if [[ $built != "$wanted" && $built != "$wanted".* ]]; then
        echo "CI builds with rust-version: RUSTUP_TOOLCHAIN=$wanted .ci/run, or raise it in Cargo.toml and README.md"
        return 1
    fi
}

formatting() {
    cargo fmt --all --check
    cargo fmt --check --manifest-path ci/no-std-proof/Cargo.toml
}

lints() {
    cargo clippy --workspace --all-targets -- -D warnings
    cargo clippy --release --locked --manifest-path ci/no-std-proof/Cargo.toml -- -D warnings
}

# The library without features and with `standby` alone, the program without it: what `--workspace` builds has them all.
# With --full each feature alone, and the program.
features() {
    local feature features=("" standby)
    if [[ ${#full[@]} != 0 ]]; then
        features+=(packet sim eni network esi gateway eoe daemon serde tracing engine)
        echo "the program without standby"
        cargo clippy --package ringcat-cli --no-default-features --all-targets -- -D warnings
    fi
    for feature in "${features[@]}"; do
        echo "ringcat with \"$feature\""
        cargo clippy --package ringcat --no-default-features --features "$feature" -- -D warnings
    done
}

documentation() {
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
}

# Licences, duplicates and sources of crates after deny.toml. Known vulnerabilities need cargo-deny and its database,
# which comes from GitHub; registries of crates do not have it. Withdrawn (yanked) versions are found by ci/package.
dependencies() {
    local database=https://github.com/rustsec/advisory-db
    cargo test --quiet --workspace --test tree -- external_crates_match_deny_toml
    if ! command -v cargo-deny >/dev/null; then
        echo "skipped: advisories: cargo-deny is not installed (cargo install cargo-deny --locked, about three minutes)"
        return
    fi
    cargo deny --workspace check bans licenses sources
    if timeout 30 git ls-remote --quiet "$database" HEAD >/dev/null 2>&1; then
        cargo deny --workspace check advisories
    else
        echo "skipped: advisories: $database cannot be reached"
    fi
}

# The programs of the benches, the demonstration's among them, and the client of ethercrab.
release_programs() {
    # The same selection as in ci/bench: another one has other features, and everything is built twice.
    cargo build --release --package ringcat-cli --package scenarios --bins
    # They change no feature of the crates that are built already.
    cargo build --release --package ringcat-cli --package scenarios --package ringcatd --package ringcat-ethercat --bins
    ci/ethercrab-client/build
    # For the packages: the library of the C interface, alone, as crates/ffi/install builds it.
    cargo rustc --release --package ringcat-ffi --lib --crate-type staticlib
}

# What `release_programs` said.
release_came() {
    tail -n 5 "$logs/release"
    return "$release_status"
}

figures() {
    cargo run --quiet --package tidy
    cargo run --quiet --package tidy -- figures
}

# The README's first commands, and the sizes of the programs that a release has.
demo() {
    local too_large=0
    cargo run --release
    cargo run --release -- demo --standby
    small ringcat 11310000 || too_large=1
    small ringcatd 7220000 || too_large=1
    small ethercat 1870000 || too_large=1
    return "$too_large"
}

# small PROGRAM MOST: whether its release has at most so many bytes.
small() {
    local program=${CARGO_TARGET_DIR:-target}/release/$1 bytes
    bytes=$(stat --format %s "$program")
    strip --strip-all -o "$logs/stripped" "$program"
    echo "$program has $bytes bytes, at most $2 may be; without symbols $(stat --format %s "$logs/stripped")"
    ((bytes <= $2))
}
