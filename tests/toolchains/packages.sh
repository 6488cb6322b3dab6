#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs, upgrades, removes and purges the packages of toolchains/package.sh in a
# Debian root, and the tarballs in another folder; looks into the laptop's package.
#
#   tests/toolchains/packages.sh
#
# The package of this machine's architecture runs there; those for ARM are installed
# into the same root and run under qemu-user from outside. Exit code 77: not root, or
# no mmdebstrap to make a root with.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly WORK="$ROOT/build/packages_test"
export VIEWFIX_PACKAGES="$WORK/packages"

skip() {
  echo "$1"
  exit 77
}

# The essential packages and what the daemon's own package depends on.
make_root() {
  local deb=$1 depends
  depends=$(dpkg-deb -f "$deb" Depends | sed 's/([^)]*)//g; s/ //g')
  mmdebstrap --variant=essential --include="$depends" bookworm "$WORK/root" > "$WORK/root.log" 2>&1 ||
    skip "mmdebstrap cannot make a Debian root: $(tail -n 1 "$WORK/root.log")"
}

in_root() { chroot "$WORK/root" "$@"; }

expect() {
  local what=$1
  shift
  "$@" > /dev/null 2>&1 || die "$what"
  echo "ok: $what"
}

# with_version DEB VERSION OUT: the same package, called newer.
with_version() {
  rm -rf "$WORK/repack"
  dpkg-deb -R "$1" "$WORK/repack"
  sed -i "s/^Version: .*/Version: $2/" "$WORK/repack/DEBIAN/control"
  dpkg-deb --root-owner-group -b "$WORK/repack" "$3" > /dev/null
}

check_installed() {
  expect "the user and group are there" in_root getent passwd viewfix
  expect "the store belongs to the group" \
    test "$(in_root stat -c '%U:%G %a' /var/lib/viewfix)" = 'viewfix:viewfix 2775'
  expect "the unit, the rule and the configuration are there" \
    ls "$WORK/root/usr/lib/systemd/system/viewfixd.service" \
    "$WORK/root/usr/lib/udev/rules.d/70-viewfix.rules" "$WORK/root/etc/viewfix"
  if command -v systemd-analyze > /dev/null; then
    # Outside of the root, which has no systemd: with a program that is there.
    sed 's#/usr/bin/viewfixd#/bin/true#' "$WORK/root/usr/lib/systemd/system/viewfixd.service" \
      > "$WORK/viewfixd.service"
    expect "systemd takes the unit" systemd-analyze verify "$WORK/viewfixd.service"
  fi
}

# install, change the configuration, upgrade, remove, install, purge: DEB PROGRAM...
walk_through() {
  local deb=$1 configuration
  shift
  local run=("$@")
  cp "$deb" "$WORK/root/package.deb"
  with_version "$deb" 99.0 "$WORK/root/newer.deb"
  expect "$(basename "$deb") installs" in_root dpkg --force-architecture -i /package.deb
  check_installed
  expect "the program runs" "${run[@]}" --version
  configuration=$(find "$WORK/root/etc/viewfix" -maxdepth 1 -type f | head -n 1)
  echo '# changed by the administrator' >> "$configuration"
  touch "$WORK/root/var/lib/viewfix/0123456789abcdef.vfx"
  expect "it is upgraded" in_root dpkg --force-architecture --force-confold -i /newer.deb
  expect "the changed configuration stays" grep -q 'changed by the' "$configuration"
  expect "the models stay" test -e "$WORK/root/var/lib/viewfix/0123456789abcdef.vfx"
  expect "it is removed" in_root dpkg -r viewfixd
  expect "the program is gone" test ! -e "$WORK/root/usr/bin/viewfixd"
  expect "the configuration is not" test -e "$configuration"
  expect "it is purged" in_root dpkg -P viewfixd
  expect "nothing is left" test ! -e "$WORK/root/etc/viewfix" -a ! -e "$WORK/root/var/lib/viewfix"
  if in_root getent passwd viewfix > /dev/null; then die "the user is left"; fi
}

# Of the libraries that are compiled into viewfix for its pages.
check_licences() {
  local deb=$1 contents library
  contents=$(dpkg-deb -c "$deb")
  for library in "$ROOT"/build/web/*/; do
    [[ -d $library ]] || continue
    expect "$(basename "$deb") has the licence of $(basename "$library")" \
      grep -q "share/doc/viewfix/LICENSE.$(basename "$library")$" <<< "$contents"
  done
}

check_tarball() {
  local tarball=$1 target="$WORK/target" folder
  rm -rf "$target" "$WORK/unpacked"
  mkdir -p "$target" "$WORK/unpacked"
  tar -xzf "$tarball" -C "$WORK/unpacked"
  folder=$(echo "$WORK"/unpacked/*)
  expect "$(basename "$tarball") installs" "$folder/install.sh" --root "$target"
  expect "the program is in its place" test -x "$target/usr/bin/viewfixd"
  echo '# changed' >> "$(find "$target/etc/viewfix" -type f | head -n 1)"
  expect "it installs again" "$folder/install.sh" --root "$target"
  expect "the changed configuration stays, the new one beside it" \
    test "$(find "$target/etc/viewfix" -name '*.new' | wc -l)" -eq 1
  expect "it is removed" "$folder/install.sh" --root "$target" --remove
  expect "the program is gone" test ! -e "$target/usr/bin/viewfixd"
}

main() {
  [[ ${1:-} != -h && ${1:-} != --help ]] || { print_help; return; }
  [[ $(id -u) -eq 0 ]] || skip "needs root for a chroot"
  command -v mmdebstrap > /dev/null || skip "mmdebstrap is not installed"
  rm -rf "$WORK"
  mkdir -p "$WORK"
  "$ROOT/toolchains/package.sh"
  local deb host
  host=$(dpkg --print-architecture)
  deb=$(ls "$VIEWFIX_PACKAGES"/viewfixd_*_"$host".deb)
  make_root "$deb"
  walk_through "$deb" chroot "$WORK/root" /usr/bin/viewfixd
  for deb in "$VIEWFIX_PACKAGES"/viewfixd_*_arm*.deb; do
    [[ -e $deb ]] || continue
    case $deb in
      *_arm64.deb) walk_through "$deb" qemu-aarch64-static "$WORK/root/usr/bin/viewfixd" ;;
      *_armhf.deb) walk_through "$deb" qemu-arm-static "$WORK/root/usr/bin/viewfixd" ;;
    esac
  done
  for deb in "$VIEWFIX_PACKAGES"/*.tar.gz; do check_tarball "$deb"; done
  for deb in "$VIEWFIX_PACKAGES"/viewfix_*.deb; do
    [[ ! -e $deb ]] || check_licences "$deb"
  done
  rm -rf "$WORK"
  echo "All packages install, upgrade, and leave nothing behind."
}

main "$@"
