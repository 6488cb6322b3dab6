#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Times the stages of a fix beside their peers, one thread, in the same run.
#
#   tests/bench/run.sh [--json FILE] [--filter REGEX]
#
# --json FILE     also writes Google Benchmark's JSON of all stages
# --filter REGEX  only benchmarks whose name matches; names are STAGE/WHO[/PARAMETERS]
#
# Photographs are 20 test images of the IE Tower set in $VIEWFIX_DATA, else in
# ../shared/data; without it, drawn images. Needs build/host-release. The table shows
# the least of five repetitions, milliseconds.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly BIN=$ROOT/build/host-release/tests
readonly SET=${VIEWFIX_DATA:-$ROOT/../shared/data}/ie_tower
json=
filter=.

while [[ $# -gt 0 ]]; do
  case $1 in
    -h | --help) sed -n '3,13s/^# \{0,1\}//p' "$0"; exit ;;
    --json | --filter)
      [[ $# -ge 2 ]] || die "$1 takes a value"
      if [[ $1 == --json ]]; then json=$2; else filter=$2; fi
      shift 2 ;;
    *) die "no such option: $1 (see --help)" ;;
  esac
done

if [[ -f $SET/images.csv ]]; then
  VIEWFIX_BENCH_IMAGES=$(awk -F, -v set="$SET/" '$3 == "test" && n++ % 15 == 0 && n < 300 \
    { print set $1 }' "$SET/images.csv")
  export VIEWFIX_BENCH_IMAGES
  echo "Images: 20 photographs of $SET"
else
  echo "Images: drawn, as there is no $SET (corner detectors are slower on these than on photographs)"
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for bench in stage_bench score_bench pose_bench; do
  [[ -x $BIN/$bench ]] || die "$BIN/$bench: not built; build the preset host-release"
  "$BIN/$bench" --benchmark_filter="$filter" --benchmark_repetitions=5 \
    --benchmark_min_time=0.2 --benchmark_enable_random_interleaving=true \
    --benchmark_out="$work/$bench.json" --benchmark_out_format=json > "$work/log" ||
    die "$bench failed: $(tail -1 "$work/log")"
done
python3 -B "$ROOT/tests/bench/table.py" "$work" "$json"
