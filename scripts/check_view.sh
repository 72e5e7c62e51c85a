#!/usr/bin/env bash
# Format and lints of the viewer, which is outside the workspace; warnings are errors. Skipped where
# its compiler or its crates cannot be had.
set -euo pipefail
cd "$(dirname "$0")/../view"

cargo fmt --check
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(rustc --version | sed 's/^rustc \([0-9.]*\).*/\1/')
if [ "$(printf '%s\n' "$needed" "$found" | sort -V | head -n 1)" != "$needed" ]; then
    echo "skipped: lints of view/: rustc $found, it needs $needed"
    exit 0
fi
if ! words=$(cargo fetch --locked 2>&1); then
    case $words in
    *--locked*) echo "$words" >&2 && exit 1 ;; # Its lock file does not fit the workspace any more.
    *) echo "skipped: lints of view/: its crates cannot be fetched: ${words##*$'\n'}" && exit 0 ;;
    esac
fi
# The profile of its build, whose dependencies are then there already.
cargo clippy --release --locked --all-targets -- -D warnings
