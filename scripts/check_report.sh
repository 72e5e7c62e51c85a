#!/bin/sh
# Opens the report of a run in headless Chromium: what it draws, whether it can be used, and its width on a
# phone.
#   scripts/check_report.sh [RUN_FOLDER]       (default: a fresh run of the simulated room)
# Needs node and npm, which fetch the browser (@sparticuz/chromium, puppeteer-core) into a temporary folder;
# skips, with a reason, without them. BROWSER_MODULES names a folder that has both packages already, PICTURES
# one for screenshots, TESSERA another executable than target/release/tessera.
set -eu
cd "$(dirname "$0")/.."
tessera=${TESSERA:-target/release/tessera}
[ -x "$tessera" ] || { echo "no $tessera: cargo build --release"; exit 1; }
command -v npm >/dev/null || { echo "skipped: no npm"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
modules=${BROWSER_MODULES:-$work}
[ -d "$modules/node_modules/puppeteer-core" ] ||
    npm install --silent --no-audit --no-fund --prefix "$modules" @sparticuz/chromium@147 puppeteer-core@24 ||
    { echo "skipped: npm cannot fetch the browser"; exit 0; }
run=${1:-$work/run}
[ -d "$run" ] || "$tessera" run room --quiet --out "$run" --name "check-report-$$"
"$tessera" report "$run" --out "$work/report.html" >/dev/null
# The browser unpacks itself there.
TMPDIR=$work node scripts/check_report.mjs "$modules" "$work/report.html" "${PICTURES:-}"
