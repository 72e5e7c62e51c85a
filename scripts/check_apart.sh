#!/usr/bin/env bash
# Whether what no other script compiles in CI does: the viewer, the Python module, the fuzzer's targets, and
# ros2's Zenoh. `cargo check` alone: no code is made. Those whose crates cannot be had are skipped.
# Each argument names one of them: view, python, fuzz, zenoh; none: all.
set -euo pipefail
cd "$(dirname "$0")/.."

for name in "${@:-python fuzz zenoh view}"; do
    for part in $name; do
        case $part in
        zenoh) manifest=ros2/Cargo.toml options=(--features zenoh) ;;
        view | python | fuzz) manifest=$part/Cargo.toml options=() ;;
        *) echo "expected view, python, fuzz or zenoh, found $part" >&2 && exit 2 ;;
        esac
        if ! words=$(cargo fetch --locked --manifest-path "$manifest" 2>&1); then
            case $words in
            *--locked*) echo "$words" >&2 && exit 1 ;; # Its lock file does not fit the workspace any more.
            *) echo "skipped: $part: its crates cannot be fetched: ${words##*$'\n'}" && continue ;;
            esac
        fi
        begun=$SECONDS
        cargo check --locked --all-targets --manifest-path "$manifest" "${options[@]}"
        echo "$part: checked in $((SECONDS - begun)) s"
    done
done
