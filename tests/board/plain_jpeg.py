#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes a grey JPEG that shows nothing (every pixel 128), of another's size.

  plain_jpeg.py LIKE OUT
"""

import struct
import sys


def size_of(jpeg):
    at = 2
    while at + 9 < len(jpeg):
        marker, length = jpeg[at + 1], struct.unpack('>H', jpeg[at + 2:at + 4])[0]
        if 0xC0 <= marker <= 0xC2:
            height, width = struct.unpack('>HH', jpeg[at + 5:at + 9])
            return width, height
        at += 2 + length
    sys.exit('no frame header')


def segment(marker, data):
    return struct.pack('>BBH', 0xFF, marker, len(data) + 2) + data


def plain(width, height):
    """One Huffman code of one bit in each table: no difference, end of block."""
    table = bytes([1] + [0] * 15) + b'\0'
    blocks = -(-width // 8) * -(-height // 8)
    bits = 2 * blocks  # two zeros a block
    scan = bytearray(-(-bits // 8))
    if bits % 8:
        scan[-1] |= (1 << (8 - bits % 8)) - 1
    return b''.join([
        b'\xff\xd8',
        segment(0xDB, b'\0' + bytes([1] * 64)),
        segment(0xC0, struct.pack('>BHHB', 8, height, width, 1) + b'\x01\x11\0'),
        segment(0xC4, b'\0' + table),
        segment(0xC4, b'\x10' + table),
        segment(0xDA, b'\x01\x01\0\0\x3f\0'), bytes(scan), b'\xff\xd9'])


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], 'rb') as like, open(sys.argv[2], 'wb') as out:
        out.write(plain(*size_of(like.read())))


if __name__ == '__main__':
    main()
