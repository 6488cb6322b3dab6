#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes a folder that viewfixd can replay: a set's test images, none copied.

  pick_frames.py SET FOLDER [COUNT]

SET     folder with images.csv, whose column `split` says which images are `test`
FOLDER  made new; gets an images.csv with the test rows
COUNT   so many rows, evenly spread (default: all)
"""

import csv
import os
import sys


def read_test_rows(image_set):
    with open(os.path.join(image_set, 'images.csv'), newline='', encoding='utf-8') as file:
        reader = csv.DictReader(file)
        return reader.fieldnames, [row for row in reader if row['split'] == 'test']


def main():
    if len(sys.argv) not in (3, 4) or sys.argv[1] in ('-h', '--help'):
        sys.exit(__doc__)
    image_set, folder = sys.argv[1:3]
    fields, rows = read_test_rows(image_set)
    count = int(sys.argv[3]) if len(sys.argv) == 4 else len(rows)
    if not 0 < count <= len(rows):
        sys.exit(f'{image_set}/images.csv: {len(rows)} test images, {count} wanted')
    os.mkdir(folder)
    with open(os.path.join(folder, 'images.csv'), 'w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, fields, lineterminator='\n')
        writer.writeheader()
        for i in range(count):
            row = rows[i * len(rows) // count]
            image = os.path.join(image_set, row['path'])
            writer.writerow({**row, 'path': os.path.relpath(image, folder)})


if __name__ == '__main__':
    main()
