#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes Debian packages and a tarball out of a build.
#
#   toolchains/package.sh [PRESET...]
#
# PRESET  host-release, aarch64-release or armhf-release; default: those that are built
#
# Result, in build/packages: viewfixd_VERSION_ARCH.deb (daemon, unit, configuration,
# udev rule, user), viewfix_VERSION_ARCH.deb (the laptop's side, of host-release) and
# viewfixd-VERSION-ARCH.tar.gz, with an install.sh for boards without dpkg.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

readonly OUT=${VIEWFIX_PACKAGES:-$ROOT/build/packages}

build_folder() {
  if [[ $1 == host-release && -n ${VIEWFIX_HOST_BUILD:-} ]]; then
    echo "$VIEWFIX_HOST_BUILD"
  else
    echo "$ROOT/build/$1"
  fi
}

make_tarball() {
  local build=$1 deb=$2 version arch name stage
  version=$(dpkg-deb -f "$deb" Version)
  arch=$(dpkg-deb -f "$deb" Architecture)
  name=viewfixd-$version-$arch
  stage=$(mktemp -d "$OUT/stage.XXXXXX")
  trap 'rm -rf "$stage"' EXIT
  DESTDIR="$stage/$name" cmake --install "$build" --prefix /usr --component viewfixd --strip > /dev/null
  cp "$ROOT/platform/packaging/install.sh" "$stage/$name/"
  # The same bytes for the same files, whenever and by whomever.
  tar -C "$stage" -czf "$OUT/$name.tar.gz" --sort=name --owner=0 --group=0 --numeric-owner \
    --mtime=@0 "$name"
  rm -rf "$stage"
  trap - EXIT
  echo "$OUT/$name.tar.gz"
}

package() {
  local build deb work
  build=$(build_folder "$1")
  [[ -x $build/bin/viewfixd ]] || die "$build/bin/viewfixd is not built"
  work=$(mktemp -d "$OUT/cpack.XXXXXX")
  cmake "$build" > /dev/null
  if ! (cd "$build" && cpack -G DEB -B "$work" > "$work/log" 2>&1); then
    cat "$work/log" >&2
    rm -rf "$work"
    die "CPack failed"
  fi
  for deb in "$work"/*.deb; do
    mv "$deb" "$OUT/"
    echo "$OUT/$(basename "$deb")"
  done
  rm -rf "$work"
  make_tarball "$build" "$(ls -t "$OUT"/viewfixd_*.deb | head -n 1)"
}

main() {
  local presets=() preset
  for preset in "$@"; do
    case $preset in
      -h | --help) print_help; return ;;
      host-release | aarch64-release | armhf-release) presets+=("$preset") ;;
      *) usage_error "unknown preset '$preset'" ;;
    esac
  done
  if [[ ${#presets[@]} -eq 0 ]]; then
    for preset in host-release aarch64-release armhf-release; do
      [[ ! -x $(build_folder "$preset")/bin/viewfixd ]] || presets+=("$preset")
    done
  fi
  [[ ${#presets[@]} -gt 0 ]] || die "nothing is built: see toolchains/build.sh and tests/run.sh"
  mkdir -p "$OUT"
  for preset in "${presets[@]}"; do
    package "$preset"
  done
}

main "$@"
