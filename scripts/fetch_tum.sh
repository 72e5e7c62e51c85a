#!/usr/bin/env bash
# Fetches sequences of the TUM RGB-D benchmark and unpacks them, one folder each.
#
#   scripts/fetch_tum.sh DIR [SEQUENCE...]      fr1_desk, fr3_long_office_household, ...
#   scripts/fetch_tum.sh DIR --list             the sequences it knows
#
# Without names: the sequences of docs/accuracy.md. An interrupted download goes on where it
# stopped; a sequence that is there already is left alone. TESSERA_TUM_URL replaces the server.
set -euo pipefail

url=${TESSERA_TUM_URL:-https://cvg.cit.tum.de/rgbd/dataset}
standard=(fr1_xyz fr1_rpy fr1_desk fr1_desk2 fr1_room fr1_360 fr1_teddy fr1_plant fr2_desk fr2_xyz
    fr3_long_office_household fr3_nostructure_texture_near_withloop)
others=(fr1_floor fr2_rpy fr2_360_hemisphere fr2_large_with_loop fr3_cabinet fr3_large_cabinet fr3_teddy
    fr3_structure_texture_near fr3_structure_texture_far fr3_structure_notexture_near
    fr3_structure_notexture_far fr3_nostructure_texture_far fr3_sitting_xyz fr3_walking_xyz)

fail() {
    echo "fetch_tum: $1" >&2
    exit "${2:-1}"
}

[ $# -ge 1 ] || fail "expected: fetch_tum.sh DIR [SEQUENCE...]" 2
folder=$1
shift
if [ "${1:-}" = --list ]; then
    printf '%s\n' "${standard[@]}" "${others[@]}"
    exit 0
fi
for tool in curl tar gzip; do
    command -v "$tool" >/dev/null || fail "$tool is not installed"
done
mkdir -p "$folder" || fail "$folder: cannot be made"
[ $# -ge 1 ] || set -- "${standard[@]}"

# The server's size of a file in bytes; it must say so, or a cut download could not be told.
size_of() {
    local head
    head=$(curl --silent --show-error --fail --location --head "$1") || fail "$1: not to be had (see above)"
    printf '%s' "$head" | tr -d '\r' | awk 'tolower($1) == "content-length:" { size = $2 } END { print size }'
}

fetch() {
    local sequence=$1 number=${1:2:1} long file whole have
    long=rgbd_dataset_freiburg$number${sequence:3}
    [ ! -d "$folder/$long" ] || {
        echo "$sequence: is there"
        return
    }
    file=$folder/$long.tgz
    whole=$(size_of "$url/freiburg$number/$long.tgz")
    [ -n "$whole" ] || fail "$sequence: the server does not say how long $long.tgz is"
    have=$(stat -c %s "$file.part" 2>/dev/null || echo 0)
    if [ "$have" -gt "$whole" ]; then
        rm "$file.part"
        have=0
    fi
    if [ "$have" -lt "$whole" ]; then
        echo "$sequence: fetching $whole bytes, $have of them are there"
        curl --fail --location --show-error --continue-at - --retry 3 --output "$file.part" \
            $([ -t 2 ] && echo --progress-bar || echo --silent) "$url/freiburg$number/$long.tgz" ||
            fail "$sequence: the download broke off; the same command goes on with it"
    fi
    have=$(stat -c %s "$file.part")
    [ "$have" -eq "$whole" ] || fail "$sequence: $have bytes came, expected $whole; the same command goes on"
    gzip --test "$file.part" 2>/dev/null || {
        rm "$file.part"
        fail "$sequence: $long.tgz is damaged and was removed; the same command fetches it again"
    }
    # Unpacked beside its place and moved there whole, so that a folder is never half there.
    rm -rf "$folder/.$long"
    mkdir "$folder/.$long"
    tar --extract --gzip --no-same-owner --file "$file.part" --directory "$folder/.$long" ||
        fail "$sequence: $long.tgz cannot be unpacked; is the disk full?"
    for part in depth.txt rgb.txt groundtruth.txt depth rgb; do
        [ -e "$folder/.$long/$long/$part" ] || fail "$sequence: there is no $part in $long.tgz"
    done
    cp "$cameras/freiburg$number.toml" "$folder/.$long/$long/camera.toml"
    mv "$folder/.$long/$long" "$folder/$long"
    rmdir "$folder/.$long"
    rm "$file.part"
    echo "$sequence: done"
}

cameras=$(cd "$(dirname "$0")/../config/cameras" && pwd)
for sequence in "$@"; do
    [[ $sequence =~ ^fr[123]_[a-z0-9_]+$ ]] ||
        fail "no sequence '$sequence': expected a name like fr1_desk (fetch_tum.sh DIR --list)" 2
done
for sequence in "$@"; do
    fetch "$sequence"
done
