#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The first and only program of the virtual board: loads a camera's driver, runs viewfixd on it and says
# PASS or FAIL for each thing tried. Prints files between BEGIN and END marks for run.sh.

export PATH=/bin
busybox mount -t proc proc /proc
busybox mount -t sysfs sys /sys
busybox mount -t devtmpfs dev /dev
busybox mount -t tmpfs run /run
busybox ip link set lo up

pass() { echo "PASS $1"; }
fail() { echo "FAIL $1: $2"; }

now_ms() { read -r up _ < /proc/uptime; echo "${up%.*}${up#*.}0"; }

# wait_until SECONDS COMMAND...: 0 as soon as the command succeeds.
wait_until() {
  end=$(($(now_ms) + $1 * 1000))
  shift
  while [ "$(now_ms)" -lt "$end" ]; do
    "$@" && return 0
    busybox usleep 50000
  done
  return 1
}

health() { busybox wget -q -O - http://127.0.0.1:8080/health 2> /dev/null; }
# A refusal's body is not printed by wget: metrics are always 200.
metric() { busybox wget -q -O - http://127.0.0.1:8080/metrics 2> /dev/null | busybox sed -n "s/^viewfix_$1 //p"; }
delivered() { metric camera_frames_total; }
moves() {
  before=$(delivered)
  busybox usleep 300000
  after=$(delivered)
  [ "${after:-0}" -gt "${before:-0}" ]
}

# load PATTERN MULTIPLANAR: modules in order; 1: vivid's is single-planar, 2: multi-planar.
load() {
  for module in /modules/$1; do
    case $module in
      *-vivid.ko) busybox insmod "$module" n_devs=1 node_types=0x1 num_inputs=1 input_types=0 multiplanar="$2" ;;
      *-v4l2loopback.ko) busybox insmod "$module" video_nr=10 exclusive_caps=1 ;;
      *) busybox insmod "$module" ;;
    esac 2>> /run/insmod.err
  done
}

program=viewfixd
start() {
  "$program" --model /data/site.vfx --publish unix:/run/fixes,http:8080 "$@" 2>> /run/viewfixd.err &
  daemon=$!
}

stop() {
  before=$(now_ms)
  kill "$daemon"
  wait "$daemon"
  code=$?
  took=$(($(now_ms) - before))
}

# Every format that vivid has, single- and multi-planar: does viewfixd read it?
try_formats() {
  for format in $2; do
    start --camera v4l2:/dev/video0 --size 320x180 --rate 30 --pixel-format "$format" --max-fps 2
    if wait_until 8 moves && health | busybox grep -q "320x180 $format *at"; then
      pass "format $1 $format"
    else
      fail "format $1 $format" "$(health | busybox head -c 300) $(busybox tail -n 2 /run/viewfixd.err)"
    fi
    stop
    [ "$code" = 0 ] || fail "format $1 $format" "exit code $code"
  done
}

# fault NAME CONTROL VALUE [VALUE THAT ENDS IT]: set while frames come; they must come again within 2 s
# of its end.
fault() {
  if ! wait_until 10 moves; then
    fail "fault $1" "no frames before it"
    return
  fi
  board_tool control /dev/video0 "$2" "$3" || { fail "fault $1" "not set"; return; }
  if [ -n "${4:-}" ]; then
    busybox sleep 1
    board_tool control /dev/video0 "$2" "$4"
  fi
  began=$(now_ms)
  at=$(delivered)
  resumed() { [ "$(delivered)" -gt "$((at + 3))" ] 2> /dev/null; }
  if wait_until 10 resumed; then
    took=$(($(now_ms) - began))
    if [ "$took" -le 2000 ]; then pass "fault $1 ($took ms)"; else fail "fault $1" "$took ms"; fi
  else
    fail "fault $1" "no frames after it; $(busybox tail -n 2 /run/viewfixd.err)"
  fi
}

# The stream's own requests are made when it starts: a fault of theirs shows when it starts anew.
fault_at_start() {
  board_tool control /dev/video0 "$2" 1
  fault "$1" inject_fatal_streaming_error 1
}

test_vivid() {
  load '*' 1
  wait_until 5 [ -c /dev/video0 ] || { fail vivid "$(busybox cat /run/insmod.err)"; return; }
  pass "camera after $(now_ms) ms"
  viewfixd cameras > /run/cameras
  if busybox grep -q 'format YUYV' /run/cameras && busybox grep -q 'control brightness' /run/cameras; then
    pass cameras
  else
    fail cameras "$(busybox head -n 3 /run/cameras)"
  fi
  try_formats single "YUYV UYVY GREY NV12 YU12 RGB3 BGR3 RGGB BA81 Y16"
  # An emulated processor takes seconds for a frame: one each five seconds leaves it time for the rest.
  start --camera v4l2:/dev/video0 --size 320x180 --rate 30 --max-fps 0.2
  fault dropped percentage_of_dropped_buffers 80 0
  [ "$(metric camera_lost_total)" -gt 0 ] && pass "gaps counted" || fail "gaps counted" none
  fault flagged inject_v4l2_buf_flag_error 1
  [ "$(metric camera_erroneous_total)" -gt 0 ] && pass "flags counted" || fail "flags counted" none
  fault fatal inject_fatal_streaming_error 1
  fault_at_start reqbufs inject_vidioc_reqbufs_error
  fault_at_start qbuf inject_vidioc_qbuf_error
  fault_at_start streamon inject_vidioc_streamon_error
  fault disconnect disconnect 1
  stop
  if [ "$code" = 0 ] && [ "$took" -le 300 ]; then
    pass "shutdown ($took ms)"
  else
    fail shutdown "exit code $code after $took ms"
  fi
}

test_multiplanar() {
  busybox grep -q DMABUF /run/viewfixd.err && pass DMABUF || fail DMABUF "not offered"
  busybox rmmod vivid || { fail multi-planar "vivid stays"; return; }
  load '*-vivid.ko' 2
  wait_until 5 [ -c /dev/video0 ]
  try_formats multi "YUYV NM12 YM12 GREY"
}

# A sleep of the machine. An emulated one's clock goes on meanwhile, so that what is done about a
# clock that stood still is left to the unit tests.
test_sleep() {
  alarm=/sys/class/rtc/rtc0/wakealarm
  if ! busybox grep -q freeze /sys/power/state || [ ! -e $alarm ]; then
    echo "FIGURE sleep: this machine cannot"
    return
  fi
  start --camera v4l2:/dev/video0 --size 320x180 --rate 30 --max-fps 0.2
  wait_until 10 moves
  before=$(now_ms)
  echo +4 > $alarm
  echo freeze > /sys/power/state
  began=$(now_ms)
  at=$(delivered)
  resumed() { [ "$(delivered)" -gt "$((at + 3))" ] 2> /dev/null; }
  wait_until 10 resumed
  took=$(($(now_ms) - began))
  if [ $((began - before)) -ge 2000 ] && [ "$took" -le 2000 ]; then
    pass "sleep of $((began - before)) ms ($took ms)"
  else
    fail sleep "$((began - before)) ms, then $took ms; $(busybox tail -n 2 /run/viewfixd.err)"
  fi
  stop
}

# Killed at random moments: the next start serves, whatever lies about.
test_kills() {
  for _ in 1 2 3 4 5 6; do
    start --camera v4l2:/dev/video0 --size 320x180 --max-fps 2
    busybox usleep $(($(busybox od -An -N2 -tu2 /dev/urandom) * 20))
    kill -9 "$daemon"
    wait "$daemon" 2> /dev/null
  done
  start --camera v4l2:/dev/video0 --size 320x180 --max-fps 2
  if wait_until 10 moves && [ -S /run/fixes ]; then pass "kill -9"; else fail "kill -9" "no frames"; fi
  stop
}

# READY and the watchdog's food, as systemd would see them.
test_notify() {
  board_tool notify /run/notify > /run/notified &
  listener=$!
  wait_until 3 [ -S /run/notify ]
  NOTIFY_SOCKET=/run/notify WATCHDOG_USEC=3000000 viewfixd --model /data/site.vfx --publish none \
    --camera v4l2:/dev/video0 --size 320x180 --max-fps 2 2>> /run/viewfixd.err &
  daemon=$!
  fed() { [ "$(busybox grep -c WATCHDOG=1 /run/notified)" -ge 3 ]; }
  wait_until 10 fed
  stop
  if busybox grep -q READY=1 /run/notified && fed && busybox grep -q STOPPING=1 /run/notified; then
    pass notify
  else
    fail notify "$(busybox head -n 5 /run/notified)"
  fi
  kill $listener
}

# The museum's photographs as a camera's frames.
test_photographs() {
  wait_until 5 [ -c /dev/video10 ] || { fail photographs "no loopback: $(busybox cat /run/insmod.err)"; return; }
  start --camera v4l2:/dev/video10 --size 640x480 --filter off
  wait_until 5 [ -S /run/fixes ]
  if board_tool feed /dev/video10 /run/fixes /run/fixes.jsonl /data/frames/*.jpg; then
    pass "photographs fed"
    echo "BEGIN fixes"
    busybox cat /run/fixes.jsonl
    echo "END fixes"
  else
    fail "photographs fed" "$(busybox wc -l < /run/fixes.jsonl) lines; $(health | busybox head -c 400)"
  fi
  echo "FIGURE rss_kb $(busybox sed -n 's/^VmRSS:[^0-9]*\([0-9]*\).*/\1/p' /proc/$daemon/status)"
  stop
}

# libcamera asks udev which devices are ready; this board has no udevd, and gets by with its records.
record_devices() {
  busybox mkdir -p /run/udev/data
  for device in /sys/class/video4linux/*/dev /sys/bus/media/devices/*/dev; do
    read -r number < "$device" && echo I:1 > "/run/udev/data/c$number"
  done
}

# Frames of vimc's sensor through libcamera, none lost to an error, and the camera given back.
test_libcamera() {
  busybox insmod /vimc.ko || { fail libcamera "vimc does not load"; return; }
  record_devices
  program=viewfixd-dynamic
  "$program" cameras > /run/cameras
  if busybox grep -q 'Sensor B' /run/cameras; then
    pass "libcamera lists vimc"
  else
    fail "libcamera lists vimc" "$(busybox head -n 5 /run/cameras)"
  fi
  start --camera 'libcamera:Sensor B' --max-fps 0.2
  began=$(now_ms)
  enough() { [ "$(delivered)" -ge 30 ] 2> /dev/null; }
  if wait_until 30 enough && [ "$(metric camera_erroneous_total)" = 0 ]; then
    pass "libcamera frames ($(delivered) in $(($(now_ms) - began)) ms, start included)"
  else
    fail "libcamera frames" "$(delivered); $(busybox tail -n 2 /run/viewfixd.err)"
  fi
  stop
  [ "$code" = 0 ] || fail "libcamera shutdown" "exit code $code after $took ms"
  program=viewfixd
}

# Serves from the disk's store, and has models installed until the power goes.
serve_until_the_end() {
  load '*' 1
  wait_until 5 [ -b /dev/vda ]
  busybox mount -t ext4 /dev/vda /disk || { fail "power cut" "the disk does not mount"; return; }
  store="--store /disk/store --trust /disk/trust"
  # shellcheck disable=SC2086
  viewfixd $store --publish unix:/disk/fixes,http:8080 --camera v4l2:/dev/video0 --size 320x180 \
    --max-fps 2 &
  serves() { health | busybox grep -q '"state":"ok"' && [ -S /disk/fixes ] && moves; }
  wait_until 60 serves || { fail "power cut" "$(health)"; return; }
  echo "UP $(health | busybox sed 's/.*"hash":\("[0-9a-f]*"\).*/\1/')"
  while true; do
    for model in b a; do
      # shellcheck disable=SC2086
      viewfixd store install /disk/models/$model.vfx $store --allow older > /dev/null && echo "INSTALLED $model"
    done
  done
}

if busybox grep -q power_cuts /proc/cmdline; then
  serve_until_the_end
  busybox poweroff -f
fi
test_vivid
test_sleep
test_multiplanar
test_kills
test_notify
test_photographs
test_libcamera
echo "BEGIN log"
busybox cat /run/viewfixd.err
echo "END log"
echo "BOARD DONE"
busybox poweroff -f
