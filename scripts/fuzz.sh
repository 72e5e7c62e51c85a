#!/usr/bin/env bash
# Fuzzes every reader of bytes from outside, for a bounded time each:
#   scripts/fuzz.sh [SECONDS] [TARGET...]
# New inputs go to fuzz/found; what breaks a promise goes to fuzz/artifacts, and belongs into
# fuzz/corpus once it is fixed, where `cargo test` replays it.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1:-60}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(lists camera configuration images journal messages recording)

if ! cargo +nightly --version >/dev/null 2>&1; then
    echo "skipped: fuzzing needs a nightly compiler (rustup toolchain install nightly)"
    exit 0
fi
if ! command -v cargo-fuzz >/dev/null; then
    echo "skipped: fuzzing needs cargo-fuzz (cargo install cargo-fuzz)"
    exit 0
fi
for target in "${targets[@]}"; do
    mkdir -p "fuzz/found/$target"
    # New inputs into the first folder; the corpus in git is only read.
    cargo +nightly fuzz run "$target" "fuzz/found/$target" "fuzz/corpus/$target" -- \
        -max_total_time="$seconds" -max_len=8192 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1
done
echo "all targets ran for $seconds s each and found nothing"
