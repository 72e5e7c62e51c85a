#!/usr/bin/env bash
# Builds the manual with mdBook into target/book; a warning or a broken link fails.
#   scripts/check_book.sh
# Uses `mdbook` of the PATH, else that of target/mdbook, else installs it there with cargo (about four
# minutes on two cores, once). Skips, with a reason, where it cannot be had.
set -euo pipefail
cd "$(dirname "$0")/.."

export PATH="$PATH:$PWD/target/mdbook/bin"
if ! command -v mdbook >/dev/null; then
    words=$(cargo install mdbook --version '^0.5' --locked --no-default-features --root target/mdbook 2>&1) ||
        { echo "skipped: mdbook cannot be installed: ${words##*$'\n'}" && exit 0; }
fi
rm -rf target/book
words=$(mdbook build docs 2>&1) || { echo "$words" >&2 && exit 1; }
echo "$words"
is_clean=true
if grep -qE '(^|[^A-Z])(WARN|ERROR)([^A-Z]|$)' <<<"$words"; then
    echo "mdbook warns, expected a build without a warning" >&2
    is_clean=false
fi
if command -v python3 >/dev/null; then
    python3 scripts/check_book.py target/book || is_clean=false
else
    echo "skipped: no python3 to look at the links"
fi
$is_clean
