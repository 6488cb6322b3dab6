#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The virtual board: an emulated 64-bit ARM machine with Debian's kernel boots, and
# the static viewfixd runs on its V4L2 devices: vivid for pixel formats and for every fault
# that it can inject, v4l2loopback for photographs whose fixes must be this machine's. A
# dynamic viewfixd, with libcamera, runs on vimc's sensor.
#
#   tests/board/run.sh [--set FOLDER --model FILE] [--cuts N]
#
# --set, --model  the photographs and a model without colours; default: a small museum, rendered
#                 and trained on the way
# --cuts N        cut the power N times at random moments, while models are installed (default 3)
#
# Needs the builds host-release and aarch64-release (made here if they are not there),
# qemu-system-aarch64 and the cross compiler. Exit code 77: one of these is absent.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly HERE="$ROOT/tests/board"
readonly MACHINE="$ROOT/build/board-machine"
readonly WORK="$ROOT/build/board-test"
readonly HOST_BIN="${VIEWFIX_HOST_BIN:-$ROOT/build/host-release/bin}"
readonly BOARD_BUILD="$ROOT/build/aarch64-release"
readonly DYNAMIC_BUILD="$ROOT/build/aarch64-dynamic"
readonly SYSROOT="$ROOT/build/sysroots/aarch64"
readonly IPA=/usr/lib/aarch64-linux-gnu/libcamera  # where libcamera looks for its modules
readonly FRAMES=6
readonly MAX_SECONDS=300
readonly MAX_START_SECONDS=90

skip() {
  echo "$*"
  exit 77
}

check_needs() {
  command -v qemu-system-aarch64 > /dev/null || skip "qemu-system-aarch64 is not installed"
  [[ -x $(PATH=$PATH:/usr/sbin command -v mke2fs) ]] || skip "mke2fs is not installed"
  command -v aarch64-linux-gnu-g++ > /dev/null || skip "aarch64-linux-gnu-g++ is not installed"
  [[ -x $HOST_BIN/viewfixd ]] || die "$HOST_BIN/viewfixd is not built"
}

build_programs() {
  step "Static viewfixd and board_tool"
  "$ROOT/toolchains/make_sysroot.sh" aarch64 arm64
  (cd "$ROOT" && cmake --preset aarch64-release -DVIEWFIX_BOARD_TOOL=ON > /dev/null &&
    cmake --build --preset aarch64-release --target viewfixd board_tool)
  step "Dynamic viewfixd, with libcamera (optimized little: it is here to open a camera)"
  (cd "$ROOT" && cmake --preset aarch64-release -B "$DYNAMIC_BUILD" -DVIEWFIX_STATIC=OFF \
    -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" > /dev/null &&
    cmake --build "$DYNAMIC_BUILD" --target viewfixd)
}

# copy_libraries PROGRAM FOLDER: what it asks for, and what that asks for, out of the sysroot.
copy_libraries() {
  local name file
  for name in $(aarch64-linux-gnu-readelf -d "$1" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
    [[ ! -e $2/$name ]] || continue
    file=$(find "$SYSROOT/lib" "$SYSROOT/usr/lib" -name "$name" | head -n 1)
    [[ -n $file ]] || die "$1 asks for $name, which the sysroot does not have"
    cp -L "$file" "$2/$name"
    copy_libraries "$file" "$2"
  done
}

# The dynamic program with its libraries, vimc and libcamera's module for it.
pack_libcamera() {
  local root=$1
  mkdir -p "$root/lib" "$root$IPA"
  cp "$DYNAMIC_BUILD/bin/viewfixd" "$root/bin/viewfixd-dynamic"
  cp "$SYSROOT$IPA"/ipa_vimc.so* "$root$IPA/"
  cp "$MACHINE/vimc.ko" "$root/"
  copy_libraries "$root/bin/viewfixd-dynamic" "$root/lib"
  copy_libraries "$root$IPA/ipa_vimc.so" "$root/lib"
}

make_museum() {
  step "A small museum"
  set=$WORK/museum
  model=$WORK/museum.vfx
  "$HOST_BIN/viewfix" simulate --out "$set" --seed 1 --images-per-view 7
  # Without colours, as the loopback's frames are; as few features as an emulated processor has
  # time for.
  "$HOST_BIN/viewfix" train "$set" --out "$model" --words 200 --features surf --max-features 800
}

# Pictures of the set's test frames, and beside them one that shows nothing.
pick_frames() {
  local picture name number=0
  python3 -B "$ROOT/firmware_tools/pick_frames.py" "$set" "$WORK/frames" "$FRAMES"
  mkdir -p "$WORK/data/frames" "$WORK/expected"
  echo path > "$WORK/expected/images.csv"
  while IFS= read -r picture; do
    number=$((number + 1))
    name=$(printf %02d "$number").jpg
    cp "$WORK/frames/$picture" "$WORK/data/frames/$name"
    cp "$WORK/frames/$picture" "$WORK/expected/$name"
    printf 'plain.jpg\n%s\n' "$name" >> "$WORK/expected/images.csv"
  done < <(python3 -c 'import csv, sys
for row in csv.DictReader(open(sys.argv[1], newline="")): print(row["path"])' "$WORK/frames/images.csv")
  python3 -B "$HERE/plain_jpeg.py" "$WORK/data/frames/01.jpg" "$WORK/expected/plain.jpg"
}

# What this machine says of the same frames, each after one that shows nothing.
expect_fixes() {
  "$HOST_BIN/viewfixd" --model "$model" --camera "replay:$WORK/expected" --filter off |
    awk 'NR % 2 == 0' > "$WORK/expected.jsonl"
}

pack() {
  local root=$WORK/root
  mkdir -p "$root"/{bin,data,dev,proc,sys,run,modules}
  cp "$MACHINE/busybox" "$root/bin/"
  ln -s busybox "$root/bin/sh"
  cp "$MACHINE"/modules/*.ko "$root/modules/"
  cp "$BOARD_BUILD/bin/viewfixd" "$BOARD_BUILD/bin/board_tool" "$root/bin/"
  cp "$model" "$root/data/site.vfx"
  cp -r "$WORK/data/frames" "$root/data/"
  mkdir -p "$root/disk"
  pack_libcamera "$root"
  install -m 755 "$HERE/guest_init.sh" "$root/init"
  python3 -B "$HERE/pack_initramfs.py" "$root" "$WORK/initramfs.gz"
}

readonly MACHINE_OPTIONS=(-M virt -cpu cortex-a72 -accel tcg,thread=multi -smp 2 -m 512 -nographic
  -no-reboot -nodefaults -kernel "$MACHINE/vmlinuz" -initrd "$WORK/initramfs.gz")
readonly KERNEL_OPTIONS="console=ttyAMA0 quiet panic=-1"

boot() {
  timeout "$MAX_SECONDS" qemu-system-aarch64 "${MACHINE_OPTIONS[@]}" -serial stdio \
    -append "$KERNEL_OPTIONS" < /dev/null | tr -d '\r' |
    tee "$WORK/serial.log" | grep --line-buffered -E '^(PASS|FAIL|FIGURE|BOARD)' || true
}

# section NAME: what stands between its marks.
section() {
  sed -n "/^BEGIN $1\$/,/^END $1\$/p" "$WORK/serial.log" | sed '1d;$d'
}

judge() {
  local failed
  section fixes > "$WORK/actual.jsonl"
  section log > "$WORK/viewfixd.log"
  failed=$(grep -c '^FAIL' "$WORK/serial.log" || true)
  if ! grep -q '^BOARD DONE' "$WORK/serial.log"; then
    tail -n 20 "$WORK/serial.log"
    die "the board did not come to its end in $MAX_SECONDS s"
  fi
  python3 -B "$HERE/compare_photographs.py" "$WORK/expected.jsonl" "$WORK/actual.jsonl" "$FRAMES" ||
    failed=$((failed + 1))
  [[ $failed -eq 0 ]] || die "$failed things failed; see $WORK"
  echo "The virtual board: $(grep -c '^PASS' "$WORK/serial.log") things passed."
}

# A disk with a store of one model, another model to be installed over it, and a socket's place.
make_disk() {
  local root=$WORK/disk store=(--store "$WORK/disk/store" --trust "$WORK/disk/trust")
  mkdir -p "$root/models" "$root/trust"
  touch "$root/trust/development"
  cp "$model" "$root/models/a.vfx"
  "$HOST_BIN/viewfix" train "$set" --out "$root/models/b.vfx" --words 100 --max-features 800 \
    > /dev/null
  "$HOST_BIN/viewfixd" store install "$root/models/a.vfx" "${store[@]}"
  PATH=$PATH:/usr/sbin mke2fs -q -t ext4 -d "$root" "$WORK/disk.img" 64M
}

# Starts from the disk; once fixes are served, the power goes within eight seconds.
cut_once() {
  local log=$WORK/cut.log machine ended=$((SECONDS + MAX_START_SECONDS)) up=1
  : > "$log"
  qemu-system-aarch64 "${MACHINE_OPTIONS[@]}" -serial "file:$log" \
    -drive "file=$WORK/disk.img,format=raw,if=none,id=disk" -device virtio-blk-device,drive=disk \
    -append "$KERNEL_OPTIONS power_cuts" < /dev/null &
  machine=$!
  while [[ $SECONDS -lt $ended ]] && ! grep -q '^UP' "$log"; do
    sleep 0.2
  done
  grep -q '^UP' "$log" || up=0
  sleep "$((RANDOM % 8)).$((RANDOM % 10))"
  kill -9 "$machine"
  wait "$machine" 2> /dev/null || true
  grep -E '^(UP|INSTALLED)' "$log" | tr -d '\r' | paste -sd ' ' || true
  [[ $up -eq 1 ]] || { tail -n 20 "$log"; die "the board does not start after a power cut"; }
}

cut_power() {
  local number
  [[ $1 -gt 0 ]] || return 0
  step "Power cuts"
  make_disk
  for ((number = 0; number <= $1; number++)); do
    cut_once
  done
  echo "The board started and served after each of $1 power cuts."
}

main() {
  local cuts=3
  set='' model=''
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --set) set=$(realpath "$2"); shift ;;
      --model) model=$(realpath "$2"); shift ;;
      --cuts) cuts=$2; shift ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done
  check_needs
  "$HERE/fetch_machine.sh" "$MACHINE" || skip "the kernel and its modules could not be fetched"
  build_programs
  rm -rf "$WORK"
  mkdir -p "$WORK"
  [[ -n $model ]] || make_museum
  step "Boot"
  pick_frames
  expect_fixes
  pack
  boot
  judge
  cut_power "$cuts"
}

main "$@"
