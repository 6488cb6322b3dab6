#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Compares fixes of the same pictures, once from files and once from a camera:
every field but the times and the frame's number.

  compare_photographs.py EXPECTED ACTUAL FRAMES
"""

import json
import sys

OWN_FIELDS = ('seq', 'capture_time_ns', 'time', 'age_ms', 'ms')


def read_fixes(path):
    with open(path, encoding='utf-8') as file:
        fixes = [json.loads(line, parse_float=str, parse_int=str) for line in file]
    return [{key: value for key, value in fix.items() if key not in OWN_FIELDS} for fix in fixes]


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    expected, actual = read_fixes(sys.argv[1]), read_fixes(sys.argv[2])
    frames = int(sys.argv[3])
    if (len(expected), len(actual)) != (frames, frames):
        sys.exit(f'{len(expected)} and {len(actual)} fixes of {frames} pictures')
    for number, (a, b) in enumerate(zip(expected, actual), start=1):
        if a != b:
            sys.exit(f'picture {number} differs:\n{json.dumps(a)}\n{json.dumps(b)}')
    localized = sum(fix['state'] == 'localized' for fix in expected)
    if localized == 0:
        sys.exit('no picture was localized: this compares nothing')
    print(f'{frames} pictures give the same fixes from a camera as from files, {localized} localized.')


if __name__ == '__main__':
    main()
