#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Installs viewfixd from this unpacked tarball, for boards without dpkg.
#
#   ./install.sh [--root DIR] [--remove]
#
# --root DIR  into the root of another system, e.g. a mounted card (default: /)
# --remove    takes away what was installed; models, keys and configuration stay
#
# A configuration that is there already is kept: the new one comes beside it as
# *.new. Makes the user and group viewfix where the system has useradd or adduser.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=/
remove=0
while [ $# -gt 0 ]; do
  case $1 in
    --root) [ $# -ge 2 ] || { echo "install.sh: --root needs a folder" >&2; exit 2; }
            root=$2; shift ;;
    --remove) remove=1 ;;
    -h | --help) sed -n '3,12s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "install.sh: unknown argument '$1'" >&2; exit 2 ;;
  esac
  shift
done
[ -d "$root" ] || { echo "install.sh: $root: no such folder" >&2; exit 1; }
root=${root%/}

# Whole or not at all: beside its place, then renamed.
put() {
  mkdir -p "$(dirname "$2")"
  cp "$1" "$2.tmp-$$"
  mv -f "$2.tmp-$$" "$2"
}

if [ "$remove" = 1 ]; then
  (cd "$here" && find usr -type f) | while read -r file; do rm -f "$root/$file"; done
  echo "removed; $root/etc/viewfix and $root/var/lib/viewfix stay"
  exit 0
fi

(cd "$here" && find usr etc -type f) | while read -r file; do
  case $file in
    etc/*) if [ -e "$root/$file" ] && ! cmp -s "$here/$file" "$root/$file"; then
             put "$here/$file" "$root/$file.new"
             continue
           fi ;;
  esac
  put "$here/$file" "$root/$file"
done
mkdir -p "$root/etc/viewfix/trust" "$root/var/lib/viewfix"

# On the running system, by whatever it has; a Yocto or Buildroot image makes its users itself.
if [ -z "$root" ] && [ "$(id -u)" = 0 ]; then
  if ! grep -q '^viewfix:' /etc/group; then
    groupadd --system viewfix 2> /dev/null || addgroup -S viewfix 2> /dev/null || true
  fi
  if ! grep -q '^viewfix:' /etc/passwd; then
    useradd --system --gid viewfix --home-dir /var/lib/viewfix --no-create-home \
      --shell /usr/sbin/nologin viewfix 2> /dev/null ||
      adduser -S -D -H -h /var/lib/viewfix -s /bin/false -G viewfix viewfix 2> /dev/null || true
  fi
  if grep -q '^viewfix:' /etc/passwd; then chown viewfix:viewfix /var/lib/viewfix; fi
  chmod 2775 /var/lib/viewfix
fi
echo "installed: $root/usr/bin/viewfixd"
