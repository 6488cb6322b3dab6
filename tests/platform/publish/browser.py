# SPDX-License-Identifier: BSD-3-Clause
"""A headless Chromium, driven over its own debugging protocol with nothing but
the standard library."""

import base64
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import tempfile
import time
import urllib.request

NAMES = ('chromium', 'chromium-browser', 'google-chrome')


def find():
    """The path of a Chromium, or None."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


class _WebSocket:
    """As much of RFC 6455 as a debugging session needs."""

    def __init__(self, url):
        host, port, path = re.match(r'ws://([^:/]+):(\d+)(/.*)', url).groups()
        self.socket = socket.create_connection((host, int(port)), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall((f'GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n'
                             f'Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n'
                             'Sec-WebSocket-Version: 13\r\n\r\n').encode())
        self.buffer = b''
        while b'\r\n\r\n' not in self.buffer:
            self.buffer += self.socket.recv(4096)
        self.buffer = self.buffer.split(b'\r\n\r\n', 1)[1]

    def _take(self, size):
        while len(self.buffer) < size:
            part = self.socket.recv(1 << 16)
            if not part:
                raise ConnectionError('the browser has gone')
            self.buffer += part
        taken, self.buffer = self.buffer[:size], self.buffer[size:]
        return taken

    def send(self, text):
        data, mask = text.encode(), os.urandom(4)
        size = len(data)
        head = (struct.pack('!BB', 0x81, 0x80 | size) if size < 126 else
                struct.pack('!BBH', 0x81, 0xFE, size) if size < 65536 else
                struct.pack('!BBQ', 0x81, 0xFF, size))
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self.socket.sendall(head + mask + masked)

    def receive(self):
        text = b''
        while True:
            first, second = self._take(2)
            size = second & 0x7F
            if size == 126:
                size, = struct.unpack('!H', self._take(2))
            elif size == 127:
                size, = struct.unpack('!Q', self._take(8))
            text += self._take(size)
            if first & 0x80:
                return text.decode()


# What the browser answers when the page asked is left for another before it has answered.
_NAVIGATED = ('Inspected target navigated or closed', 'Execution context was destroyed.',
              'Cannot find default execution context')


class Navigated(RuntimeError):
    """The page asked was left for another before it answered."""


class Browser:
    """One page in a browser of its own; use it in a `with`."""

    def __init__(self, width=1280, height=800, dark=False):
        self.size = (width, height)
        self.dark = dark
        self.last_id = 0
        self.faults = []  # exceptions and errors of the page, those in its console among them

    def __enter__(self):
        self.folder = tempfile.mkdtemp(prefix='viewfix-browser-')
        self.process = subprocess.Popen(
            [find(), '--headless=new', '--no-sandbox', '--disable-gpu',
             '--enable-unsafe-swiftshader', '--no-first-run',
             '--disable-dev-shm-usage', '--hide-scrollbars', '--remote-debugging-port=0',
             f'--user-data-dir={self.folder}', f'--window-size={self.size[0]},{self.size[1]}',
             'about:blank'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.socket = _WebSocket(self._page_url())
        self.call('Page.enable')
        self.call('Runtime.enable')
        self.call('Log.enable')
        self.call('Emulation.setDeviceMetricsOverride', width=self.size[0], height=self.size[1],
                  deviceScaleFactor=1, mobile=False)
        self.call('Emulation.setEmulatedMedia', features=[
            {'name': 'prefers-color-scheme', 'value': 'dark' if self.dark else 'light'}])
        return self

    def __exit__(self, *_):
        self.socket.socket.close()
        self.process.kill()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _page_url(self):
        port_file = os.path.join(self.folder, 'DevToolsActivePort')
        for _ in range(600):
            try:
                with open(port_file, encoding='ascii') as file:
                    port = int(file.readline())
                with urllib.request.urlopen(f'http://127.0.0.1:{port}/json', timeout=10) as reply:
                    pages = [p for p in json.load(reply) if p['type'] == 'page']
                if pages:
                    return pages[0]['webSocketDebuggerUrl']
            except (OSError, ValueError):
                pass
            time.sleep(0.1)
        raise TimeoutError('the browser did not start')

    def call(self, method, **parameters):
        self.last_id += 1
        self.socket.send(json.dumps({'id': self.last_id, 'method': method, 'params': parameters}))
        while True:
            message = json.loads(self.socket.receive())
            if message.get('method') == 'Runtime.exceptionThrown':
                details = message['params']['exceptionDetails']
                self.faults.append(details.get('exception', {}).get('description', details['text']))
            if (message.get('method') == 'Runtime.consoleAPICalled' and
                    message['params']['type'] in ('error', 'assert')):
                self.faults.append(str(message['params']['args']))
            if (message.get('method') == 'Log.entryAdded' and
                    message['params']['entry']['level'] == 'error'):
                self.faults.append(message['params']['entry']['text'])
            if message.get('id') == self.last_id:
                if 'error' in message:
                    fault = message['error']
                    kind = Navigated if fault['message'] in _NAVIGATED else RuntimeError
                    raise kind(f'{method}: {fault}')
                return message['result']

    def go(self, url):
        self.call('Page.navigate', url=url)

    def evaluate(self, script):
        result = self.call('Runtime.evaluate', expression=script, returnByValue=True,
                           awaitPromise=True)
        if 'exceptionDetails' in result:
            raise RuntimeError(str(result['exceptionDetails']))
        return result['result'].get('value')

    def wait_for(self, script, patience_s=60):
        """Until the script's value is true, in this page or the one it leads to; returns it."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            try:
                value = self.evaluate(script)
                if value:
                    return value
            except Navigated:
                pass  # the old page went while it was asked: ask the new one
            time.sleep(0.2)
        raise TimeoutError(f'never true: {script}')

    def screenshot(self, path):
        data = self.call('Page.captureScreenshot', format='png')['data']
        with open(path, 'wb') as file:
            file.write(base64.b64decode(data))
