#!/usr/bin/env bash
# Format, lints and tests of ros2/, which is outside the workspace; warnings are errors. Skipped where
# its compiler or its crates cannot be had. Its tests need the command, which `cargo build` builds,
# and packages of PyPI; each says what it lacks.
# --tests: no format, no lints and no Zenoh, whose crates take longer to build than all others. The tests of
# the network are left out where the packages cannot be had, or where they cannot speak to each other.
set -euo pipefail
cd "$(dirname "$0")/../ros2"

lints=true
[ "${1:-}" = --tests ] && lints=false
$lints && cargo fmt --check
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(rustc --version | sed 's/^rustc \([0-9.]*\).*/\1/')
if [ "$(printf '%s\n' "$needed" "$found" | sort -V | head -n 1)" != "$needed" ]; then
    echo "skipped: ros2/: rustc $found, it needs $needed"
    exit 0
fi
if ! words=$(cargo fetch --locked 2>&1); then
    case $words in
    *--locked*) echo "$words" >&2 && exit 1 ;; # Its lock file does not fit the workspace any more.
    *) echo "skipped: ros2/: its crates cannot be fetched: ${words##*$'\n'}" && exit 0 ;;
    esac
fi
if $lints; then
    cargo clippy --locked --all-targets -- -D warnings
    cargo clippy --locked --all-targets --features zenoh -- -D warnings
    cargo test --locked --features zenoh
    exit 0
fi
cargo test --locked --bins
# The test that needs Python alone installs the packages, where they can be had.
TESSERA_REQUIRE='' cargo test --locked --test network types_have_the_hashes -- --nocapture
if [ ! -f target/python-ros2/packages.txt ]; then
    echo "skipped: ros2/: tests of the network: no packages of PyPI"
elif ! target/python-ros2/bin/python tests/python/probe.py; then
    echo "skipped: ros2/: tests of the network: two programs of cyclonedds do not hear each other here"
else
    cargo test --locked --test network
fi
