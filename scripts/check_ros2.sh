#!/usr/bin/env bash
# Tests of ros2/, which is outside the workspace. Skipped where its compiler or its crates cannot be had. They need
# the command, which `cargo build` builds, and packages of PyPI; each says what it lacks. Those of the network are
# left out where the packages cannot be had, or where they cannot speak to each other.
# --zenoh: all of them, and those over Zenoh, whose crates take longer to build than all others.
# Lints: scripts/check_apart.sh ros2 zenoh.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/crates.sh

can_be_built ros2/Cargo.toml || exit 0
cd ros2
if [ "${1:-}" = --zenoh ]; then
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
