# SPDX-License-Identifier: BSD-3-Clause
# 32-bit ARM Linux with a floating-point unit: ARMv7-A with VFPv3-D16, Debian's armhf
# (Raspberry Pi 2 and later under a 32-bit system, i.MX6, Allwinner, AM335x).
# The sysroot is made by toolchains/build.sh armhf.
set(VIEWFIX_ARCH armhf)
set(VIEWFIX_PROCESSOR armv7l)
set(VIEWFIX_QEMU arm)
set(VIEWFIX_TRIPLET arm-linux-gnueabihf)
set(VIEWFIX_ARCH_OPTIONS -march=armv7-a+fp -mfloat-abi=hard -mtune=cortex-a7)
include(${CMAKE_CURRENT_LIST_DIR}/arm_linux.cmake)
