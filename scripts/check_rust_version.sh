#!/usr/bin/env bash
# The minimum Rust version of each of the six lock files: no crate that is built asks for a newer one. That
# our own code asks for none is clippy's `incompatible_msrv`, an error in scripts/check.sh.
# --compile: with that version, where rustup has it.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/crates.sh

for workspace in . fleet ros2 view python fuzz; do
    manifest=$workspace/Cargo.toml
    can_be_built "$manifest" || continue
    stated=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$manifest")
    cargo metadata --locked --format-version 1 --filter-platform x86_64-unknown-linux-gnu \
        --manifest-path "$manifest" | python3 -c '
import json, sys
workspace, stated = sys.argv[1:]
number = lambda version: tuple(int(part) for part in version.split("."))[:2]
built = json.load(sys.stdin)
nodes = {node["id"] for node in built["resolve"]["nodes"]}
newer = ["{name} {version} needs {rust_version}".format(**p) for p in built["packages"]
         if p["id"] in nodes and p["rust_version"] and number(p["rust_version"]) > number(stated)]
if newer:
    sys.exit(f"{workspace}: Rust {stated} is stated, and " + "; ".join(newer))
print(f"{workspace}: no crate of {len(nodes)} needs more than Rust {stated}")
' "$workspace" "$stated"
    [ "${1:-}" = --compile ] || continue
    toolchain=$(rustup toolchain list 2> /dev/null | grep -o "^$stated[^ ]*" || true)
    if [ -n "$toolchain" ]; then
        cargo "+$toolchain" check --locked --manifest-path "$manifest"
    else
        echo "$workspace: not compiled with Rust $stated, which rustup does not have here"
    fi
done
