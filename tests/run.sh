#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds, and runs every test that can run here.
#
#   tests/run.sh [--no-install] [--preset NAME]... [--real] [--soak]
#
# --no-install   do not install missing Debian packages
# --preset NAME  build and test this preset: host-release (the one if none is
#                named), host-debug (with sanitizers) or board; may be repeated
# --real         also run the long checks on real images, if there are any
# --soak         also replay for half an hour with sanitizers, and measure what slow
#                readers, ends and kills cost: on a machine with nothing else to do
#
# The builds for ARM and without the laptop's libraries are checked along with
# host-release. Real images are looked for in $VIEWFIX_DATA, else ../shared/data.
# Ends with what was skipped and why, and one line: "N passed, N failed, N skipped".
# Exit code: 0 if nothing failed, 1 if something did, 2 for wrong usage.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../toolchains/common.sh"

passed=0
failed=0
skipped=0
remarks=()

add_failure() {
  failed=$((failed + 1))
  remarks+=("FAILED   $1")
}

add_skip() {
  skipped=$((skipped + 1))
  remarks+=("skipped  $1: $2")
}

# check NAME COMMAND...: one check. Exit code 77 means skipped, for the reason
# in the command's last line.
check() {
  local name=$1 output status=0
  shift
  step "$name"
  output=$(mktemp "$ROOT/build/check.XXXXXX")
  "$@" 2>&1 | tee "$output" || status=${PIPESTATUS[0]}
  case $status in
    0) passed=$((passed + 1)) ;;
    77) add_skip "$name" "$(tail -n 1 "$output")" ;;
    *) add_failure "$name" ;;
  esac
  rm -f "$output"
}

# Adds the tests of one preset, each by itself, to the counts.
run_ctest() {
  local preset=$1 results="$ROOT/build/$1/ctest.xml" summary counts
  step "Tests of $preset"
  rm -f "$results"
  (cd "$ROOT" && ctest --preset "$preset" --parallel "$(nproc)" --no-tests=error \
    --output-junit "$results") || true
  if ! summary=$("$ROOT/tests/ctest_summary.py" "$results"); then
    add_failure "ctest of $preset: no results"
    return
  fi
  mapfile -t summary <<< "$summary"
  read -ra counts <<< "${summary[-1]}"
  unset 'summary[-1]'
  remarks+=("${summary[@]}")
  passed=$((passed + counts[0]))
  failed=$((failed + counts[1]))
  skipped=$((skipped + counts[2]))
}

build_and_test() {
  local preset=$1 failed_before=$failed
  check "Build of $preset" build_preset "$preset"
  if [[ $failed -eq $failed_before ]]; then
    run_ctest "$preset"
  else
    add_skip "tests of $preset" "it was not built"
  fi
}

# The board side must configure where the laptop's libraries are absent. That it compiles without
# them, the builds for ARM show: their sysroots have none.
configure_board_alone() {
  local package hidden=()
  for package in OpenCV Ceres COLMAP CLI11 nlohmann_json; do
    hidden+=("-DCMAKE_DISABLE_FIND_PACKAGE_$package=ON")
  done
  (cd "$ROOT" && cmake --preset board -B build/board-alone --fresh "${hidden[@]}")
}

# start_beside LOG COMMAND...: a command of one core's work, while other checks go on; its PID is $!.
start_beside() {
  local log=$1
  shift
  (status=0; "$@" > "$log" 2>&1 || status=$?; echo "$status" > "$log.status") &
}

# await LOG PID: the output and the exit code of what start_beside started, once it is done or dead.
await() {
  while kill -0 "$2" 2> /dev/null && [[ ! -s $1.status ]]; do sleep 1; done
  cat "$1"
  [[ -s $1.status ]] || return 1
  return "$(< "$1.status")"
}

# check_beside NAME COMMAND... -- NAME COMMAND...: two checks, the second while the first goes on.
check_beside() {
  local first=() log pid
  while [[ $1 != -- ]]; do first+=("$1"); shift; done
  shift
  log=$(mktemp "$ROOT/build/check.XXXXXX")
  start_beside "$log" "${@:2}"
  pid=$!
  check "${first[@]}"
  check "$1" await "$log" "$pid"
  rm -f "$log" "$log.status"
}

check_other_targets() {
  check "Board side without the laptop's libraries" configure_board_alone
  check "Static viewfixd for aarch64" "$ROOT/toolchains/build.sh" aarch64 --no-install
  check "Static viewfixd for armhf" "$ROOT/toolchains/build.sh" armhf --no-install
  check_beside "viewfixd on a virtual board" "$ROOT/tests/board/run.sh" -- \
    "The same fixes on ARM as here" "$ROOT/tests/toolchains/same_fixes.sh"
  check_beside "Flashes onto a virtual board" "$ROOT/tests/board/flash.sh" --cuts 3 -- \
    "Packages in a Debian root" "$ROOT/tests/toolchains/packages.sh"
}

check_real_images() {
  local data=${VIEWFIX_DATA:-$ROOT/../shared/data}
  if [[ ! -d $data ]]; then
    add_skip "real images" "no real image sets"
  elif [[ $1 -eq 0 ]]; then
    add_skip "long checks on real images" "only with --real"
  else
    check "Real images" env VIEWFIX_DATA="$data" "$ROOT/tests/real/run.sh"
  fi
}

replay_with_sanitizers() {
  build_preset host-debug viewfixd &&
    "$ROOT/tests/soak/soak.py" replay --viewfixd "$ROOT/build/host-debug/bin/viewfixd"
}

check_endurance() {
  check "Half an hour of replay with sanitizers" replay_with_sanitizers
  check "Slow readers, ends and kills" "$ROOT/tests/soak/soak.py" load
}

print_summary() {
  step "Summary"
  [[ ${#remarks[@]} -eq 0 ]] || printf '%s\n' "${remarks[@]}"
  echo "$passed passed, $failed failed, $skipped skipped"
}

main() {
  local install=1 real=0 soak=0 presets=() preset
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --no-install) install=0 ;;
      --real) real=1 ;;
      --soak) soak=1 ;;
      --preset)
        [[ ${2:-} =~ ^(host-release|host-debug|board)$ ]] ||
          usage_error "--preset takes host-release, host-debug or board"
        presets+=("$2")
        shift
        ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done
  [[ ${#presets[@]} -gt 0 ]] || presets=(host-release)

  if [[ $install -eq 1 ]]; then
    step "Packages"
    "$ROOT/toolchains/install_packages.sh"
  fi
  mkdir -p "$ROOT/build"
  for preset in "${presets[@]}"; do
    build_and_test "$preset"
  done
  if [[ " ${presets[*]} " == *" host-release "* ]]; then
    check_other_targets
    check_real_images "$real"
    [[ $soak -eq 0 ]] || check_endurance
  fi
  print_summary
  [[ $failed -eq 0 ]]
}

main "$@"
