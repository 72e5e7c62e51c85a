#!/usr/bin/env bash
# Packages of this machine's kind in target/package: a Python wheel with the command in it (needs
# maturin), and a .deb (needs cargo-deb: cargo install cargo-deb). Says what it leaves out and why.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$PWD/target/package
mkdir -p "$out"
cargo build --release
if command -v maturin > /dev/null; then
    scripts=python/tessera_slam.data/scripts
    mkdir -p "$scripts"
    cp target/release/tessera "$scripts/tessera"
    (cd python && maturin build --release --locked --out "$out")
    rm -r python/tessera_slam.data
else
    echo "no wheel: maturin is not here; pip install maturin"
fi
if cargo deb --version > /dev/null 2>&1; then
    cargo deb --no-build --output "$out/"
else
    echo "no .deb: cargo-deb is not here; cargo install cargo-deb"
fi
ls -l "$out"
