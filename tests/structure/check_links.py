#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks what the built programs link: viewfixd needs nothing from the laptop
side, the engine calls nothing that opens, prints, waits or tells the time, and
viewfix, which flashes boards, starts without the laptop's many libraries.

  check_links.py --program VIEWFIXD --engine LIBVIEWFIX_ENGINE.A [--flasher VIEWFIX]
"""

import argparse
import re
import subprocess
import sys

# The only shared libraries viewfixd may ask for (the sanitizers' in debug builds).
BOARD_LIBRARIES = re.compile(
    r'(libc|libm|libstdc\+\+|libgcc_s|libjpeg|libsodium|libexif|libzstd|libevent_(core|extra)-2\.1|'
    r'libmosquitto|libcamera(-base)?|libasan|libubsan|ld-linux[\w-]*)\.so')

# And viewfix, whose commands for boards are to start at once.
FLASHER_LIBRARIES = re.compile(
    r'(libc|libm|libstdc\+\+|libgcc_s|libsodium|libzstd|libasan|libubsan|ld-linux[\w-]*)\.so')

# Symbols, demangled, that the engine may not ask for.
IO_SYMBOLS = re.compile(
    r'(open|openat|creat|read|write|pread|pwrite|mmap|close|ioctl|stat|fstat)(64)?(@|$)'
    r'|f(open|dopen|close|read|write|printf|puts|putc|scanf|gets|getc|flush|seek)(64)?(@|$)'
    r'|(v?printf|vfprintf|puts|putchar|scanf|perror|__printf_chk|__fprintf_chk|stdout|stderr)(@|$)'
    r'|(clock|clock_gettime|gettimeofday|time|nanosleep|usleep|sleep)(@|$)'
    r'|(pthread_(create|mutex_lock|cond_wait)|fork|system|getenv|setenv|rand|srand)(@|$)'
    r'|std::(cout|cerr|clog|thread|chrono|filesystem|random_device|basic_[io]?f?stream|basic_filebuf|'
    r'mutex|condition_variable|ios_base::Init)'
    r'|(cv|ceres|platform)::')


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed_libraries(program):
    return re.findall(r'\(NEEDED\).*\[(.+)\]', run('readelf', '-d', program))


def undefined_symbols(archive):
    names = re.findall(r'^\s+U (.+)$', run('nm', '-u', '-C', archive), re.MULTILINE)
    return sorted(set(names))


def faults(program, engine, flasher):
    for library in needed_libraries(program):
        if not BOARD_LIBRARIES.match(library):
            yield f'{program}: links {library}, which the board need not have'
    for library in needed_libraries(flasher) if flasher else ():
        if not FLASHER_LIBRARIES.match(library):
            yield f'{flasher}: links {library}; only viewfix-tools needs it'
    for symbol in undefined_symbols(engine):
        if IO_SYMBOLS.match(symbol):
            yield f'{engine}: uses {symbol}; the engine is pure computation'


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--program', required=True)
    parser.add_argument('--engine', required=True)
    parser.add_argument('--flasher')
    args = parser.parse_args()
    found = list(faults(args.program, args.engine, args.flasher))
    print('\n'.join(found) if found else 'The programs link what ARCHITECTURE.md allows.')
    sys.exit(1 if found else 0)


if __name__ == '__main__':
    main()
