#!/usr/bin/env bash
# Tests of fleet/, which is outside the workspace. Skipped where its crates cannot be had. Some tests need the
# command, which `cargo build` builds, or openssl; each says what it lacks. The first build takes ten minutes or
# more: one profile, so that there is one. Lints: scripts/check_apart.sh fleet.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/crates.sh

can_be_built fleet/Cargo.toml || exit 0
cd fleet
cargo test --locked
