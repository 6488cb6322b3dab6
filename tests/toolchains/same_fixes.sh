#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs viewfixd for this machine, for aarch64 and for armhf (under qemu-user) over
# the same frames and compares their fixes to the last digit, times aside.
#
#   tests/toolchains/same_fixes.sh [--frames N | --full] [ARCH...]
#
# ARCH        aarch64, cortex-a53 (aarch64 on a processor without dot products of bytes) or
#             armhf; default: all three
# --frames N  so many test images of each set, evenly spread (default 12)
# --full      all test images: the museum's, and those of the real image sets in
#             $VIEWFIX_DATA, else ../shared/data; about a second a frame. It takes an hour
#
# The museum is compared always, with a map, and without one, where features have colours and
# details decide (8 frames); real photographs with --full or --frames. Only --full has
# the museum whole, else a third of its photographs and fewer words do. On each
# build the models go through the store too, which has them answer their golden
# queries. Needs the builds host-release and ARCH-release. Prints a table; exit
# code 77: qemu is absent.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly HOST_BIN=${VIEWFIX_HOST_BIN:-$ROOT/build/host-release/bin}
readonly DATA=${VIEWFIX_DATA:-$ROOT/../shared/data}
readonly WORK="$ROOT/build/same_fixes"
archs=()
rows=()

board_program() { echo "$ROOT/build/${1/cortex-a53/aarch64}-release/bin/viewfixd"; }

qemu_of() {
  case $1 in
    aarch64 | cortex-a53) echo qemu-aarch64-static ;;
    armhf) echo qemu-arm-static ;;
  esac
}

# run_on ARCH ARGUMENT...: the board's viewfixd.
run_on() {
  local arch=$1 cpu=max
  shift
  [[ $arch != cortex-a53 ]] || cpu=$arch
  "$(qemu_of "$arch")" -cpu "$cpu" "$(board_program "$arch")" "$@"
}

# try_model ARCH MODEL: through this build's store, unsigned, as in development.
try_model() {
  local store
  store=$(mktemp -d "$WORK/store.XXXXXX")
  mkdir "$store/trust"
  touch "$store/trust/development"
  run_on "$1" store install "$2" --store "$store" --trust "$store/trust" > /dev/null
  rm -rf "$store"
}

# compare_set NAME SET MODEL FRAMES: FRAMES empty: all.
compare_set() {
  local name=$1 set=$2 model=$3 frames=$4 arch count row
  # shellcheck disable=SC2086  # an empty count is no argument
  python3 -B "$ROOT/firmware_tools/pick_frames.py" "$set" "$WORK/$name-frames" $frames
  count=$(($(wc -l < "$WORK/$name-frames/images.csv") - 1))
  local arguments=(--model "$model" --camera "replay:$WORK/$name-frames")
  "$HOST_BIN/viewfixd" "${arguments[@]}" > "$WORK/$name-host.jsonl"
  row=$(printf '%-10s %6d' "$name" "$count")
  for arch in "${archs[@]}"; do
    run_on "$arch" "${arguments[@]}" > "$WORK/$name-$arch.jsonl"
    python3 -B "$ROOT/tests/toolchains/compare_fixes.py" \
      "$WORK/$name-host.jsonl" "$WORK/$name-$arch.jsonl" "$count" ||
      die "$name: $arch gives other fixes than this machine"
    try_model "$arch" "$model"
    row+=$(printf ' %10s' "$count")
  done
  rows+=("$row")
}

train() {
  local set=$1 out=$2
  shift 2
  echo "Training on $set"
  "$HOST_BIN/viewfix" train "$set" --out "$out" "$@" 2> "$out.log" ||
    die "training failed: $(tail -n 1 "$out.log")"
}

print_table() {
  echo
  echo "Fixes identical to this machine's ($(uname -m)), every digit, times aside:"
  printf '%-10s %6s' set frames
  printf ' %10s' "${archs[@]}"
  printf '\n'
  printf '%s\n' "${rows[@]}"
}

main() {
  local frames=12 real=0 arch name
  local small_museum=(--images-per-view 7) small_model=(--words 200 --max-features 800)
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --full) frames='' real=1 small_museum=() small_model=() ;;
      --frames)
        [[ ${2:-} =~ ^[1-9][0-9]*$ ]] || usage_error "--frames takes a number"
        frames=$2 real=1
        shift
        ;;
      aarch64 | cortex-a53 | armhf) archs+=("$1") ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done
  [[ ${#archs[@]} -gt 0 ]] || archs=(aarch64 cortex-a53 armhf)
  for name in viewfix viewfixd; do
    [[ -x $HOST_BIN/$name ]] || die "$HOST_BIN/$name is not built"
  done
  for arch in "${archs[@]}"; do
    [[ -x $(board_program "$arch") ]] || die "$(board_program "$arch") is not built"
    if ! command -v "$(qemu_of "$arch")" > /dev/null; then
      echo "$(qemu_of "$arch") is not installed"
      exit 77
    fi
  done

  rm -rf "$WORK"
  mkdir -p "$WORK"
  "$HOST_BIN/viewfix" simulate --out "$WORK/museum" --seed 1 "${small_museum[@]}"
  train "$WORK/museum" "$WORK/museum.vfx" "${small_model[@]}"
  compare_set museum "$WORK/museum" "$WORK/museum.vfx" "$frames"
  train "$WORK/museum" "$WORK/colours.vfx" --map none "${small_model[@]}"
  compare_set colours "$WORK/museum" "$WORK/colours.vfx" "${frames:+8}"
  if [[ $real -eq 1 && -d $DATA/hololens ]]; then
    train "$DATA/hololens" "$WORK/hololens.vfx"
    compare_set hololens "$DATA/hololens" "$WORK/hololens.vfx" "$frames"
  fi
  if [[ $real -eq 1 && -d $DATA/ie_tower ]]; then
    train "$DATA/ie_tower" "$WORK/ie_tower.vfx"
    compare_set ie_tower "$DATA/ie_tower" "$WORK/ie_tower.vfx" "$frames"
  fi
  print_table
}

main "$@"
