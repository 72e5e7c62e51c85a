#!/usr/bin/env bash
# What every change must pass before its tests: format, lints and documentation, warnings as errors. The format is
# that of all six workspaces; lints and tests of those that are built apart have scripts of their own.
set -euo pipefail
cd "$(dirname "$0")/.."

for workspace in . fleet ros2 view python fuzz; do
    cargo fmt --manifest-path "$workspace/Cargo.toml" --all --check
done
cargo clippy --workspace --all-targets -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet
