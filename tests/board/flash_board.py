#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Flashes models over ssh onto a virtual board whose power fails meanwhile.

  flash_board.py WORK [--cuts N] [--seed N]

WORK holds initramfs.gz (guest_flash_init.sh and what it needs), vmlinuz, disk.img
(an ext4 disk with a store, its first model and the key that is trusted), two signed
models 0.vfx and 1.vfx, museum.key, and ssh, the program to connect with.

First the link is cut half-way through a flash, which has to go on where it stopped,
while viewfixd answers one frame after the other. Then the board loses its power
(qemu is killed) at N random moments of flashes (30), and each time has to come up
with the old model or the new one and localize. Exit code 1: it did not.
"""

import argparse
import json
import os
import queue
import random
import re
import socket
import subprocess
import sys
import threading
import time

BOOT_SECONDS = 240
FLASH_SECONDS = 240


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


class Board:
    """One run of the emulated machine, from power on to power off."""

    def __init__(self, work):
        self.port = free_port()
        self.lines = queue.Queue()
        self.process = subprocess.Popen(
            ['qemu-system-aarch64', '-M', 'virt', '-cpu', 'cortex-a72', '-accel', 'tcg,thread=multi',
             '-smp', '2', '-m', '512', '-nographic', '-no-reboot', '-nodefaults', '-serial', 'stdio',
             '-kernel', f'{work}/vmlinuz', '-initrd', f'{work}/initramfs.gz',
             '-append', 'console=ttyAMA0 quiet panic=-1',
             '-drive', f'if=none,id=disk,format=raw,file={work}/disk.img',
             '-device', 'virtio-blk-pci,drive=disk',
             '-netdev', f'user,id=net,hostfwd=tcp:127.0.0.1:{self.port}-:22',
             '-device', 'virtio-net-pci,netdev=net,romfile='],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put(line.decode(errors='replace').strip())
        self.lines.put(None)

    def localized(self):
        """The first fix; what the board said instead is an error."""
        said = []
        end = time.monotonic() + BOOT_SECONDS
        while time.monotonic() < end:
            try:
                line = self.lines.get(timeout=1)
            except queue.Empty:
                continue
            if line is None:
                break
            said.append(line)
            if line.startswith('LOCALIZED '):
                return json.loads(line[len('LOCALIZED '):])
        self.cut_power()
        raise SystemExit('the board does not localize; it said:\n' + '\n'.join(said[-20:]))

    def cut_power(self):
        self.process.kill()
        self.process.wait()


class CutLink:
    """Hands bytes on to a port; the first connection is cut once `limit` bytes went to the board."""

    def __init__(self, port, limit):
        self.target = port
        self.limit = limit
        self.cut_at = None
        self.server = socket.create_server(('127.0.0.1', 0))
        self.port = self.server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            here, _ = self.server.accept()
            there = socket.create_connection(('127.0.0.1', self.target))
            limit = self.limit if self.cut_at is None else None
            for source, sink, most in ((here, there, limit), (there, here, None)):
                threading.Thread(target=self._pump, args=(source, sink, most), daemon=True).start()

    def _pump(self, source, sink, limit):
        sent = 0
        try:
            while limit is None or sent < limit:
                piece = source.recv(4096)
                if not piece:
                    break
                sink.sendall(piece)
                sent += len(piece)
        except OSError:
            pass
        if limit is not None and sent >= limit:
            self.cut_at = sent
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Flasher:
    def __init__(self, work, viewfix):
        self.work = work
        self.viewfix = viewfix
        self.version = 1
        self.environment = {**os.environ, 'PATH': f'{work}/bin:' + os.environ['PATH']}

    def start(self, port):
        """The other one of the two models, as a newer version."""
        self.version += 1
        model = f'{self.work}/{self.version % 2}.vfx'
        subprocess.run([self.viewfix, 'sign', model, '--key', f'{self.work}/museum.key', '--site',
                        'museum', '--version', str(self.version)],
                       check=True, stdout=subprocess.DEVNULL)
        return subprocess.Popen(
            [self.viewfix, 'flash', model, '--to', f'ssh://root@127.0.0.1:{port}/disk/store',
             '--trust', '/disk/trust', '--retries', '5'],
            env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def ask(self, port, command):
        run = subprocess.run(['ssh', '-p', str(port), 'root@127.0.0.1', command],
                             env=self.environment, capture_output=True, text=True, check=False)
        return run.stdout


def finish(flash):
    out, _ = flash.communicate(timeout=FLASH_SECONDS)
    if flash.returncode != 0:
        raise SystemExit(f'the flash failed: {out}')
    return out


def model_of(text):
    return re.search(r'model ([0-9a-f]{16})', text).group(1)


def switched(flasher, board, model):
    """All that viewfixd published, once it is by the new model."""
    end = time.monotonic() + FLASH_SECONDS
    while time.monotonic() < end:
        text = flasher.ask(board.port, 'busybox cat /run/fixes.jsonl')
        fixes = [json.loads(line) for line in text.splitlines() if line.endswith('}')]
        if sum(fix.get('model') == model for fix in fixes) >= 2:
            return fixes
        time.sleep(1)
    raise SystemExit(f'viewfixd did not switch to {model}')


def cut_link(flasher, board):
    whole = os.path.getsize(f'{flasher.work}/0.vfx')
    link = CutLink(board.port, whole // 2)
    out = finish(flasher.start(link.port))
    if link.cut_at is None or 'resumed' not in out:
        raise SystemExit(f'the link was not cut, or the flash began anew: {out}')
    fixes = switched(flasher, board, model_of(out))
    numbers = [fix['seq'] for fix in fixes]
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        raise SystemExit(f'frames are missing: {numbers}')
    models = sorted({fix['model'] for fix in fixes})
    print(f'link cut after {link.cut_at} bytes: {out.strip().splitlines()[-1].strip()}')
    print(f'{len(numbers)} frames answered one after the other, by {len(models)} models in turn',
          flush=True)


def cut_power(flasher, board, cuts, seed):
    chance = random.Random(seed)
    began = time.monotonic()
    known = {model_of(finish(flasher.start(board.port)))}
    seconds = time.monotonic() - began
    print(f'a whole flash takes {seconds:.1f} s', flush=True)
    switches = 0
    current = None
    for number in range(1, cuts + 1):
        flash = flasher.start(board.port)
        pause = chance.uniform(0, seconds)
        time.sleep(pause)
        board.cut_power()
        flash.kill()
        flash.communicate()
        board = Board(flasher.work)
        fix = board.localized()
        switches += current is not None and fix['model'] != current
        current = fix['model']
        known.add(current)
        print(f'cut {number} after {pause:.1f} s: {fix["location"]} by {current}', flush=True)
    if len(known) > 2:
        raise SystemExit(f'models that were never flashed: {known}')
    print(f'{cuts} power cuts, {cuts} times localized, {switches} times by the other model')
    return board


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n', maxsplit=1)[0])
    parser.add_argument('work')
    parser.add_argument('--viewfix', required=True)
    parser.add_argument('--cuts', type=int, default=30)
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    flasher = Flasher(os.path.abspath(arguments.work), arguments.viewfix)
    board = Board(flasher.work)
    fix = board.localized()
    print(f'up: {fix["location"]} by {fix["model"]}', flush=True)
    cut_link(flasher, board)
    cut_power(flasher, board, arguments.cuts, arguments.seed).cut_power()
    return 0


if __name__ == '__main__':
    sys.exit(main())
