#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Packs a folder as an initramfs: cpio in the "newc" format, gzipped.

  pack_initramfs.py FOLDER OUT
"""

import gzip
import os
import stat
import sys

DEVICES = {'dev/console': (5, 1), 'dev/null': (1, 3)}


def entry(name, mode, data=b'', device=(0, 0), inode=[0]):  # pylint: disable=dangerous-default-value
    inode[0] += 1
    fields = (inode[0], mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(name) + 1, 0)
    head = b'070701' + b''.join(b'%08x' % field for field in fields) + name.encode() + b'\0'
    return pad(head) + pad(data)


def pad(data):
    return data + b'\0' * (-len(data) % 4)


def entries(folder):
    for path, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(folders + files):
            full = os.path.join(path, name)
            inside = os.path.relpath(full, folder)
            info = os.lstat(full)
            if stat.S_ISLNK(info.st_mode):
                yield entry(inside, info.st_mode, os.readlink(full).encode())
            elif stat.S_ISDIR(info.st_mode):
                yield entry(inside, info.st_mode)
            else:
                with open(full, 'rb') as file:
                    yield entry(inside, info.st_mode, file.read())
    for name, device in DEVICES.items():
        yield entry(name, stat.S_IFCHR | 0o600, device=device)
    yield entry('TRAILER!!!', 0)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with gzip.open(sys.argv[2], 'wb', compresslevel=1) as out:
        for part in entries(sys.argv[1]):
            out.write(part)


if __name__ == '__main__':
    main()
