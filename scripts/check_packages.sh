#!/usr/bin/env bash
# Builds the packages and uses them outside of the repository: the wheel in a clean environment, where
# the module must give the bytes of the command, and the program out of the .deb. Each FOLDER given is a
# recording that the wheel is compared on beside the room. Skipped where maturin cannot be had.
set -euo pipefail
cd "$(dirname "$0")/.."
repository=$PWD
folders=()
for folder in "$@"; do folders+=("$(realpath "$folder")"); done
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT

python3 -m venv "$place/build"
if ! words=$("$place/build/bin/pip" install --quiet "maturin>=1.8,<2" 2>&1); then
    echo "skipped: maturin cannot be installed: ${words##*$'\n'}"
    exit 0
fi
(cd python && cargo fmt --check)
PATH="$place/build/bin:$PATH" scripts/package.sh

python3 -m venv "$place/clean"
python=$place/clean/bin/python
"$place/clean/bin/pip" install --quiet "$(echo target/packages/tessera_slam-*.whl)[client]"
cp -r python/tests examples/python/arrays.py "$place"
cd "$place"
"$place/clean/bin/tessera" --version
"$python" tests/test_wheel.py "${folders[@]}"
"$python" arrays.py
# The stubs say what the compiled part has.
"$place/clean/bin/pip" install --quiet mypy
"$place/clean/bin/mypy" --strict --ignore-missing-imports -p tessera
"$place/clean/bin/stubtest" tessera._tessera

if ! command -v dpkg-deb > /dev/null; then
    echo "skipped: the .deb: dpkg-deb is not here"
    exit 0
fi
dpkg-deb -x "$repository"/target/packages/tessera-slam_*.deb "$place/deb"
"$place/deb/usr/bin/tessera" run room --frames 30 --quiet --out "$place/room"
"$place/clean/bin/tessera" run room --frames 30 --quiet --out "$place/same"
cmp "$place/room/trajectory.txt" "$place/same/trajectory.txt"
cmp "$place/room/map.ply" "$place/same/map.ply"
test -s "$place/deb/usr/share/man/man1/tessera-run.1.gz"
bash -n "$place/deb/usr/share/bash-completion/completions/tessera"
# At most 25 MB each.
find "$repository/target/packages" -type f -size +25000k | (! grep .)
echo "the packages are as they should be"
