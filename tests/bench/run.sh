#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Times the stages of a fix beside their peers, and whole frames, one thread, in the same run.
#
#   tests/bench/run.sh [--json FILE] [--filter REGEX] [--model FILE]
#
# --json FILE     also writes Google Benchmark's JSON of all stages
# --filter REGEX  only benchmarks whose name matches; names are STAGE/WHO[/PARAMETERS]
# --model FILE    of whole frames; without it one is trained, which takes minutes
#
# Photographs are 20 test images of the IE Tower set in $VIEWFIX_DATA, else in
# ../shared/data; without it, drawn images, and a small museum for whole frames. Needs
# build/host-release. The table shows the least of five repetitions, milliseconds of
# processor time.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly BIN=$ROOT/build/host-release/tests
readonly VIEWFIX=$ROOT/build/host-release/bin/viewfix
readonly SET=${VIEWFIX_DATA:-$ROOT/../shared/data}/ie_tower
json=
filter=.
model=

while [[ $# -gt 0 ]]; do
  case $1 in
    -h | --help) sed -n '3,15s/^# \{0,1\}//p' "$0"; exit ;;
    --json | --filter | --model)
      [[ $# -ge 2 ]] || die "$1 takes a value"
      declare "${1#--}=$2"
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
  [[ -z $model ]] || die "--model: no photographs in $SET"
  echo "Images: drawn, as there is no $SET (corner detectors are slower on these than on photographs)"
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A model of the photographs, and frames of it.
frames=${VIEWFIX_BENCH_IMAGES:-}
train_model() {
  local site=$SET words=2000
  if [[ ! -f $SET/images.csv ]]; then
    site=$work/museum words=200
    "$VIEWFIX" simulate --seed 1 --images-per-view 7 --out "$site" > "$work/log" 2>&1 || return
    frames=$(printf '%s\n' "$site"/images/*/*/*1.jpg)
  fi
  model=$work/model.vfx
  "$VIEWFIX" train "$site" --out "$model" --words "$words" > "$work/log" 2>&1
}

for bench in stage_bench score_bench pose_bench frame_bench; do
  [[ -x $BIN/$bench ]] || die "$BIN/$bench: not built; build the preset host-release"
  [[ -n $("$BIN/$bench" --benchmark_list_tests --benchmark_filter="$filter" 2> "$work/log") ]] ||
    continue
  if [[ $bench == frame_bench ]]; then
    [[ -n $model ]] || train_model || die "no model: $(tail -1 "$work/log")"
    export VIEWFIX_BENCH_MODEL=$model VIEWFIX_BENCH_IMAGES=$frames
  fi
  "$BIN/$bench" --benchmark_filter="$filter" --benchmark_repetitions=5 \
    --benchmark_min_time=0.2 --benchmark_enable_random_interleaving=true \
    --benchmark_out="$work/$bench.json" --benchmark_out_format=json > "$work/log" 2>&1 ||
    die "$bench failed: $(tail -1 "$work/log")"
done
python3 -B "$ROOT/tests/bench/table.py" "$work" "$json"
