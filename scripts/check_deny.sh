#!/usr/bin/env bash
# Licences, sources and banned crates of all six lock files by deny.toml, and advisories where their database
# can be had. Skipped where cargo-deny is not installed.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v cargo-deny > /dev/null; then
    echo "skipped: cargo-deny is not installed"
    exit 0
fi
for workspace in . fleet ros2 view python fuzz; do
    cargo-deny --locked --manifest-path "$workspace/Cargo.toml" --config deny.toml check --hide-inclusion-graph \
        --allow license-exception-not-encountered \
        licenses bans sources
done
if ! words=$(cargo-deny --config deny.toml fetch 2>&1); then
    echo "skipped: advisories: their database cannot be fetched: ${words##*$'\n'}"
    exit 0
fi
for workspace in . fleet ros2 view python fuzz; do
    cargo-deny --locked --manifest-path "$workspace/Cargo.toml" --config deny.toml check --hide-inclusion-graph \
        --allow license-exception-not-encountered \
        advisories
done
