#!/usr/bin/env bash
# Lints of what is built apart, warnings as errors: the fuzzer's targets, the Python module, the fleet, ros2 with
# and without Zenoh, the viewer. No code is made, and what several of them need is checked once, in one target
# folder. Those whose crates or compiler cannot be had are skipped.
# Each argument names one of them: fuzz, python, fleet, ros2, zenoh, view; none: all.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/crates.sh

export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target/apart}
[ $# -gt 0 ] || set -- fuzz python fleet ros2 zenoh view

for part in "$@"; do
    case $part in
    zenoh) manifest=ros2/Cargo.toml options=(--features zenoh) ;;
    fuzz | python | fleet | ros2 | view) manifest=$part/Cargo.toml options=() ;;
    *) echo "expected fuzz, python, fleet, ros2, zenoh or view, found $part" >&2 && exit 2 ;;
    esac
    can_be_built "$manifest" || continue
    begun=$SECONDS
    cargo clippy --locked --all-targets --manifest-path "$manifest" "${options[@]}" -- -D warnings
    echo "$part: checked in $((SECONDS - begun)) s"
done
