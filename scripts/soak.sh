#!/usr/bin/env bash
# A long test: runs under faults, a fleet under faults, then one long live run; memory, files and shared
# memory before, during and after.
#   scripts/soak.sh [SOURCE] [RUNS] [FAULTS] [LIVE_MINUTES] [FLEET_FAULTS]      (room 20 50 30 100)
#   scripts/soak.sh building 0 0 60 0    an hour through the building, five laps and a bit
#   scripts/soak.sh room 0 0 0 100       a fleet alone: 100 faults of each of seven kinds, with either form of copies
# The fleet is left out where its program is not built (docs/fleet.md).
# TESSERA names the program [target/release/tessera]. Ends with 1 where a promise was broken or
# one of these runs left something behind. The counts are the machine's, with those of others.
set -euo pipefail
cd "$(dirname "$0")/.."

source=${1:-room} runs=${2:-20} faults=${3:-50} minutes=${4:-30} fleet_faults=${5:-100}
tessera=${TESSERA:-target/release/tessera}
if [ ! -x "$tessera" ]; then
    cargo build --release
    tessera=target/release/tessera
fi
folder=$(mktemp -d)
child=
trap '[ -z "$child" ] || kill "$child" 2>/dev/null || true; rm -rf "$folder"' EXIT

private=${XDG_RUNTIME_DIR:+$XDG_RUNTIME_DIR/tessera}
[ -d "${private:-}" ] || private=/dev/shm/tessera-$(id -u)
count() { { find "$@" -mindepth 1 2>/dev/null || true; } | wc -l; }
shared_bytes() { find /dev/shm -type f -printf '%s\n' 2>/dev/null | awk '{ s += $1 } END { print s + 0 }'; }
say() {
    printf '%-28s %10s MB available  %5s files and %9s bytes in /dev/shm  %4s in %s\n' "$1" \
        "$(awk '/MemAvailable/ { printf "%.0f", $2 / 1000 }' /proc/meminfo)" \
        "$(count /dev/shm)" "$(shared_bytes)" "$(count "$private")" "$private"
}

say before
failed=0
for ((run = 1; run <= runs; run++)); do
    if ! "$tessera" chaos "$source" --kills "$faults" --seed "$run" >"$folder/chaos.txt" 2>&1; then
        failed=$((failed + 1))
        cat "$folder/chaos.txt"
    fi
    say "after run $run of $runs"
done
[ "$runs" -eq 0 ] || tail -30 "$folder/chaos.txt"

if [ "$fleet_faults" -gt 0 ] && [ ! -x fleet/target/release/tessera-fleet ]; then
    echo "skipped: a fleet under faults: fleet/target/release/tessera-fleet is not built"
elif [ "$fleet_faults" -gt 0 ]; then
    for form in "" --whole; do
        # An empty word is none.
        # shellcheck disable=SC2086
        if ! "$tessera" chaos --fleet --times "$fleet_faults" --seed "$fleet_faults" $form >"$folder/fleet.txt" 2>&1; then
            failed=$((failed + 1))
        fi
        cat "$folder/fleet.txt"
        say "after a fleet $form"
    done
fi

# Memory of a process's own, without mapped files, megabytes.
resident() { awk '/RssAnon/ { printf "%.1f", $2 / 1000 }' "/proc/$1/status" 2>/dev/null || echo -; }
open_files() { count "/proc/$1/fd"; }
# Keyframes, loops, and the latency of each stage so far (median, 99 %), by one look at the run.
state() {
    "$tessera" top "soak-$$" --json --interval 1 --count 1 2>/dev/null | python3 -c '
import json, sys
for line in sys.stdin:
    look = json.loads(line)
    ms = ["{} {:.0f}/{:.0f} ms".format(s["stage"], s["latency_ms"]["p50"], s["latency_ms"]["p99"]) for s in look["stages"]]
    dropped = sum(s["dropped"] for s in look["stages"])
    print("{} keyframes, {} loops, {} dropped, {}".format(look["keyframes"], look["loops"], dropped, ", ".join(ms)))
' || true
}
disk_mb() { du -sm "$1" 2>/dev/null | cut -f1; }
live_line() {
    local line pid name
    line="live, minute $1:"
    for name in run sensor reconstruct align optimise; do
        if [ "$name" = run ]; then pid=$child; else pid=$(pgrep -f "stage $name --run-dir $folder/live" | head -1 || true); fi
        [ -n "$pid" ] && line="$line  $name $(resident "$pid") MB $(open_files "$pid") files"
    done
    echo "$line"
    echo "    $(disk_mb "$folder/live") MB on disk; $(state)"
}
if [ "$minutes" -gt 0 ]; then
    seconds=$((60 * minutes))
    # A recording ends when it ends; a scene goes on for as many frames as are asked for, 30 a second.
    "$tessera" run "$source" --live --quiet --frames $((30 * seconds)) --name "soak-$$" --out "$folder/live" &
    child=$!
    for ((minute = 0; minute <= minutes; minute++)); do
        sleep $((minute == 0 ? 10 : 60))
        kill -0 "$child" 2>/dev/null || break
        live_line "$minute"
    done
    wait "$child" || failed=$((failed + 1))
    child=
    "$tessera" export "$folder/live" || failed=$((failed + 1))
    # `tessera chaos` looks for what its runs left by itself.
    prefix=$(sed -n 's/.*"prefix": "\(.*\)".*/\1/p' "$folder/live/run.json")
    left=$({ find /dev/shm "$private" -mindepth 1 -name "$prefix*" 2>/dev/null || true; } | sort -u | wc -l)
    echo "the live run left $left files in shared memory"
    [ "$left" -eq 0 ] || failed=$((failed + 1))
fi
say after
[ "$failed" -eq 0 ] && echo "all promises were kept" || { echo "$failed failures"; exit 1; }
