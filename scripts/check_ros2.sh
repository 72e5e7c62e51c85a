#!/usr/bin/env bash
# Format, lints and tests of ros2/, which is outside the workspace; warnings are errors. Skipped where
# its compiler or its crates cannot be had. Its tests need the command, which `cargo build` builds,
# and packages of PyPI; each says what it lacks.
set -euo pipefail
cd "$(dirname "$0")/../ros2"

cargo fmt --check
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
cargo clippy --locked --all-targets -- -D warnings
cargo clippy --locked --all-targets --features zenoh -- -D warnings
cargo test --locked --features zenoh
