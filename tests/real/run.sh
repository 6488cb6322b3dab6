#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Trains and evaluates on real photographs and holds the figures against floors.
#
#   tests/real/run.sh [--words N]
#
# Looks for the image sets in $VIEWFIX_DATA, else ../shared/data; exits with 77
# (skipped) where there are none. Needs build/host-release. Models, logs and
# figures are left in build/real. --words: vocabulary for the IE Tower set
# (default 2000, the chosen configuration).
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

DATA=${VIEWFIX_DATA:-$ROOT/../shared/data}
OUT=$ROOT/build/real
VIEWFIX=$ROOT/build/host-release/bin/viewfix

# train_and_eval SET NAME [TRAIN OPTIONS]: OUT/NAME.vfx and OUT/NAME.json.
train_and_eval() {
  local set=$DATA/$1 name=$2
  shift 2
  "$VIEWFIX" train "$set" --out "$OUT/$name.vfx" "$@"
  "$VIEWFIX" eval "$set" --model "$OUT/$name.vfx" --json "$OUT/$name.json"
}

# compare NAME JSON_PATH least|most LIMIT: fails the script where a figure is beyond it.
compare() {
  python3 - "$OUT/$1.json" "$2" "$3" "$4" <<'PY'
import json, sys
path, keys, way, limit = sys.argv[1:]
value = json.load(open(path))
while keys:  # names hold dots themselves: the longest that there is
    parts = keys.split(".")
    for n in range(len(parts), 0, -1):
        key = ".".join(parts[:n])
        if isinstance(value, list) or key in value:
            break
    value = value[int(key)] if isinstance(value, list) else value[key]
    keys = ".".join(parts[n:])
print(f"{sys.argv[2]} = {value:.6g}, at {way} {limit} wanted")
sys.exit(value < float(limit) if way == "least" else value > float(limit))
PY
}
at_least() { compare "$1" "$2" least "$3"; }
at_most() { compare "$1" "$2" most "$3"; }

check_hololens() {
  step "hololens: locations and views from poses; the same bytes twice"
  train_and_eval hololens hololens
  "$VIEWFIX" train "$DATA/hololens" --out "$OUT/hololens-again.vfx" --jobs 3 > "$OUT/again.log" 2>&1
  cmp "$OUT/hololens.vfx" "$OUT/hololens-again.vfx"
  at_least hololens retrieval.within_1m_30deg 0.95
  at_least hololens pose.recall.0.05m_5deg 0.96
  at_most hololens model_bytes 3000000
}

check_ie_tower() {
  step "ie_tower, $1 words"
  train_and_eval ie_tower "ie_tower-$1" --words "$1" --work "$OUT/work"
  if [[ $1 -eq 2000 ]]; then
    at_least "ie_tower-$1" location.by_level.0 0.89
    at_least "ie_tower-$1" location.accuracy 0.89
    at_least "ie_tower-$1" refusal.answered 0.77
    at_most "ie_tower-$1" refusal.wrong_of_answered 0.02
    at_most "ie_tower-$1" model_bytes 8000000
  fi
}

# Few answers are wrong where there are no details to tell look-alikes apart, too.
check_scores_alone() {
  step "ie_tower, $1 words, by scores alone"
  train_and_eval ie_tower "ie_tower-$1-scores" --words "$1" --details 0 --work "$OUT/work"
  if [[ $1 -eq 2000 ]]; then
    at_least "ie_tower-$1-scores" refusal.answered 0.4
    at_most "ie_tower-$1-scores" refusal.wrong_of_answered 0.06
  fi
}

main() {
  local words=2000
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --words) words=${2:?}; shift ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done
  if [[ ! -d $DATA/hololens || ! -d $DATA/ie_tower ]]; then
    echo "no real image sets"
    exit 77
  fi
  mkdir -p "$OUT"
  rm -rf "$OUT/work"  # of one run alone
  check_hololens
  check_ie_tower "$words"
  check_scores_alone "$words"
}

main "$@"
