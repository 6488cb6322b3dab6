// SPDX-License-Identifier: BSD-3-Clause
// Of a program without tests: it is compiled for the headers, which CMake parses once for all tests.
