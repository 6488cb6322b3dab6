# SPDX-License-Identifier: BSD-3-Clause
# What the ARM toolchain files share. Included with VIEWFIX_ARCH (the sysroot's and
# the preset's name), VIEWFIX_PROCESSOR, VIEWFIX_QEMU (qemu's name of it),
# VIEWFIX_TRIPLET and VIEWFIX_ARCH_OPTIONS set.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR ${VIEWFIX_PROCESSOR})
set(CMAKE_C_COMPILER ${VIEWFIX_TRIPLET}-gcc)
set(CMAKE_CXX_COMPILER ${VIEWFIX_TRIPLET}-g++)

get_filename_component(CMAKE_SYSROOT
  "${CMAKE_CURRENT_LIST_DIR}/../build/sysroots/${VIEWFIX_ARCH}" ABSOLUTE)
if(NOT IS_DIRECTORY "${CMAKE_SYSROOT}")
  message(FATAL_ERROR "No sysroot at ${CMAKE_SYSROOT}: run toolchains/build.sh ${VIEWFIX_ARCH}")
endif()

# Programs such as flatc run here; everything else belongs to the target.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

set(CMAKE_CROSSCOMPILING_EMULATOR "qemu-${VIEWFIX_QEMU}-static;-L;${CMAKE_SYSROOT}")

# Not CMAKE_CXX_FLAGS_INIT: the presets set CMAKE_CXX_FLAGS, which would hide it.
add_compile_options(${VIEWFIX_ARCH_OPTIONS})
set(CMAKE_EXE_LINKER_FLAGS_RELEASE_INIT "-s")
