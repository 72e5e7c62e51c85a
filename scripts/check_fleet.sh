#!/usr/bin/env bash
# Format, lints and tests of fleet/, which is outside the workspace; warnings are errors. Skipped where
# its crates cannot be had. Some tests need the command, which `cargo build` builds, or openssl; each
# says what it lacks. The first build takes ten minutes or more: one profile, so that there is one.
# --tests: no format and no lints, which take as long as the tests.
set -euo pipefail
cd "$(dirname "$0")/../fleet"

lints=true
[ "${1:-}" = --tests ] && lints=false
$lints && cargo fmt --check
if ! words=$(cargo fetch --locked 2>&1); then
    case $words in
    *--locked*) echo "$words" >&2 && exit 1 ;; # Its lock file does not fit the workspace any more.
    *) echo "skipped: fleet/: its crates cannot be fetched: ${words##*$'\n'}" && exit 0 ;;
    esac
fi
$lints && cargo clippy --locked --all-targets -- -D warnings
cargo test --locked
