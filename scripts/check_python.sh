#!/usr/bin/env bash
# Builds the wheel, installs it into a clean environment and compares it with the command on a
# recording in the TUM layout: scripts/check_python.sh FOLDER. Skipped where maturin cannot be had.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(realpath "${1:?expected a recording: scripts/check_python.sh FOLDER}")
tools=$(mktemp -d)
trap 'rm -rf "$tools"' EXIT
python3 -m venv "$tools/build"
if ! words=$("$tools/build/bin/pip" install --quiet "maturin>=1.8,<2" 2>&1); then
    echo "skipped: maturin cannot be installed: ${words##*$'\n'}"
    exit 0
fi
PATH="$tools/build/bin:$PATH" scripts/package.sh
python3 -m venv "$tools/clean"
"$tools/clean/bin/pip" install --quiet target/package/tessera_slam-*.whl pillow
"$tools/clean/bin/python" python/tests/test_wheel.py "$folder"
