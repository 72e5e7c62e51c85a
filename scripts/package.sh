#!/usr/bin/env bash
# A Python wheel with the command in it, and a .deb, in target/packages, for machines of this kind.
# Says what it leaves out and why: the wheel needs maturin, the .deb dpkg-deb (in Debian and Ubuntu).
set -euo pipefail
cd "$(dirname "$0")/.."
out=$PWD/target/packages
rm -rf "$out"
mkdir -p "$out"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
# The same tree gives the same bytes: times of files are those of the commit.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2> /dev/null || date +%s)
export SOURCE_DATE_EPOCH
cargo build --release --locked
program=target/release/tessera

wheel() {
    local scripts=python/tessera_slam.data/scripts
    mkdir -p "$scripts"
    cp "$program" "$scripts/tessera"
    # In the workspace's target folder, where most of its crates are built already.
    (cd python && CARGO_TARGET_DIR=../target maturin build --release --locked --out "$out")
    rm -r python/tessera_slam.data
}

# The tree of files as they are installed.
deb_tree() {
    local tree=$1 page
    local share=$tree/usr/share documents=$tree/usr/share/doc/tessera-slam
    install -D "$program" "$tree/usr/bin/tessera"
    install -d "$share/zsh/vendor-completions" "$share/fish/vendor_completions.d" \
        "$share/bash-completion/completions" "$tree/usr/lib/systemd/user"
    "$program" completions bash > "$share/bash-completion/completions/tessera"
    "$program" completions zsh > "$share/zsh/vendor-completions/_tessera"
    "$program" completions fish > "$share/fish/vendor_completions.d/tessera.fish"
    "$program" man "$share/man/man1"
    gzip -9 -n "$share"/man/man1/*.1
    for page in scripts/systemd/*.service; do
        sed 's,/usr/local/bin/tessera,/usr/bin/tessera,' "$page" > "$tree/usr/lib/systemd/user/${page##*/}"
    done
    install -D -m 644 -t "$documents" README.md CHANGELOG.md
    install -D -m 644 -t "$documents/config" config/*.toml
    install -D -m 644 -t "$documents/manual" docs/*.md
    cat LICENSE-MIT <(echo) LICENSE-APACHE > "$documents/copyright"
    find "$tree" -type d -exec chmod 755 {} +
    find "$tree" -type f ! -path '*/usr/bin/*' -exec chmod 644 {} +
}

deb() {
    local tree glibc architecture
    tree=$(mktemp -d)
    architecture=$(dpkg --print-architecture)
    deb_tree "$tree"
    # The oldest C library that has every symbol of the program.
    glibc=$(grep -aoE 'GLIBC_[0-9]+(\.[0-9]+)+' "$program" | sed 's/GLIBC_//' | sort -uV | tail -n 1)
    mkdir "$tree/DEBIAN"
    (cd "$tree" && find usr -type f -print0 | sort -z | xargs -0 md5sum > DEBIAN/md5sums)
    cat > "$tree/DEBIAN/control" <<END
Package: tessera-slam
Version: $version
Architecture: $architecture
Maintainer: The Tessera authors
Section: science
Priority: optional
Installed-Size: $(du -sk "$tree/usr" | cut -f 1)
Depends: libc6 (>= $glibc), libgcc-s1
Description: RGB-D SLAM in separate processes joined by shared memory
 Depth and colour images of a recording or of a camera in; a trajectory, a map
 and a verdict on both out. After Holz and Behnke, "Approximate Surface
 Reconstruction and Registration for RGB-D SLAM" (ECMR 2015).
END
    dpkg-deb --root-owner-group -Zxz --build "$tree" "$out/tessera-slam_${version}_$architecture.deb"
    rm -r "$tree"
}

if command -v maturin > /dev/null; then
    wheel
else
    echo "no wheel: maturin is not here; pip install maturin"
fi
if command -v dpkg-deb > /dev/null; then
    deb
else
    echo "no .deb: dpkg-deb is not here"
fi
ls -l "$out"
