#!/usr/bin/env bash
# Keys and certificates of a fleet, by openssl: an authority, the base and each robot, valid for a year.
#
#   scripts/fleet_certificates.sh FOLDER BASE_HOST ROBOT...
#
# FOLDER gets ca.pem, base.pem, base.key, and ROBOT.pem and ROBOT.key of each robot, to be carried to it
# with ca.pem. ca.key signs: keep it off the robots. A robot's certificate has its name, by which the base
# knows it.
set -euo pipefail
if [ $# -lt 3 ]; then
    echo "usage: $0 FOLDER BASE_HOST ROBOT..." >&2
    exit 2
fi
folder=$1 host=$2
shift 2
umask 077
mkdir -p "$folder"
cd "$folder"
curve=(-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes)
if [ ! -f ca.pem ]; then
    openssl req -x509 "${curve[@]}" -keyout ca.key -out ca.pem -days 365 -subj "/CN=tessera-fleet" \
        -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign"
fi
case $host in
*[!0-9.]*) address="DNS:$host" ;;
*) address="IP:$host" ;;
esac
for name in base "$@"; do
    openssl req "${curve[@]}" -keyout "$name.key" -out "$name.csr" -subj "/CN=$name"
    printf '%s\n' "subjectAltName=DNS:$name,$address" "basicConstraints=CA:FALSE" \
        "keyUsage=digitalSignature" "extendedKeyUsage=serverAuth,clientAuth" >"$name.ext"
    openssl x509 -req -in "$name.csr" -CA ca.pem -CAkey ca.key -CAcreateserial -days 365 \
        -extfile "$name.ext" -out "$name.pem"
    rm "$name.csr" "$name.ext"
done
