#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live page in a headless Chromium, against a viewfixd that replays.

  live_page_test.py --viewfixd PROGRAM --viewfix PROGRAM [--screenshots FOLDER]

Exit code 77: there is no Chromium here.
"""

import argparse
import os
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

import browser

PROGRAMS = argparse.Namespace()


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


class LivePageTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.site, cls.model = os.path.join(folder.name, 'site'), os.path.join(folder.name, 'm.vfx')
        for command in (['simulate', '--out', cls.site, '--seed', '1', '--images-per-view', '4'],
                        ['train', cls.site, '--out', cls.model, '--words', '100',
                         '--max-features', '800']):
            subprocess.run([PROGRAMS.viewfix, *command], check=True, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)
        cls.port = free_port()
        cls.daemon = subprocess.Popen(
            [PROGRAMS.viewfixd, '--model', cls.model, '--camera', 'replay:' + cls.site,
             '--real-time', 'on', '--loop', 'on', '--rate', '4', '--frame-picture', 'on',
             '--publish', f'http:{cls.port}'], stderr=subprocess.DEVNULL)
        cls.addClassCleanup(cls.end_daemon)

    @classmethod
    def end_daemon(cls):
        cls.daemon.send_signal(signal.SIGCONT)
        cls.daemon.terminate()
        cls.daemon.wait()

    def visit(self, name, query='', **options):
        """The page, once it has shown a place."""
        page = browser.Browser(**options)
        page.__enter__()
        self.addCleanup(page.__exit__)
        page.go(f'http://127.0.0.1:{self.port}/{query}')
        page.wait_for("document.body && document.body.classList.contains('localized') && map !== null")
        page.wait_for('trail.length > 3')
        if PROGRAMS.screenshots:
            os.makedirs(PROGRAMS.screenshots, exist_ok=True)
            page.screenshot(os.path.join(PROGRAMS.screenshots, name + '.png'))
        self.assertEqual(page.faults, [])
        return page

    def text(self, page, element):
        return page.evaluate(f"document.getElementById('{element}').innerText")

    def assert_nothing_overflows(self, page):
        self.assertLessEqual(page.evaluate('document.documentElement.scrollWidth'), page.size[0])

    def test_a_desk_shows_place_map_and_device(self):
        page = self.visit('desk')
        self.assertEqual(self.text(page, 'state'), 'Localized')
        self.assertIn(self.text(page, 'name').replace(' ', '_'),
                      page.evaluate('map.locations'))
        self.assertIn('confidence', self.text(page, 'answer'))
        self.assertIn('position', self.text(page, 'answer'))
        page.wait_for("document.getElementById('device').innerText.includes('replay')")
        page.wait_for("!document.getElementById('picture_card').hidden")
        # Something is drawn: the marker's colour stands in the middle of the position.
        self.assertGreater(page.evaluate(
            "new Set(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data)"
            '.size'), 10)
        self.assert_nothing_overflows(page)

    def test_a_kiosk_says_where_you_are_and_nothing_else(self):
        page = self.visit('kiosk', '?kiosk', width=1920, height=1080, dark=True)
        self.assertEqual(self.text(page, 'state'), 'You are here')
        self.assertEqual(page.evaluate("getComputedStyle(document.getElementById('side')).display"),
                         'none')
        size = page.evaluate("parseFloat(getComputedStyle(document.getElementById('name')).fontSize)")
        self.assertGreaterEqual(size, 100)
        self.assertEqual(page.evaluate('document.documentElement.scrollHeight'), 1080)

    def test_a_phone_has_it_all_in_one_column(self):
        page = self.visit('phone', width=390, height=844)
        self.assert_nothing_overflows(page)
        top = [page.evaluate(f"document.getElementById('{part}').getBoundingClientRect().top")
               for part in ('where', 'map', 'side')]
        self.assertEqual(top, sorted(top))

    def test_reasons_are_said_in_words(self):
        page = self.visit('reasons')
        fix = ("{schema: 1, seq: 1, model: lastFix.model, state: 'not_localized', location: null, "
               "level: 0, view: null, confidence: 0.2, rivals: ['floor1/<b>lift</b>', 'hall'], "
               "inliers: 0, keyframe: null, pose: null, reasons: ['ambiguous'], "
               'ms: {features: 1, score: 1, verify: 1, pose: 1, total: 4}}')
        page.evaluate(f'events.close(); show({fix})')
        self.assertEqual(self.text(page, 'state'), 'Not localized')
        self.assertIn('Several places look like this', self.text(page, 'why'))
        # Names are text, whatever is in them.
        self.assertIn('It may be: floor1, <b>lift<, b>; hall.', self.text(page, 'why'))

    def test_a_device_that_falls_silent_is_called_so(self):
        page = self.visit('silent')
        self.daemon.send_signal(signal.SIGSTOP)
        try:
            page.wait_for("document.body.classList.contains('lost')")
            self.assertEqual(self.text(page, 'state'), 'No connection')
        finally:
            self.daemon.send_signal(signal.SIGCONT)
        page.wait_for("!document.body.classList.contains('lost')")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--viewfixd', required=True)
    parser.add_argument('--viewfix', required=True)
    parser.add_argument('--screenshots', default='')
    parser.parse_args(namespace=PROGRAMS)
    if browser.find() is None:
        print('Chromium is not installed')
        sys.exit(77)
    unittest.main(argv=sys.argv[:1])


if __name__ == '__main__':
    main()
