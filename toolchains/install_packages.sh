#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs the Debian packages of toolchains/packages.txt that are missing.
#
#   toolchains/install_packages.sh [GROUP...]
#
# GROUP is one of: board laptop tests cross. None given means all four.
# Does nothing, and asks for nothing, where all are there already.
#
#   toolchains/install_packages.sh board        # what a build on the board needs
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

readonly GROUPS_KNOWN=(board laptop tests cross)

missing_packages() {
  local name
  for name in $(packages_in "$@"); do
    if [[ $(dpkg-query -W -f '${db:Status-Status}' "$name" 2> /dev/null) != installed ]]; then
      echo "$name"
    fi
  done
}

main() {
  local groups=() missing group
  for group in "$@"; do
    case $group in
      -h | --help) print_help; return ;;
      board | laptop | tests | cross) groups+=("$group") ;;
      *) usage_error "unknown group '$group'" ;;
    esac
  done
  [[ ${#groups[@]} -gt 0 ]] || groups=("${GROUPS_KNOWN[@]}")
  command -v apt-get > /dev/null || die "apt-get not found: this needs Debian 12"

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
