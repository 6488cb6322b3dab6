#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs viewfixd for this machine and for aarch64 (under qemu-user) over twenty
# frames of the museum and compares their fixes, times aside.
#
#   tests/toolchains/aarch64_same_json.sh
#
# Needs the builds host-release and aarch64-release. Exit code 77: qemu is absent.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly FRAMES=20
readonly HOST_BIN="$ROOT/build/host-release/bin"
readonly BOARD_BIN="$ROOT/build/aarch64-release/bin"

main() {
  [[ ${1:-} != -h && ${1:-} != --help ]] || { print_help; return; }
  local program work
  for program in "$HOST_BIN/viewfix" "$HOST_BIN/viewfixd" "$BOARD_BIN/viewfixd"; do
    [[ -x $program ]] || die "$program is not built"
  done
  if ! command -v qemu-aarch64-static > /dev/null; then
    echo "qemu-aarch64-static is not installed"
    exit 77
  fi

  work="$ROOT/build/aarch64_same_json"
  rm -rf "$work"
  mkdir -p "$work"
  "$HOST_BIN/viewfix" simulate --out "$work/museum" --seed 1 --images-per-view 7
  "$HOST_BIN/viewfix" train "$work/museum" --out "$work/museum.vfx" --words 200
  python3 -B "$ROOT/firmware_tools/pick_frames.py" "$work/museum" "$work/frames" "$FRAMES"

  local arguments=(--model "$work/museum.vfx" --camera "replay:$work/frames" --publish stdout)
  "$HOST_BIN/viewfixd" "${arguments[@]}" > "$work/host.jsonl"
  qemu-aarch64-static "$BOARD_BIN/viewfixd" "${arguments[@]}" > "$work/aarch64.jsonl"
  python3 -B "$ROOT/tests/toolchains/compare_fixes.py" \
    "$work/host.jsonl" "$work/aarch64.jsonl" "$FRAMES"
}

main "$@"
