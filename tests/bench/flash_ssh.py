#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Times `viewfix flash` over loopback ssh beside plain scp of the same file.

  flash_ssh.py MODEL [--runs 10] [--viewfixd FILE]

Starts an sshd of its own (Debian's openssh-server) on a free port. The two take turns,
each time onto a board that has nothing yet; medians and the least of all runs. Needs
the build host-release. --viewfixd: the board's program; boards have the static one, as
this machine's is linked with libcamera, whose libraries take longer to load than the model
to check. Exit code 77: there is no sshd.
"""

import argparse
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BIN = os.path.join(ROOT, 'build', 'host-release', 'bin')
SSHD = '/usr/sbin/sshd'
OPTIONS = ['-F', 'none', '-o', 'StrictHostKeyChecking=no', '-o', 'UserKnownHostsFile=/dev/null',
           '-o', 'LogLevel=ERROR', '-o', 'BatchMode=yes']


class Server:
    """An sshd that takes the key WORK/user; WORK/bin/ssh reaches it."""

    def __init__(self, work):
        with socket.socket() as probe:
            probe.bind(('127.0.0.1', 0))
            self.port = probe.getsockname()[1]
        for name in ('host', 'user'):
            subprocess.run(['ssh-keygen', '-q', '-t', 'ed25519', '-N', '', '-f', f'{work}/{name}'],
                           check=True)
        if os.geteuid() == 0:
            os.makedirs('/run/sshd', exist_ok=True)
        with open(f'{work}/sshd_config', 'w', encoding='ascii') as file:
            file.write(f'Port {self.port}\nListenAddress 127.0.0.1\nHostKey {work}/host\n'
                       f'AuthorizedKeysFile {work}/user.pub\nStrictModes no\nUsePAM no\n'
                       'PidFile none\nPermitRootLogin yes\n'
                       'Subsystem sftp /usr/lib/openssh/sftp-server\n')
        self.ssh = ['ssh', *OPTIONS, '-i', f'{work}/user']
        os.makedirs(f'{work}/bin')
        with open(f'{work}/bin/ssh', 'w', encoding='ascii') as file:
            file.write(f"#!/bin/sh\nexec {shutil.which('ssh')} {' '.join(self.ssh[1:])} \"$@\"\n")
        os.chmod(f'{work}/bin/ssh', 0o755)
        self.process = subprocess.Popen([SSHD, '-D', '-f', f'{work}/sshd_config', '-E',
                                         f'{work}/sshd.log'])

    def __enter__(self):
        for _ in range(50):
            asked = subprocess.run([*self.ssh, '-p', str(self.port), '127.0.0.1', 'true'],
                                   stderr=subprocess.DEVNULL, check=False)
            if asked.returncode == 0:
                return self
            time.sleep(0.1)
        raise TimeoutError('sshd does not take us')

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


def timed(command, **more):
    began = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **more)
    return time.monotonic() - began


class Race:
    """The model, signed, and what takes it to the board."""

    def __init__(self, work, arguments, server):
        self.work, self.server, self.viewfixd = work, server, os.path.abspath(arguments.viewfixd)
        self.model = f'{work}/model.vfx'
        shutil.copy(arguments.model, self.model)
        self.viewfix('keygen', '--out', f'{work}/key', '--no-password')
        self.viewfix('sign', self.model, '--key', f'{work}/key.key', '--site', 'bench', '--version',
                     '1')

    def viewfix(self, *arguments):
        return timed([f'{BIN}/viewfix', *arguments],
                     env={**os.environ, 'PATH': f'{self.work}/bin:{os.environ["PATH"]}'})

    def flash(self):
        board = tempfile.mkdtemp(dir=self.work)
        os.makedirs(f'{board}/trust')
        shutil.copy(f'{self.work}/key.pub', f'{board}/trust')
        took_s = self.viewfix('flash', self.model, '--board-program', self.viewfixd, '--trust',
                              f'{board}/trust', '--to',
                              f'ssh://127.0.0.1:{self.server.port}{board}')
        shutil.rmtree(board)
        return took_s

    def scp(self):
        return timed(['scp', '-q', *OPTIONS, '-i', f'{self.work}/user', '-P', str(self.server.port),
                      self.model, f'127.0.0.1:{self.work}/copied'])


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('model')
    parser.add_argument('--runs', type=int, default=10)
    parser.add_argument('--viewfixd', default=f'{BIN}/viewfixd')
    arguments = parser.parse_args()
    if not os.access(SSHD, os.X_OK):
        print(f'{SSHD} is not installed (Debian\'s openssh-server)')
        sys.exit(77)
    flash_s, scp_s = [], []
    with tempfile.TemporaryDirectory() as work, Server(work) as server:
        race = Race(work, arguments, server)
        for _ in range(arguments.runs):
            scp_s.append(race.scp())
            flash_s.append(race.flash())
    print(f'{os.path.getsize(arguments.model) / 1e6:.1f} MB over loopback ssh, {arguments.runs} runs '
          'in turn (seconds: median, least):')
    for name, times in (('viewfix flash', flash_s), ('scp', scp_s)):
        print(f'  {name:<14} {statistics.median(times):6.2f} {min(times):6.2f}')
    print(f'  times as long  {statistics.median(flash_s) / statistics.median(scp_s):6.2f} '
          f'{min(flash_s) / min(scp_s):6.2f}')


if __name__ == '__main__':
    main()
