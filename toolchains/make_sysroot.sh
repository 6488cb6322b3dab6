#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Unpacks the headers and libraries of the ARM target to build against.
#
#   toolchains/make_sysroot.sh ARCH DEBIAN_ARCH        # aarch64 arm64
#
# Result: build/sysroots/ARCH, reused while the list of packages stays the same.
# Needs no root and runs no foreign code. Packages come from where this
# machine's own apt takes Debian's.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
source "$ROOT/toolchains/debian_sources.sh"

# A sysroot may lie anywhere, so no link in it may start at "/".
make_links_relative() {
  local root=$1 link target
  while IFS= read -r -d '' link; do
    target=$(readlink "$link")
    ln -sfn "$(realpath -ms --relative-to="$(dirname "$link")" "$root$target")" "$link"
  done < <(find "$root" -type l -lname '/*' -print0)
}

recipe() {
  echo "$SUITE $1"
  packages_in sysroot
}

# fetch DEBIAN_ARCH DIR ENDINGS: DIR/root.tar, from the suite and those with these endings.
fetch() {
  local debian_arch=$1 work=$2 sources=()
  copy_debian_sources "$work" "$3"
  if [[ ! -s $work/entries ]]; then
    as_root apt-get update -q
    copy_debian_sources "$work" "$3"
  fi
  [[ -s $work/entries ]] || die "apt's sources name no Debian $SUITE main: add it to /etc/apt"
  [[ ! -s $work/debian.list ]] || sources+=("$work/debian.list")
  [[ ! -s $work/debian.sources ]] || sources+=("$work/debian.sources")
  # "extract" runs nothing out of the packages, so chrootless is safe for root too.
  mmdebstrap --mode=chrootless --variant=extract --architectures="$debian_arch" \
    --aptopt="$work/apt.conf" --include="$(packages_in sysroot | paste -sd,)" \
    --format=tar "$SUITE" "$work/root.tar" "${sources[@]}" \
    2> >(grep -v 'chrootless mode as root might damage' >&2)
}

make_sysroot() {
  local debian_arch=$1 dir=$2 work=$3
  print_apt_options > "$work/apt.conf"
  echo "Fetching the $debian_arch packages of Debian $SUITE."
  # A mirror in the middle of its update often has all but one suite's index.
  if ! fetch "$debian_arch" "$work" '-updates|-security'; then
    echo "warning: trying again without $SUITE-security: what is built may lack its fixes" >&2
    fetch "$debian_arch" "$work" '-updates' ||
      die "mmdebstrap could not fetch the $debian_arch packages (see above)"
  fi
  mkdir "$work/root"
  tar -xf "$work/root.tar" -C "$work/root" --no-same-owner \
    --exclude='./usr/share/doc' --exclude='./usr/share/man' ./lib ./usr
  make_links_relative "$work/root"
  recipe "$debian_arch" > "$work/root/recipe"
  rm -rf "$dir"
  mv "$work/root" "$dir"
}

main() {
  if [[ ${1:-} == -h || ${1:-} == --help ]]; then
    print_help
    return
  fi
  [[ $# -eq 2 ]] || usage_error "expected ARCH DEBIAN_ARCH"
  local dir="$ROOT/build/sysroots/$1"
  if recipe "$2" | cmp -s - "$dir/recipe"; then
    echo "Sysroot: $dir is up to date."
    return
  fi
  mkdir -p "$ROOT/build/sysroots"
  work=$(mktemp -d "$dir.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  make_sysroot "$2" "$dir" "$work"
  echo "Sysroot: $dir made ($(du -sh "$dir" | cut -f1))."
}

main "$@"
