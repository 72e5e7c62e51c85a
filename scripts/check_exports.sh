#!/bin/sh
# Opens what `tessera export` writes with other people's libraries: Open3D, trimesh, evo, pycolmap,
# nerfbaselines and Pillow from PyPI.
#   scripts/check_exports.sh [RUN_FOLDER]      (default: a fresh run of 60 frames of the simulated room)
# Skips, with a reason, what is not installed: python3 -m pip install open3d trimesh evo pycolmap pillow, and
# python3 -m pip install --no-deps nerfbaselines tqdm
# TESSERA and PYTHON name other executables than target/release/tessera and python3.
set -eu
cd "$(dirname "$0")/.."
tessera=${TESSERA:-target/release/tessera}
python=${PYTHON:-python3}
[ -x "$tessera" ] || { echo "no $tessera: cargo build --release"; exit 1; }
command -v "$python" >/dev/null || { echo "skipped: no $python"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
run=${1:-$work/run}
[ -d "$run" ] || "$tessera" run room --frames 60 --quiet --out "$run" --name "check-exports-$$"
"$tessera" export "$run" --cloud "$work/a.ply" --mesh "$work/m.ply" --kitti "$work/k.txt" --euroc "$work/e.csv"
"$tessera" export "$run" --cloud "$work/a.pcd" --mesh "$work/m.glb" --quiet
"$tessera" export "$run" --colmap "$work/colmap" --nerfstudio "$work/nerf" --grid "$work/map.yaml" --every 10
"$tessera" export "$run" --colmap "$work/colmap_text" --colmap-text --every 10 --quiet
"$python" scripts/check_exports.py "$run" "$work"
