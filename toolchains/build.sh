#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds a static, stripped viewfixd for an ARM board.
#
#   toolchains/build.sh ARCH [--no-install]
#
# ARCH          aarch64 (64-bit ARM, e.g. Raspberry Pi 3 and later) or
#               armhf (32-bit ARMv7 with floating-point unit, e.g. Raspberry Pi 2)
# --no-install  do not install missing Debian packages
#
# Result: build/ARCH-release/bin/viewfixd. Copy it to the board; it needs no
# other file there. The first run makes a sysroot in build/sysroots.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

readonly MAX_BYTES=4000000

# Debian's name of it.
debian_arch_of() {
  case $1 in
    aarch64) echo arm64 ;;
    *) echo "$1" ;;
  esac
}

check_program() {
  local program=$1 description bytes
  [[ -x $program ]] || die "$program was not built"
  description=$(file -b "$program")
  [[ $description == *"statically linked"* ]] || die "$program is not static: $description"
  [[ $description == *", stripped"* ]] || die "$program is not stripped: $description"
  bytes=$(stat -c %s "$program")
  [[ $bytes -le $MAX_BYTES ]] || die "$program has $bytes bytes, more than $MAX_BYTES"
  echo "$program: $bytes bytes (at most $MAX_BYTES), static, stripped"
}

main() {
  local arch='' install=1 arg
  for arg in "$@"; do
    case $arg in
      -h | --help) print_help; return ;;
      --no-install) install=0 ;;
      aarch64 | armhf) arch=$arg ;;
      *) usage_error "unknown argument '$arg'" ;;
    esac
  done
  [[ -n $arch ]] || usage_error "which ARCH? aarch64 or armhf"

  if [[ $install -eq 1 ]]; then
    step "Packages"
    "$ROOT/toolchains/install_packages.sh" board cross
  fi
  step "Sysroot"
  "$ROOT/toolchains/make_sysroot.sh" "$arch" "$(debian_arch_of "$arch")"
  step "Build for $arch"
  build_preset "$arch-release" viewfixd
  check_program "$ROOT/build/$arch-release/bin/viewfixd"
}

main "$@"
