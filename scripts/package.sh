#!/usr/bin/env bash
# A Python wheel with the command in it, and a .deb, in target/packages, for machines of this kind.
# With arguments among ros2, fleet and view, or all, a .deb of each of these programs beside it: their crates
# are many and take a quarter of an hour each. Says what it leaves out and why: the wheel needs maturin, the
# .deb dpkg-deb (in Debian and Ubuntu).
set -euo pipefail
cd "$(dirname "$0")/.."
out=$PWD/target/packages
companions=("$@")
[ "${1:-}" = all ] && companions=(ros2 fleet view)
for companion in "${companions[@]}"; do
    case $companion in
    ros2 | fleet | view) ;;
    *) echo "$companion: expected ros2, fleet, view or all" >&2 && exit 2 ;;
    esac
done
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

# Makes the package NAME of a tree, with what it depends on and its description.
pack() {
    local name=$1 tree=$2 depends=$3 description=$4 architecture glibc
    architecture=$(dpkg --print-architecture)
    # The oldest C library that has every symbol of the programs.
    glibc=$(cat "$tree"/usr/bin/* | grep -aoE 'GLIBC_[0-9]+(\.[0-9]+)+' | sed 's/GLIBC_//' | sort -uV | tail -n 1)
    mkdir "$tree/DEBIAN"
    (cd "$tree" && find usr -type f -print0 | sort -z | xargs -0 md5sum > DEBIAN/md5sums)
    cat > "$tree/DEBIAN/control" <<END
Package: $name
Version: $version
Architecture: $architecture
Maintainer: The Tessera authors
Section: science
Priority: optional
Installed-Size: $(du -sk "$tree/usr" | cut -f 1)
Depends: libc6 (>= $glibc), libgcc-s1$depends
Description: $description
END
    dpkg-deb --root-owner-group -Zxz --build "$tree" "$out/${name}_${version}_$architecture.deb"
    rm -r "$tree"
}

deb() {
    local tree
    tree=$(mktemp -d)
    deb_tree "$tree"
    pack tessera-slam "$tree" '' "RGB-D SLAM in separate processes joined by shared memory
 Depth and colour images of a recording or of a camera in; a trajectory, a map
 and a verdict on both out. After Holz and Behnke, \"Approximate Surface
 Reconstruction and Registration for RGB-D SLAM\" (ECMR 2015)."
}

# The program of a folder of its own, beside the command of the same version.
companion_deb() {
    local folder=$1 description=$2 tree options=()
    [ "$folder" = ros2 ] && options=(--features zenoh)
    # In the workspace's target folder: what is the same is built once.
    CARGO_TARGET_DIR=target cargo build --release --locked --manifest-path "$folder/Cargo.toml" "${options[@]}"
    tree=$(mktemp -d)
    install -D "target/release/tessera-$folder" "$tree/usr/bin/tessera-$folder"
    install -d "$tree/usr/share/doc/tessera-slam-$folder"
    cat LICENSE-MIT <(echo) LICENSE-APACHE > "$tree/usr/share/doc/tessera-slam-$folder/copyright"
    find "$tree" -type d -exec chmod 755 {} +
    find "$tree" -type f ! -path '*/usr/bin/*' -exec chmod 644 {} +
    pack "tessera-slam-$folder" "$tree" ", tessera-slam (= $version)" "$description"
}

if command -v maturin > /dev/null; then
    wheel
else
    echo "no wheel: maturin is not here; pip install maturin"
fi
if command -v dpkg-deb > /dev/null; then
    deb
    for companion in "${companions[@]}"; do
        case $companion in
        ros2) words='tessera ros2: a run in a live ROS 2 network, without ROS' ;;
        fleet) words='tessera uplink and tessera base: one map of many robots' ;;
        view) words='tessera view: a run in Rerun' ;;
        esac
        companion_deb "$companion" "$words"
    done
else
    echo "no .deb: dpkg-deb is not here"
fi
ls -l "$out"
