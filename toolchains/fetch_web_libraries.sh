#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fetches the JavaScript libraries of viewfix's HTML pages by npm.
#
#   toolchains/fetch_web_libraries.sh
#
# Each of toolchains/web_libraries.txt, in its version and with its SHA-512 checked, goes to
# build/web/NAME-VERSION, @SCOPE/NAME to build/web/SCOPE-NAME-VERSION. Does nothing where all are there. CMake runs this when it configures;
# without them viewfix is built all the same, and cannot write pages.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

readonly WEB="$ROOT/build/web"

# file_name NAME VERSION: as npm calls the archive of a package.
file_name() {
  local name=${1#@}
  echo "${name//\//-}-$2"
}

# fetch NAME VERSION SHA512 FILE...
fetch() {
  local name=$1 version=$2 sha512=$3 file_name archive file
  shift 3
  file_name=$(file_name "$name" "$version")
  command -v npm > /dev/null || die "$name $version is missing: npm is not installed"
  mkdir -p "$WEB"
  work=$(mktemp -d "$WEB/$file_name.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  (cd "$work" && npm pack "$name@$version" --silent --fetch-retries 1 --fetch-timeout 30000 \
    > /dev/null) || die "$name $version is missing: npm could not fetch it"
  archive="$work/$file_name.tgz"
  sha512sum --check --status <<< "$sha512  $archive" ||
    die "$name $version: what npm fetched does not have the SHA-512 of toolchains/web_libraries.txt"
  mkdir "$work/files"
  for file in "$@"; do
    tar -xzf "$archive" -C "$work/files" --strip-components=1 --no-same-owner "package/$file"
  done
  chmod 755 "$work/files"
  rm -rf "${WEB:?}/$file_name"
  mv "$work/files" "$WEB/$file_name"
  rm -rf "$work"
}

# has_all FOLDER FILE...
has_all() {
  local folder=$1 file
  shift
  for file in "$@"; do
    [[ -f $folder/$file ]] || return 1
  done
}

main() {
  local name version sha512 files
  case ${1:-} in
    -h | --help) print_help; return ;;
    '') ;;
    *) usage_error "unknown argument '$1'" ;;
  esac
  while read -r name version sha512 files; do
    [[ -n $name && $name != '#'* ]] || continue
    # shellcheck disable=SC2086  # a list of files
    has_all "$WEB/$(file_name "$name" "$version")" $files || fetch "$name" "$version" "$sha512" $files
  done < "$ROOT/toolchains/web_libraries.txt"
}

main "$@"
