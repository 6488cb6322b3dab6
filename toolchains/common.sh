# SPDX-License-Identifier: BSD-3-Clause
# Sourced by the project's scripts. Sets ROOT, the project's folder.
# shellcheck shell=bash

ROOT="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

die() {
  printf '%s: error: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

usage_error() {
  printf '%s: %s (see --help)\n' "$(basename "$0")" "$*" >&2
  exit 2
}

# Prints the caller's opening comment, which is its help text.
print_help() {
  awk 'NR <= 2 { next } /^#/ { sub(/^# ?/, ""); print; next } { exit }' "$0"
}

# The outermost script's start, for those that it calls.
export VIEWFIX_STARTED_S=${VIEWFIX_STARTED_S:-$EPOCHSECONDS}

# step TEXT: a heading with the time since the start.
step() {
  local elapsed_s=$((EPOCHSECONDS - VIEWFIX_STARTED_S))
  printf '\n==> [%2d:%02d] %s\n' $((elapsed_s / 60)) $((elapsed_s % 60)) "$*"
}

as_root() {
  if [[ $(id -u) -eq 0 ]]; then
    "$@"
  elif command -v sudo > /dev/null; then
    sudo "$@"
  else
    die "'$*' needs root: run it as root or install sudo"
  fi
}

# packages_in GROUP...: the packages of these groups in packages.txt.
packages_in() {
  awk -v groups=" $* " '
    { sub(/#.*/, "") }
    NF == 0 { next }
    $1 ~ /:$/ { wanted = index(groups, " " substr($1, 1, length($1) - 1) " "); next }
    wanted { print $1 }' "$ROOT/toolchains/packages.txt" | sort -u
}

# build_preset PRESET [TARGET...]: all of it if no target is named.
build_preset() {
  local preset=$1 targets=()
  shift
  [[ $# -eq 0 ]] || targets=(--target "$@")
  (cd "$ROOT" && cmake --preset "$preset" && cmake --build --preset "$preset" "${targets[@]}")
}
