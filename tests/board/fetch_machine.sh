#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fetches what the virtual board is made of: Debian's arm64 kernel, vivid and what
# it needs, a busybox, and v4l2loopback and vimc built against that kernel.
#
#   tests/board/fetch_machine.sh DIR
#
# For flashes: an ssh server (dropbear, with its libraries), and a disk's and a network's
# drivers.
#
# Leaves DIR/vmlinuz, DIR/busybox, DIR/sshd (a root folder) and, in loading order,
# DIR/modules/NN-NAME.ko and DIR/disk-modules/NN-NAME.ko, and DIR/vimc.ko, which needs those
# of vivid. Installs nothing, needs no root.
# Does nothing where DIR is complete already.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../toolchains/common.sh"
source "$ROOT/toolchains/debian_sources.sh"

# In loading order; those that the kernel has built in are passed over.
readonly VIVID=(mc videodev videobuf2-common videobuf2-v4l2 videobuf2-memops videobuf2-vmalloc
  videobuf2-dma-contig v4l2-dv-timings v4l2-tpg rc-core cec vivid)
# Of a disk that outlives the machine.
readonly DISK=(virtio virtio_ring virtio_mmio virtio_blk crc16 crc32c_generic libcrc32c mbcache jbd2 ext4)

# Of what this very script fetches: another version of it fetches anew.
MARK=complete-$(sha256sum "${BASH_SOURCE[0]}" | head -c 12)
readonly MARK

readonly DISK_AND_NET=(virtio virtio_ring virtio_mmio virtio_pci_modern_dev virtio_pci_legacy_dev
  virtio_pci virtio_blk crc16 mbcache jbd2 crc32c_generic libcrc32c ext4 failover net_failover
  virtio_net)
readonly SSHD_PACKAGES=(dropbear-bin libc6 libcrypt1 libtomcrypt1 libtommath1 libgmp10 zlib1g)

# An apt of its own for arm64 and the packages of every architecture.
set_up_apt() {
  local work=$1
  mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$work/sources"
  copy_debian_sources "$work/sources"
  [[ -s $work/sources/entries ]] || die "apt's sources name no Debian $SUITE main"
  {
    print_apt_options
    echo "APT::Architecture \"arm64\";"
    echo "APT::Architectures { \"arm64\"; \"amd64\"; };"
    echo "Dir::State::Lists \"$work/lists\";"
    echo "Dir::Cache \"$work/cache\";"
    echo "Dir::Etc::SourceList \"$work/sources/debian.list\";"
    echo "Dir::Etc::SourceParts \"$work/sources\";"
    echo "Dir::State::status \"$work/status\";"
  } > "$work/apt.conf"
  : > "$work/status"
  APT_CONFIG="$work/apt.conf" apt-get update -q
}

# fetch WORK PACKAGE...: unpacked into WORK/root.
fetch() {
  local work=$1 deb
  shift
  rm -f "$work"/*.deb
  (cd "$work" && APT_CONFIG="$work/apt.conf" apt-get download -q "$@")
  for deb in "$work"/*.deb; do
    dpkg-deb -x "$deb" "$work/root"
  done
}

# The package that linux-image-arm64 stands for.
kernel_package() {
  APT_CONFIG="$1/apt.conf" apt-cache show linux-image-arm64 |
    sed -nE 's/^Depends: (linux-image-[^ ,]+).*/\1/p' | head -n 1
}

copy_sshd() {
  local root=$1 dir=$2 file
  mkdir -p "$dir/sshd/lib" "$dir/sshd/bin"
  cp "$root/usr/sbin/dropbear" "$dir/sshd/bin/"
  for file in "$root"/{,usr/}lib/aarch64-linux-gnu/lib{c,crypt,tomcrypt,tommath,gmp,z,util,resolv}.so.*; do
    [[ ! -e $file ]] || cp -L "$file" "$dir/sshd/lib/"
  done
  cp -L "$root/lib/aarch64-linux-gnu/ld-linux-aarch64.so.1" "$dir/sshd/lib/"
}

# copy_modules ROOT VERSION OUT NAME...
copy_modules() {
  local root=$1 version=$2 out=$3 number=10 name file
  shift 3
  mkdir -p "$out"
  for name in "$@"; do
    file=$(find "$root/lib/modules/$version" -name "$name.ko*" | head -n 1)
    [[ -n $file ]] || continue
    case $file in
      *.xz) xz -dc "$file" > "$out/$number-$name.ko" ;;
      *) cp "$file" "$out/$number-$name.ko" ;;
    esac
    number=$((number + 1))
  done
  [[ -s $(echo "$out"/*-"$name".ko) ]] || die "the kernel has no $name"
}

# The headers' own tools are of this machine's architecture here, as for any cross build.
prepare_headers() {
  local work=$1 version=$2 headers common
  headers=$work/root/usr/src/linux-headers-$version
  common=$work/root/usr/src/linux-headers-${version%-arm64}-common
  # Paths in the headers start at /; here they start at the folder they were unpacked to.
  find "$work/root/usr" -type l -lname '/*' | while read -r link; do
    ln -sfn "$work/root$(readlink "$link")" "$link"
  done
  sed -i "s|/usr/src/|$work/root/usr/src/|g; s|/usr/lib/|$work/root/usr/lib/|g" "$headers/Makefile"
  sed -i "s|/usr/src/|$work/root/usr/src/|g" "$common/Makefile"
}

# build_module HEADERS SOURCE OUT [VARIABLE...]: SOURCE/NAME.ko to OUT, for SOURCE's own name.
build_module() {
  local headers=$1 source=$2 out=$3
  shift 3
  make -s -C "$headers" M="$source" ARCH=arm64 CROSS_COMPILE=aarch64-linux-gnu- \
    CC=aarch64-linux-gnu-gcc "$@" modules
  aarch64-linux-gnu-strip --strip-debug -o "$out" "$source/$(basename "$source").ko"
}

# Debian's kernel has vimc's source, but not the module.
unpack_vimc() {
  local work=$1 inside=linux-source-6.1/drivers/media/test-drivers/vimc
  tar -xJf "$work/root/usr/src/linux-source-6.1.tar.xz" -C "$work" "$inside"
  mv "$work/$inside" "$work/vimc"
}

main() {
  [[ ${1:-} != -h && ${1:-} != --help ]] || { print_help; return; }
  [[ $# -eq 1 ]] || usage_error "expected DIR"
  local dir=$1 kernel version headers
  if [[ -e $dir/$MARK ]]; then
    echo "The virtual board's parts are in $dir."
    return
  fi
  mkdir -p "$ROOT/build"
  work=$(mktemp -d "$ROOT/build/board-fetch.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  set_up_apt "$work"
  kernel=$(kernel_package "$work")
  [[ -n $kernel ]] || die "Debian has no linux-image-arm64"
  version=${kernel#linux-image-}
  echo "Fetching $kernel."
  fetch "$work" "$kernel:arm64" busybox-static:arm64 "${SSHD_PACKAGES[@]/%/:arm64}" \
    "linux-headers-$version:arm64" \
    "linux-headers-${version%-arm64}-common:all" v4l2loopback-dkms:all linux-kbuild-6.1:amd64 \
    linux-source-6.1:all
  rm -rf "$dir"
  mkdir -p "$dir"
  copy_modules "$work/root" "$version" "$dir/modules" "${DISK[@]}" "${VIVID[@]}"
  copy_modules "$work/root" "$version" "$dir/disk-modules" "${DISK_AND_NET[@]}"
  copy_sshd "$work/root" "$dir"
  prepare_headers "$work" "$version"
  headers=$work/root/usr/src/linux-headers-$version
  cp -r "$work"/root/usr/src/v4l2loopback-* "$work/v4l2loopback"
  build_module "$headers" "$work/v4l2loopback" "$dir/modules/90-v4l2loopback.ko"
  unpack_vimc "$work"
  build_module "$headers" "$work/vimc" "$dir/vimc.ko" CONFIG_VIDEO_VIMC=m
  cp "$work/root/boot/vmlinuz-$version" "$dir/vmlinuz"
  cp "$work/root/bin/busybox" "$dir/busybox"
  echo "$version" > "$dir/$MARK"
}

main "$@"
