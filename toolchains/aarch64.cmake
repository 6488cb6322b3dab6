# SPDX-License-Identifier: BSD-3-Clause
# 64-bit ARM Linux, from Cortex-A53 (Raspberry Pi 3) upwards.
# The sysroot is made by toolchains/build.sh aarch64.
set(VIEWFIX_ARCH aarch64)
set(VIEWFIX_PROCESSOR aarch64)
set(VIEWFIX_QEMU aarch64)
set(VIEWFIX_TRIPLET aarch64-linux-gnu)
set(VIEWFIX_ARCH_OPTIONS -march=armv8-a -mtune=cortex-a53)
include(${CMAKE_CURRENT_LIST_DIR}/arm_linux.cmake)
