#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Counts the instructions that viewfixd's aarch64 build takes from a photograph to its fix, JPEG
# decoding included, under qemu-user.
#
#   tests/bench/arm_instructions.sh MODEL PHOTOGRAPH [PROCESSOR]
#
# PROCESSOR  as qemu calls it (default: cortex-a53; max: one with dot products of bytes)
#
# A replay of the photograph three times, less one of it once, halved. Needs the build
# aarch64-release. Takes minutes: qemu logs every block of instructions that it runs.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly VIEWFIXD=$ROOT/build/aarch64-release/bin/viewfixd

# count MODEL PHOTOGRAPH PROCESSOR TIMES: instructions of the whole process. A block's log begins
# with its instructions, a line each; each time it runs a line names its address.
count() {
  local times list
  list=$(mktemp --suffix=.txt)
  for ((times = 0; times < $4; ++times)); do realpath "$2"; done > "$list"
  # The log goes through a pipe: it has gigabytes.
  qemu-aarch64-static -cpu "$3" -d in_asm,exec,nochain -D >(awk '
    /^IN:/ { first = 1; next }
    /^0x/ {
      if (first) { block = substr($1, 1, length($1) - 1); sub(/^0x0*/, "", block); size[block] = 0 }
      first = 0
      ++size[block]
      next
    }
    /^Trace/ {
      split(substr($0, index($0, "[") + 1), part, "/")
      sub(/^0*/, "", part[2])
      total += size[part[2]]
    }
    END { printf "%.0f\n", total }' > "$list.count") \
    "$VIEWFIXD" --model "$1" --camera "replay:$list" > "$list.fixes"
  grep -q '"state":"localized"' "$list.fixes" || die "$2 is not localized"
  # The sum comes when awk has read the end of the log.
  for ((times = 0; times < 100; ++times)); do
    [[ ! -s $list.count ]] || break
    sleep 0.1
  done
  [[ -s $list.count ]] || die "qemu's log was not counted"
  cat "$list.count"
  rm -f "$list" "$list.count" "$list.fixes"
}

main() {
  if [[ ${1:-} == -h || ${1:-} == --help ]]; then
    print_help
    return
  fi
  [[ $# -eq 2 || $# -eq 3 ]] || usage_error "which MODEL, and which PHOTOGRAPH?"
  local processor=${3:-cortex-a53} once thrice
  [[ -x $VIEWFIXD ]] || die "$VIEWFIXD is not built: run toolchains/build.sh aarch64"
  command -v qemu-aarch64-static > /dev/null ||
    die "qemu-aarch64-static is absent: run toolchains/install_packages.sh cross"
  once=$(count "$1" "$2" "$processor" 1)
  thrice=$(count "$1" "$2" "$processor" 3)
  awk -v once="$once" -v thrice="$thrice" -v processor="$processor" 'BEGIN {
    printf "%s: %.1f million instructions a frame; reading the model and the rest, once: %.1f\n",
      processor, (thrice - once) / 2e6, (3 * once - thrice) / 2e6 }'
}

main "$@"
