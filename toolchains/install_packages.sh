#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs the Debian packages of toolchains/packages.txt that are missing.
#
#   toolchains/install_packages.sh [GROUP...]
#
# GROUP is one of: board laptop tests cross sshd. None given means the first four.
# With board, the single headers of group "headers" are unpacked into build/headers
# without installing their packages. Does nothing, and asks for nothing, where all
# are there already.
#
#   toolchains/install_packages.sh board        # what a build on the board needs
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

readonly GROUPS_KNOWN=(board laptop tests cross)
readonly HEADERS_DIR="$ROOT/build/headers"
# Of the packages of group "headers": all that is taken out of them.
readonly HEADERS=(ceres/tiny_solver.h)

# npm often comes with a Node.js that is not Debian's, and Debian's npm conflicts with that.
missing_packages() {
  local name
  for name in $(packages_in "$@"); do
    [[ $name != npm ]] || ! command -v npm > /dev/null || continue
    if [[ $(dpkg-query -W -f '${db:Status-Status}' "$name" 2> /dev/null) != installed ]]; then
      echo "$name"
    fi
  done
}

# have_headers: whether build/headers holds every one of HEADERS.
have_headers() {
  local header
  for header in "${HEADERS[@]}"; do
    [[ -s $HEADERS_DIR/$header ]] || return 1
  done
}

# download_packages DIR PACKAGE...: their .deb files, with apt's lists renewed
# where they are missing or name versions that the mirror no longer has.
download_packages() {
  local dir=$1
  shift
  if ! (cd "$dir" && apt-get download -q "$@" 2> /dev/null); then
    as_root apt-get update -q
    (cd "$dir" && apt-get download -q "$@")
  fi
}

unpack_headers() {
  local packages deb
  mapfile -t packages < <(packages_in headers)
  echo "Unpacking into build/headers: ${HEADERS[*]} (of ${packages[*]})"
  mkdir -p "$ROOT/build"
  work=$(mktemp -d "$HEADERS_DIR.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  chmod 755 "$work"
  mkdir "$work/debs" "$work/headers"
  download_packages "$work/debs" "${packages[@]}"
  for deb in "$work"/debs/*.deb; do
    dpkg-deb --fsys-tarfile "$deb" |
      tar -x -C "$work/headers" --strip-components=3 --no-same-owner \
        "${HEADERS[@]/#/./usr/include/}"
  done
  rm -rf "$HEADERS_DIR"
  mv "$work/headers" "$HEADERS_DIR"
}

main() {
  local groups=() missing group
  for group in "$@"; do
    case $group in
      -h | --help) print_help; return ;;
      board | laptop | tests | cross | sshd) groups+=("$group") ;;
      *) usage_error "unknown group '$group'" ;;
    esac
  done
  [[ ${#groups[@]} -gt 0 ]] || groups=("${GROUPS_KNOWN[@]}")
  command -v apt-get > /dev/null || die "apt-get not found: this needs Debian 12"

  if [[ " ${groups[*]} " == *" board "* ]] && ! have_headers; then
    unpack_headers
  fi
  mapfile -t missing < <(missing_packages "${groups[@]}")
  if [[ ${#missing[@]} -eq 0 ]]; then
    echo "Packages for ${groups[*]}: all there."
    return
  fi
  echo "Installing for ${groups[*]}: ${missing[*]}"
  as_root apt-get update -q
  as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -q --no-install-recommends "${missing[@]}"
}

main "$@"
