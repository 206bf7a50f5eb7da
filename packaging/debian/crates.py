"""The crates of Cargo.lock that programs and libraries are built from, for `copyright`, `sbom` and packaging/source."""
import json
import os
import re
import subprocess

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
# What is built together, by packaging/install and by crates/ffi/install: features of crates depend on it.
BUILDS = [("ringcat-cli", "ringcatd", "ringcat-ethercat"), ("ringcat-ffi",)]
SHIPPED = {name for names in BUILDS for name in names}


def run(*command, **options):
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True, **options).stdout


def version_of_rust():
    """As `rustc --version --verbose` has it: the keys `host`, `release` and others."""
    return dict(line.split(": ", 1) for line in run("rustc", "--version", "--verbose").splitlines() if ": " in line)


def metadata(platform=None):
    """What cargo reports of the workspace for this platform, or for that of the compiler."""
    platform = platform or version_of_rust()["host"]
    command = ["cargo", "metadata", "--quiet", "--locked", "--filter-platform", platform, "--format-version", "1"]
    try:
        return json.loads(run(*command, "--offline", stderr=subprocess.DEVNULL))
    except subprocess.CalledProcessError:
        # It reads crates of tests too, which a build of the programs does not download.
        return json.loads(run(*command))


def tree(*names):
    """Name and version of the crates that these are built from, with the features that they choose."""
    options = [word for name in names for word in ("--package", name)]
    lines = run("cargo", "tree", "--quiet", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}",
                *options).splitlines()
    return {(line.split(" ")[0], line.split(" ")[1].lstrip("v")) for line in lines if line}


def needed(workspace):
    """For each crate that is linked, its id and those of the crates that it links itself, without crates of tests, of
    build scripts, and of features that are off."""
    built = set().union(*(tree(*names) for names in BUILDS))
    packages = {one["id"]: one for one in workspace["packages"] if (one["name"], one["version"]) in built}
    nodes = {one["id"]: one for one in workspace["resolve"]["nodes"]}
    left = [one for one, it in packages.items() if it["name"] in SHIPPED and it["source"] is None]
    found = {}
    while left:
        one = left.pop()
        if one not in found:
            of = [it["pkg"] for it in nodes[one]["deps"] if any(kind["kind"] is None for kind in it["dep_kinds"])]
            of = [it for it in of if it in packages]
            found[one] = sorted(set(of))
            left += of
    return found


def linked(workspace):
    """Crates of others that the programs and libraries are built from."""
    packages = {one["id"]: one for one in workspace["packages"]}
    found = [packages[one] for one in needed(workspace) if packages[one]["source"] is not None]
    return sorted(found, key=lambda it: (it["name"], it["version"]))


def checksums():
    """SHA-256 of each crate's archive after Cargo.lock, by name and version."""
    with open(os.path.join(ROOT, "Cargo.lock"), encoding="utf-8") as file:
        blocks = file.read().split("[[package]]\n")[1:]
    found = {}
    for block in blocks:
        keys = dict(re.findall(r'^(\w+) = "(.*)"$', block, re.M))
        found[keys["name"], keys["version"]] = keys.get("checksum")
    return found
