#!/usr/bin/env bash
# Tags a release once all of it holds, and pushes nothing.
#
#   scripts/release.sh 0.1.0            # everything, then the tag v0.1.0
#   scripts/release.sh 0.1.0 --dry-run  # the same without the tag, up to the end whatever fails
#   scripts/release.sh 0.1.0 --dry-run --quick   # what takes seconds alone
#
# Clean tree, one version everywhere, a section of CHANGELOG.md with a date; then format, lints, documentation,
# licences, minimum Rust version, tests, what is built apart, accuracy and speed within their baselines.
set -euo pipefail
cd "$(dirname "$0")/.."

version=${1:?expected a version, such as 0.1.0}
dry=false quick=false
for option in "${@:2}"; do
    case $option in
    --dry-run) dry=true ;;
    --quick) quick=true ;;
    *) echo "release: unknown option $option, expected --dry-run or --quick" >&2 && exit 2 ;;
    esac
done
if $quick && ! $dry; then
    echo "release: --quick checks too little for a tag, expected --dry-run with it" >&2
    exit 2
fi

failed=()
# Runs a check by its name; the first that fails ends a release, a dry run goes on.
check() {
    local name=$1
    shift
    echo "== $name"
    if "$@"; then
        return
    fi
    echo "failed: $name" >&2
    failed+=("$name")
    $dry || exit 1
}

is_clean() {
    local changed
    changed=$(git status --porcelain)
    [ -z "$changed" ] || { echo "not committed: $changed" >&2 && return 1; }
}

has_no_tag() {
    ! git rev-parse --quiet --verify "refs/tags/v$version" > /dev/null || { echo "v$version is there already" >&2 && return 1; }
}

# The version that each manifest states, and each lock file of our own crates.
has_one_version() {
    local found wrong=0
    for file in Cargo.toml fleet/Cargo.toml ros2/Cargo.toml view/Cargo.toml python/Cargo.toml python/pyproject.toml; do
        found=$(sed -n 's/^version = "\(.*\)"/\1/p' "$file" | head -n 1)
        [ "$found" = "$version" ] || { echo "$file: found $found, expected $version" >&2 && wrong=1; }
    done
    for file in Cargo.lock fleet/Cargo.lock ros2/Cargo.lock view/Cargo.lock python/Cargo.lock; do
        found=$(grep -A 1 '^name = "tessera' "$file" | sed -n 's/^version = "\(.*\)"/\1/p' | sort -u | tr '\n' ' ')
        [ "$found" = "$version " ] || { echo "$file: found $found, expected $version" >&2 && wrong=1; }
    done
    return $wrong
}

# `## 0.1.0, 2026-11-26` with at least one line below it.
has_notes() {
    local notes
    notes=$(sed -n "/^## $version, [0-9]\{4\}-[0-9]\{2\}-[0-9]\{2\}\$/,/^## /p" CHANGELOG.md | grep -c '^- ' || true)
    [ "$notes" -gt 0 ] || { echo "CHANGELOG.md: expected '## $version, YEAR-MONTH-DAY' with notes below it" >&2 && return 1; }
}

check "clean tree" is_clean
check "no such tag" has_no_tag
check "one version" has_one_version
check "notes with a date" has_notes
if ! $quick; then
    check "licences, sources" scripts/check_deny.sh
    check "minimum Rust version" scripts/check_rust_version.sh
    check "format, lints, documentation" scripts/check.sh
    check "release build" cargo build --release --locked
    check "tests" cargo test --locked
    check "lints of what is built apart" scripts/check_apart.sh
    check "fleet" scripts/check_fleet.sh
    check "ros2" scripts/check_ros2.sh --zenoh
    check "packages" scripts/check_packages.sh
    check "accuracy within its baseline" scripts/accuracy.py
    check "speed within its baseline" scripts/speed.py
fi

if [ ${#failed[@]} -gt 0 ]; then
    printf 'not ready: %s\n' "${failed[@]}" >&2
    exit 1
fi
if $dry; then
    echo "v$version would be tagged"
else
    git tag --annotate "v$version" --message "Tessera $version"
    echo "tagged v$version; push it by: git push origin v$version"
fi
