#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The main job, end to end, with no photographs needed: renders the built-in
# museum, checks it, trains a model, evaluates it and replays the test frames
# through viewfixd.
#
#   firmware_tools/demo.sh [--no-install] [--seed N]
#
# --no-install  do not install missing Debian packages
# --seed N      another building (default 1)
#
# Everything goes to build/demo, which is made anew by each run.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../toolchains/common.sh"

readonly BIN="$ROOT/build/host-release/bin"
readonly DEMO="$ROOT/build/demo"

build_programs() {
  local log="$ROOT/build/demo-build.log"
  mkdir -p "$ROOT/build"
  if ! build_preset host-release viewfix viewfixd > "$log" 2>&1; then
    tail -n 40 "$log" >&2
    die "the build failed: all of it is in $log"
  fi
}

# Without them, viewfix is built all the same.
has_page_libraries() {
  "$ROOT/toolchains/fetch_web_libraries.sh" 2> /dev/null
}

print_summary() {
  python3 - "$DEMO" << 'END'
import collections, json, pathlib, sys
demo = pathlib.Path(sys.argv[1])
result = json.loads((demo / 'eval.json').read_text())
fixes = [json.loads(line) for line in (demo / 'fixes.jsonl').read_text().splitlines()]
states = collections.Counter(fix['state'] for fix in fixes)
print(f"Test images        {result['images']}")
print(f"Location right     {100 * result['location']['accuracy']:.1f} %")
print(f"View right         {100 * result['view']['accuracy']:.1f} %")
print(f"Time for a frame   {result['latency_ms']['p50']:.1f} ms (median)")
print(f"Model              {result['model_bytes'] / 1e6:.2f} MB")
print(f"Fixes of viewfixd  {len(fixes)} ("
      + ', '.join(f'{count} {state}' for state, count in states.most_common()) + ')')
END
}

main() {
  local install=1 seed=1
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --no-install) install=0 ;;
      --seed)
        [[ ${2:-} =~ ^[0-9]+$ ]] || usage_error "--seed takes a number"
        seed=$2
        shift
        ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done

  if [[ $install -eq 1 ]]; then
    step "Packages"
    "$ROOT/toolchains/install_packages.sh" board laptop tests
  fi
  step "Build (the first time takes some minutes)"
  build_programs

  rm -rf "$DEMO"
  mkdir -p "$DEMO"
  step "Render the museum"
  "$BIN/viewfix" simulate --out "$DEMO/museum" --seed "$seed"
  step "Check the photographs"
  "$BIN/viewfix" check "$DEMO/museum" | tee "$DEMO/check.txt"
  step "Train a model"
  "$BIN/viewfix" train "$DEMO/museum" --out "$DEMO/museum.vfx"
  step "Evaluate it on the test images"
  local pages=()
  if has_page_libraries; then
    pages=(--report "$DEMO/report.html" --map "$DEMO/map.html")
  fi
  "$BIN/viewfix" eval "$DEMO/museum" --model "$DEMO/museum.vfx" --json "$DEMO/eval.json" \
    "${pages[@]}" | tee "$DEMO/eval.txt"
  step "What is in the model"
  "$BIN/viewfix" inspect "$DEMO/museum.vfx" | tee "$DEMO/inspect.txt"
  step "Replay the test images through viewfixd"
  python3 -B "$ROOT/firmware_tools/pick_frames.py" "$DEMO/museum" "$DEMO/replay"
  # Photographs from here and there, no stream: each is judged alone.
  "$BIN/viewfixd" --model "$DEMO/museum.vfx" --camera "replay:$DEMO/replay" --filter off \
    --publish stdout > "$DEMO/fixes.jsonl"
  step "Summary"
  print_summary | tee "$DEMO/summary.txt"
  cat << END

  photographs  build/demo/museum
  model        build/demo/museum.vfx
  evaluation   build/demo/eval.json
  fixes        build/demo/fixes.jsonl
  summary      build/demo/summary.txt
END
  if [[ ${#pages[@]} -gt 0 ]]; then
    echo '  report       build/demo/report.html (in a browser)'
    echo '  map in 3D    build/demo/map.html'
  else
    echo "  no report.html: npm could not fetch what it is drawn with (build/demo-build.log)"
  fi
}

main "$@"
