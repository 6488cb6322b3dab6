#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Counts the tests in a JUnit file that ctest wrote.

  ctest_summary.py FILE

Prints a line for each test that failed or was skipped, with the reason a test
gave for skipping, and at the end: PASSED FAILED SKIPPED, three numbers.
"""

import re
import sys
import xml.etree.ElementTree as ElementTree


def was_skipped(case):
    """Skipped on purpose, unlike a test whose program is missing ("notrun" too)."""
    skipped = case.find('skipped')
    return case.get('status') == 'disabled' or (
        skipped is not None and skipped.get('message', '').startswith('SKIP_'))


def skip_reason(case):
    """What GTEST_SKIP() printed: the line after its 'FILE:LINE: Skipped'."""
    match = re.search(r'Skipped\n(.+)', case.findtext('system-out') or '')
    return match.group(1).strip() if match else case.get('status')


def main():
    if len(sys.argv) != 2 or sys.argv[1] in ('-h', '--help'):
        sys.exit(__doc__)
    counts = {'passed': 0, 'failed': 0, 'skipped': 0}
    for case in ElementTree.parse(sys.argv[1]).getroot().iter('testcase'):
        name = case.get('name')
        if case.get('status') == 'run':
            counts['passed'] += 1
        elif was_skipped(case):
            counts['skipped'] += 1
            print(f'skipped  {name}: {skip_reason(case)}')
        else:
            counts['failed'] += 1
            print(f'FAILED   {name}')
    print(counts['passed'], counts['failed'], counts['skipped'])


if __name__ == '__main__':
    main()
