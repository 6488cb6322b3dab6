#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Flashes the virtual board over ssh, with its link cut half-way, and then with its
# power cut at random moments (flash_board.py): each time it has to come up and localize.
#
#   tests/board/flash.sh [--cuts N]
#
# --cuts N  how often the power fails (default 30; some 15 seconds each)
#
# Needs the builds host-release and aarch64-release, ssh, mke2fs and qemu-system-aarch64.
# Exit code 77: one of these is absent.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"

readonly HERE="$ROOT/tests/board"
readonly MACHINE="$ROOT/build/board-machine"
readonly WORK="$ROOT/build/board-flash-test"
readonly VIEWFIX="${VIEWFIX_HOST_BIN:-$ROOT/build/host-release/bin}/viewfix"
readonly VIEWFIXD="$ROOT/build/aarch64-release/bin/viewfixd"

check_needs() {
  local program
  for program in qemu-system-aarch64 ssh ssh-keygen mke2fs; do
    command -v "$program" > /dev/null || { echo "$program is not installed"; exit 77; }
  done
  for program in "$VIEWFIX" "$VIEWFIXD"; do
    [[ -x $program ]] || { echo "$program is not built"; exit 77; }
  done
}

# Two models of one museum, so that what answers a frame tells which one it was.
make_models() {
  step "A small museum and two models of it"
  "$VIEWFIX" simulate --out "$WORK/museum" --seed 1 --images-per-view 7
  for seed in 0 1; do
    "$VIEWFIX" train "$WORK/museum" --out "$WORK/$seed.vfx" --words 200 --max-features 800 \
      --seed "$seed"
  done
  "$VIEWFIX" keygen --out "$WORK/museum" --no-password
}

# A disk with a store that holds the first model and trusts the key.
make_disk() {
  mkdir -p "$WORK/disk"/{store,trust}
  "$VIEWFIX" provision --key "$WORK/museum.pub" --site museum --to "dir:$WORK/disk/store" \
    --trust "$WORK/disk/trust"
  "$VIEWFIX" sign "$WORK/1.vfx" --key "$WORK/museum.key" --site museum --version 1
  "$VIEWFIX" flash "$WORK/1.vfx" --to "dir:$WORK/disk/store" --trust "$WORK/disk/trust"
  chown -R 0:0 "$WORK/disk" 2> /dev/null || true
  mke2fs -q -t ext4 -d "$WORK/disk" "$WORK/disk.img" 64M
}

# ssh as it is, with a key and a configuration of the test's own.
make_ssh() {
  ssh-keygen -q -t ed25519 -N '' -f "$WORK/user"
  mkdir -p "$WORK/bin"
  cat > "$WORK/bin/ssh" << END
#!/bin/sh
exec $(command -v ssh) -F none -i '$WORK/user' -o StrictHostKeyChecking=no \\
  -o UserKnownHostsFile=/dev/null -o LogLevel=ERROR "\$@"
END
  chmod 755 "$WORK/bin/ssh"
}

# The pictures themselves: their list leads to the museum.
copy_pictures() {
  local picture number=0
  mkdir -p "$1"
  while IFS=, read -r picture _; do
    number=$((number + 1))
    cp "$WORK/frames/$picture" "$1/$number.jpg"
  done < <(tail -n +2 "$WORK/frames/images.csv")
}

pack() {
  local root=$WORK/root
  mkdir -p "$root"/{bin,lib,data,dev,proc,sys,run,modules,disk,etc/dropbear,root/.ssh}
  cp "$MACHINE/busybox" "$MACHINE"/sshd/bin/* "$VIEWFIXD" "$root/bin/"
  cp "$MACHINE"/sshd/lib/* "$root/lib/"
  ln -s busybox "$root/bin/sh"
  cp "$MACHINE"/disk-modules/*.ko "$root/modules/"
  echo 'root:*:0:0:root:/root:/bin/sh' > "$root/etc/passwd"
  echo 'root:*:0:' > "$root/etc/group"
  echo /bin/sh > "$root/etc/shells"
  cp "$WORK/user.pub" "$root/root/.ssh/authorized_keys"
  chmod 700 "$root/root" "$root/root/.ssh"
  chmod 600 "$root/root/.ssh/authorized_keys"
  python3 -B "$ROOT/firmware_tools/pick_frames.py" "$WORK/museum" "$WORK/frames" 2
  copy_pictures "$root/data/frames"
  install -m 755 "$HERE/guest_flash_init.sh" "$root/init"
  python3 -B "$HERE/pack_initramfs.py" "$root" "$WORK/initramfs.gz"
  cp "$MACHINE/vmlinuz" "$WORK/vmlinuz"
}

main() {
  local cuts=30
  while [[ $# -gt 0 ]]; do
    case $1 in
      -h | --help) print_help; return ;;
      --cuts)
        [[ ${2:-} =~ ^[1-9][0-9]*$ ]] || usage_error "--cuts takes a number"
        cuts=$2
        shift
        ;;
      *) usage_error "unknown argument '$1'" ;;
    esac
    shift
  done
  check_needs
  "$HERE/fetch_machine.sh" "$MACHINE" || { echo "the board's parts could not be fetched"; exit 77; }
  rm -rf "$WORK"
  mkdir -p "$WORK"
  make_models
  step "Disk, ssh and first program"
  make_disk
  make_ssh
  pack
  step "Flashes"
  python3 -B "$HERE/flash_board.py" "$WORK" --viewfix "$VIEWFIX" --cuts "$cuts"
}

main "$@"
