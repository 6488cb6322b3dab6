#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The first program of the virtual board that models are flashed onto: mounts its disk, starts viewfixd from
# the store there on photographs, says LOCALIZED with its first fix, and lets ssh in.

export PATH=/bin
busybox mount -t proc proc /proc
busybox mount -t sysfs sys /sys
busybox mount -t devtmpfs dev /dev
busybox mkdir -p /dev/pts /run
busybox mount -t devpts devpts /dev/pts
busybox mount -t tmpfs run /run
for module in /modules/*; do busybox insmod "$module" 2>> /run/insmod.err; done
busybox ip link set lo up
busybox ip link set eth0 up
busybox ip address add 10.0.2.15/24 dev eth0

busybox mkdir -p /disk
busybox mount -t ext4 /dev/vda /disk || { echo "FAIL no disk: $(busybox cat /run/insmod.err)"; busybox poweroff -f; }

viewfixd --store /disk/store --trust /disk/trust --camera replay:/data/frames --loop on --filter off \
  > /run/fixes.jsonl 2> /dev/console &
dropbear -R -s -E 2> /run/dropbear.err
echo "BOARD UP"
while ! busybox grep -q '"localized"' /run/fixes.jsonl; do
  busybox usleep 100000
done
echo "LOCALIZED $(busybox grep -m 1 '"localized"' /run/fixes.jsonl)"
while :; do busybox sleep 1000; done
