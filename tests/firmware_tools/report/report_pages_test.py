#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The HTML pages that viewfix writes, in a headless Chromium.

  report_pages_test.py --viewfix PROGRAM [--screenshots FOLDER]

Exit code 77: there is no Chromium here, or viewfix was built without the pages' libraries.
"""

import argparse
import csv
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / 'platform' / 'publish'))
import browser  # noqa: E402

PROGRAMS = argparse.Namespace()
HOSTILE = '</script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;"\''
DESK, PHONE = {'width': 1280, 'height': 800}, {'width': 390, 'height': 844}
PLOTS = ['accuracy by level', 'reliability', 'risk and coverage', 'latency by stage',
         'model bytes by section', 'images by location', 'trajectory']


def viewfix(*arguments):
    run = subprocess.run([PROGRAMS.viewfix, *map(str, arguments)], capture_output=True, text=True,
                         check=False)
    if 'this viewfix was built without' in run.stderr:
        print(run.stderr.strip().splitlines()[-1])
        sys.exit(77)
    assert run.returncode == 0, run.stderr
    return run


def rename(site, old, new):
    """A copy of the set's CSV in which one location is called otherwise."""
    with open(site / 'images.csv', encoding='utf-8', newline='') as file:
        rows = list(csv.reader(file))
    column = rows[0].index('location')
    for row in rows[1:]:
        row[column] = new if row[column] == old else row[column]
    path = site / 'renamed.csv'
    with open(path, 'w', encoding='utf-8', newline='') as file:
        csv.writer(file, lineterminator='\n').writerows(rows)
    return path


def walk_of(csv_file):
    """Lines of viewfixd for the first images of a set, the second without a pose."""
    with open(csv_file, encoding='utf-8', newline='') as file:
        for number, row in zip(range(6), csv.DictReader(file)):
            pose = {'frame': 'world_from_cam', 'map': 0,
                    't': [float(row['t' + axis]) for axis in 'xyz'],
                    'q_xyzw': [float(row['q' + axis]) for axis in 'xyzw']}
            yield json.dumps({'state': 'localized', 'location': row['location'], 'confidence': 0.9,
                              'pose': None if number == 1 else pose}) + '\n'


class PagesTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        site, model = cls.folder / 'site', cls.folder / 'm.vfx'
        viewfix('simulate', '--out', site, '--seed', '1', '--images-per-view', '5')
        # Of two show windows that look alike, one has a hostile name.
        csv_file = rename(site, 'show_window_1', HOSTILE)
        # Any picture will do.
        shutil.copy(next((site / 'images').rglob('*.jpg')), cls.folder / 'plan.jpg')
        align = cls.folder / 'align.csv'
        align.write_text('px,py,x,y\n0,0,0,10\n640,0,100,10\n', encoding='utf-8')
        viewfix('train', csv_file, '--out', model, '--words', '50', '--max-features', '800',
                '--floorplan', cls.folder / 'plan.jpg', '--floorplan-align', align)
        cls.map = cls.folder / 'map.html'
        fixes = cls.folder / 'fixes.jsonl'
        fixes.write_text(''.join(walk_of(csv_file)), encoding='utf-8')
        viewfix('map', model, '--out', cls.map, '--fixes', fixes)
        cls.report, cls.json = cls.folder / 'report.html', cls.folder / 'eval.json'
        viewfix('eval', csv_file, '--model', model, '--split', 'all', '--report', cls.report,
                '--json', cls.json, '--map', cls.folder / 'map 2.html')

    def visit(self, file, name, ready='true', **options):
        page = browser.Browser(**options)
        page.__enter__()
        self.addCleanup(page.__exit__)
        page.go(file.as_uri())
        page.wait_for(f"document.readyState === 'complete' && {ready}")
        if PROGRAMS.screenshots:
            os.makedirs(PROGRAMS.screenshots, exist_ok=True)
            page.screenshot(os.path.join(PROGRAMS.screenshots, name + '.png'))
        self.assertEqual(page.faults, [])
        self.assert_nothing_sideways(page)
        return page

    def assert_nothing_sideways(self, page):
        self.assertLessEqual(page.evaluate('document.documentElement.scrollWidth'), page.size[0])
        outside = page.evaluate(
            "[...document.querySelectorAll('table')].filter(t => !t.closest('.scroll')).length +"
            "[...document.querySelectorAll('.card, .scroll, canvas')]"
            '.filter(e => e.getBoundingClientRect().right > innerWidth + 1).length')
        self.assertEqual(outside, 0, 'what is wide scrolls in its own box')

    def assert_plots_drawn(self, page, plots=PLOTS):
        self.assertEqual(sorted(page.evaluate('charts.map(c => c.name)')), sorted(plots))
        for i, name in enumerate(page.evaluate('charts.map(c => c.name)')):
            colours = page.evaluate(
                f'(() => {{ const c = charts[{i}].canvas; return new Set(new Uint32Array('
                "c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size; })()")
            self.assertGreater(colours, 20, name)

    def test_a_desk_shows_every_plot_and_picture(self):
        page = self.visit(self.report, 'desk')
        self.assert_plots_drawn(page)
        self.assertTrue(page.evaluate('[...document.images].every(i => i.naturalWidth > 0)'))
        failures = json.loads(self.json.read_text(encoding='utf-8'))['failures']
        self.assertGreater(len(failures), 0, 'the set was to have failures')
        self.assertEqual(page.evaluate("document.querySelectorAll('.failure').length"),
                         min(12, len(failures)))
        self.assertEqual(page.evaluate("document.querySelectorAll('.failure .sides svg').length"),
                         2 * min(12, len(failures)))
        self.assertGreater(page.evaluate("document.querySelectorAll('.failure svg line').length"),
                           20, 'look-alike windows match')
        self.assertEqual(page.faults, [])

    def test_a_phone_in_the_dark(self):
        page = self.visit(self.report, 'phone', **PHONE, dark=True)
        self.assert_plots_drawn(page)
        named = page.evaluate("charts.find(c => c.name === 'images by location')"
                              '.chart.scales.y.getTicks().filter(t => t.label).length')
        self.assertEqual(named, 10, 'every location has its name beside its bar')
        self.assertEqual(page.evaluate('getComputedStyle(document.body).backgroundColor'),
                         'rgb(20, 23, 26)')

    def test_a_wide_table_scrolls_in_its_own_box(self):
        page = self.visit(self.report, 'phone_table', **PHONE)
        wider = page.evaluate("(async () => { const d = document.querySelector('details');"
                              'd.open = true; await new Promise(r => setTimeout(r, 200));'
                              "const box = d.querySelector('.scroll');"
                              'return box.scrollWidth - box.clientWidth; })()')
        self.assertGreater(wider, 100)
        self.assert_nothing_sideways(page)

    def test_a_legend_shows_what_the_plot_shows(self):
        page = self.visit(self.report, 'legend')
        legend = page.evaluate("charts.find(c => c.name === 'reliability').chart.legend.legendItems"
                               '.map(i => [i.text, i.pointStyle, i.lineDash.length])')
        self.assertEqual(legend, [['share right', 'circle', 0], ['95 % interval', 'rect', 2],
                                  ['perfect', 'line', 2]])

    def test_paper_is_white(self):
        page = self.visit(self.report, 'print', width=740, height=1000, dark=True)
        page.call('Emulation.setEmulatedMedia', media='print')
        page.wait_for("getComputedStyle(document.body).backgroundColor === 'rgb(255, 255, 255)'")
        self.assert_plots_drawn(page)
        self.assert_nothing_sideways(page)
        beside = page.evaluate("(() => { const [a, b] = [...document.querySelectorAll('.pairs')[0]"
                               '.children].map(e => e.getBoundingClientRect().top);'
                               'return a === b; })()')
        self.assertTrue(beside, 'a failure takes little paper, however narrow')
        self.assertEqual(page.faults, [])

    def test_an_experiment_has_its_tables_and_plots(self):
        report, file = self.folder / 'experiment.html', self.folder / 'experiment.json'
        viewfix('experiment', self.folder / 'site' / 'renamed.csv', '--json', file, '--report',
                report, '--splits', '1', '--words', '50', '--jobs', '1')
        plots = ['accuracy of the methods', 'time for a prediction', 'accuracy by location']
        figures = json.loads(file.read_text(encoding='utf-8'))
        for name, options in (('experiment', {}), ('experiment_phone', {**PHONE, 'dark': True})):
            page = self.visit(report, name, **options)
            self.assert_plots_drawn(page, plots)
            self.assertEqual(page.evaluate("document.querySelector('table').rows.length"),
                             1 + len(figures['methods']))
            self.assertIn(HOSTILE, page.evaluate("document.getElementById('matrix').innerText"))
            self.assertIn('36 (12.6 ms)', page.evaluate('document.body.innerText'))
            self.assertEqual(page.faults, [])

    def test_the_report_leads_to_the_map(self):
        page = self.visit(self.report, 'link')
        page.evaluate("document.querySelector('a').click()")
        page.wait_for('!!window.viewfixMap')
        self.assertTrue(page.evaluate('decodeURI(location.href)').endswith('/map 2.html'))

    def test_hostile_names_are_text(self):
        page = self.visit(self.report, 'hostile')
        self.assertIn(HOSTILE, page.evaluate('document.body.innerText'))
        self.assertEqual(page.evaluate("document.querySelectorAll('script').length"), 3)
        self.assertEqual(page.evaluate("document.querySelectorAll('img[onerror]').length"), 0)

    def test_a_location_opens_to_its_images(self):
        page = self.visit(self.report, 'locations')
        rows = page.evaluate("(async () => { const d = document.querySelector('details');"
                             'd.open = true; await new Promise(r => setTimeout(r, 200));'
                             "return d.querySelectorAll('td:first-child').length; })()")
        figures = json.loads(self.json.read_text(encoding='utf-8'))
        self.assertEqual(rows, figures['locations'][0]['images'])

    def visit_map(self, name, **options):
        return self.visit(self.map, name, ready='!!window.viewfixMap', **options)

    def colours_of_map(self, page):
        """How many colours the scene has, read right after it is drawn."""
        return page.evaluate(
            '(() => { viewfixMap.draw(); const gl = viewfixMap.renderer.getContext();'
            'const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];'
            'const pixels = new Uint8Array(4 * w * h);'
            'gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);'
            'return new Set(new Uint32Array(pixels.buffer)).size; })()')

    def test_the_map_is_drawn_with_all_its_parts(self):
        page = self.visit_map('map')
        self.assertGreater(self.colours_of_map(page), 50)
        self.assertEqual(page.evaluate("document.querySelectorAll('#legend button').length"), 10)
        self.assertIn(HOSTILE, page.evaluate("document.getElementById('legend').innerText"))
        for part in ('points', 'keyframes', 'names', 'plan'):
            before = self.colours_of_map(page)
            page.evaluate(f"document.getElementById('show_{part}').click()")
            self.assertLess(self.colours_of_map(page), before, part)
        self.assertEqual(page.faults, [])

    def test_the_map_opens_with_all_of_it_in_sight(self):
        for name, size in (('map_desk', DESK), ('map_phone', PHONE)):
            for dark in (False, True):
                with self.subTest(name, dark=dark):
                    self.assert_in_sight(self.visit_map(name, **size, dark=dark))

    def assert_in_sight(self, page):
        """Keyframes and points lie beside or below the panel, and take much of what is there."""
        keyframes, points, width, height = page.evaluate(
            '(() => { const {state, camera, freeArea} = viewfixMap, area = freeArea();'
            'const shares = at => { const p = at.clone().project(camera); return ['
            '((p.x + 1) / 2 * innerWidth - area.x) / area.width,'
            '((1 - p.y) / 2 * innerHeight - area.y) / area.height]; };'
            'const inside = all => all.filter(s => s.every(v => v >= 0 && v <= 1)).length / all.length;'
            'const keyframes = data => JSON.parse(data.textContent).maps[0].keyframes.map('
            'k => shares(camera.position.clone().set(...k.t)));'
            'const cloud = state.parts.show_points.geometry.attributes.position;'
            'const points = Array.from({length: cloud.count}, (_, i) => shares('
            'camera.position.clone().fromBufferAttribute(cloud, i)));'
            'const spread = axis => { const all = points.map(p => p[axis]).sort((a, b) => a - b);'
            'return all[Math.floor(0.98 * all.length)] - all[Math.floor(0.02 * all.length)]; };'
            "return [inside(keyframes(document.getElementById('data'))), inside(points), spread(0),"
            'spread(1)]; })()')
        self.assertEqual(keyframes, 1)
        self.assertGreater(points, 0.98)
        self.assertGreater(max(width, height), 0.75)
        panel = page.evaluate("(() => { const p = document.getElementById('panel')"
                              '.getBoundingClientRect(), a = viewfixMap.freeArea();'
                              'return [p.right <= a.x || p.bottom <= a.y,'
                              'a.width * a.height / innerWidth / innerHeight]; })()')
        self.assertTrue(panel[0], 'the panel covers none of it')
        self.assertGreater(panel[1], 0.5)

    def test_the_map_comes_nearer_to_a_location(self):
        page = self.visit_map('map_location', **PHONE)
        away = 'viewfixMap.camera.position.length()'
        before = page.evaluate(away)
        for i in range(10):
            page.evaluate(f"document.querySelectorAll('#legend button')[{i}].click()")
            self.assertTrue(page.evaluate(f'Number.isFinite({away})'))
        self.assertNotEqual(page.evaluate(away), before)
        self.assertEqual(page.faults, [])

    def test_the_walk_moves_a_camera(self):
        page = self.visit_map('walk', **PHONE, dark=True)
        self.assertEqual(page.evaluate("document.getElementById('step').max"), '4')
        at = 'JSON.stringify(viewfixMap.state.mover.geometry.boundingSphere.center)'
        before = page.evaluate(at)
        page.evaluate("document.getElementById('follow').click()")
        page.evaluate("document.getElementById('play').click()")
        page.wait_for(f"{at} !== '{before}'")
        self.assertIn('of 5', page.evaluate("document.getElementById('step_text').innerText"))
        self.assertGreater(self.colours_of_map(page), 5)
        self.assertEqual(page.faults, [])

    def test_fixes_that_are_none_are_refused(self):
        broken = self.folder / 'broken.jsonl'
        for line in ('{"pose": {"t": [1, 2], "q_xyzw": [0, 0, 0, 1]}}', '[]', 'text', '{}'):
            broken.write_text('{"pose": null}\n' + line + '\n', encoding='utf-8')
            run = subprocess.run([PROGRAMS.viewfix, 'map', self.folder / 'm.vfx', '--out',
                                  self.folder / 'none.html', '--fixes', broken],
                                 capture_output=True, text=True, check=False)
            self.assertEqual(run.returncode, 1, line)
            self.assertIn(f'{broken}: line 2: ', run.stderr)
        self.assertFalse((self.folder / 'none.html').exists())

    def test_the_json_has_every_number(self):
        shown = json.loads(re.search(r'id="data">(.*?)</script>',
                                     self.report.read_text(encoding='utf-8'), re.S).group(1))
        self.assertEqual(shown['figures'], json.loads(self.json.read_text(encoding='utf-8')))

    def test_it_is_one_small_file(self):
        text = self.report.read_text(encoding='utf-8')
        self.assertLess(len(text), 3_000_000)
        self.assertIsNone(re.search(r'(?:src|href)="(?!data:)', text))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--viewfix', required=True)
    parser.add_argument('--screenshots', default='')
    parser.parse_args(namespace=PROGRAMS)
    if browser.find() is None:
        print('Chromium is not installed')
        sys.exit(77)
    unittest.main(argv=sys.argv[:1])


if __name__ == '__main__':
    main()
