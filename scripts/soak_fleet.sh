#!/usr/bin/env bash
# A long test of a fleet: kills of the base and of uplinks, links that are cut, slow or repeat what they
# carry, each so many times; copies and map must be those of a day without faults.
#   scripts/soak_fleet.sh [TIMES]      (100)
set -euo pipefail
cd "$(dirname "$0")/../fleet"

times=${1:-100}
# One fault of each kind in eight steps.
TESSERA_FLEET_STEPS=$((8 * times)) cargo test --locked --test fleet -- --nocapture faults::kills_and_faults
