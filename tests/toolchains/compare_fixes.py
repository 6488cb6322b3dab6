#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Compares two runs of viewfixd over the same frames: every field but the times.

  compare_fixes.py EXPECTED ACTUAL FRAMES

Both files hold one JSON object a line and must hold FRAMES lines. Numbers are
compared as they are written, so the last digit counts.
"""

import json
import sys

TIME_FIELDS = ('capture_time_ns', 'time', 'age_ms', 'ms')


def read_fixes(path):
    with open(path, encoding='utf-8') as file:
        fixes = [json.loads(line, parse_float=str, parse_int=str) for line in file]
    for fix in fixes:
        for field in TIME_FIELDS:
            del fix[field]
    return fixes


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    expected, actual = read_fixes(sys.argv[1]), read_fixes(sys.argv[2])
    frames = int(sys.argv[3])
    if (len(expected), len(actual)) != (frames, frames):
        sys.exit(f'{len(expected)} and {len(actual)} fixes of {frames} frames')
    for number, (a, b) in enumerate(zip(expected, actual), start=1):
        if a != b:
            sys.exit(f'line {number} differs:\n{json.dumps(a)}\n{json.dumps(b)}')
    if all(fix['location'] is None for fix in expected):
        sys.exit('no frame was localized: this compares nothing')
    print(f'{frames} fixes agree, times aside.')


if __name__ == '__main__':
    main()
