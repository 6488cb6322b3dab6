#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Proves that the structural checks find what they are there to find."""

import pathlib
import subprocess
import tempfile
import unittest

import check_links
import check_tree

SPDX = '// SPDX-License-Identifier: BSD-3-Clause\n'


class TreeTest(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name).resolve()

    def write(self, path, text):
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def faults_of(self, path, *includes):
        """The faults of a tree whose only file includes these."""
        self.write(path, SPDX + ''.join(f'#include {name}\n' for name in includes))
        return list(check_tree.faults(self.root))

    def assert_forbidden(self, path, include):
        found = self.faults_of(path, '<vector>', include)
        self.assertEqual(len(found), 1, f'{path} includes {include}: {found}')
        self.assertTrue(found[0].startswith(f'{path}:3: '), found)

    def test_allowed_includes_pass(self):
        for path, include in [
            ('engine/localizer.cc', '"models/model_view.h"'),
            ('engine/pose/solver.cc', '<ceres/tiny_solver.h>'),
            ('engine/pose/solver.cc', '<Eigen/Core>'),
            ('engine/viewfix.h', '<stdint.h>'),
            ('models/model_view.cc', '"flatbuffers/flatbuffers.h"'),
            ('models/model_view.h', '"engine/base/status.h"'),
            ('platform/camera/jpeg_decoder.cc', '<jpeglib.h>'),
            ('platform/camera/replay.cc', '<filesystem>'),
            ('platform/daemon/main.cc', '"engine/localizer.h"'),
            ('firmware_tools/training/train.cc', '<opencv2/core.hpp>'),
            ('firmware_tools/training/train.cc', '"models/model_writer.h"'),
            ('tests/engine/surf_test.cc', '<opencv2/core.hpp>'),
        ]:
            with self.subTest(path=path, include=include):
                self.setUp()
                self.assertEqual(self.faults_of(path, include), [])

    def test_forbidden_includes_are_found(self):
        for path, include in [
            ('engine/localizer.cc', '<opencv2/core.hpp>'),
            ('engine/localizer.cc', '<ceres/ceres.h>'),
            ('engine/localizer.cc', '"platform/clock.h"'),
            ('engine/localizer.cc', '"firmware_tools/common/parallel.h"'),
            ('engine/localizer.cc', '"models/model_writer.h"'),
            ('engine/localizer.cc', '"tests/helper.h"'),
            ('engine/localizer.cc', '<unistd.h>'),
            ('engine/localizer.cc', '<stdio.h>'),
            *(('engine/features/surf.cc', f'<{header}>') for header in
              ('fstream', 'iostream', 'thread', 'chrono', 'cstdio', 'filesystem', 'mutex')),
            ('engine/base/status.h', '"engine/localizer.h"'),
            ('engine/base/status.h', '"models/model_view.h"'),
            ('models/model_view.cc', '"engine/features/surf.h"'),
            ('models/model_view.cc', '"models/model_writer.h"'),
            ('models/model_view.cc', '<unistd.h>'),
            ('platform/daemon/main.cc', '"firmware_tools/dataset/image_set.h"'),
            ('platform/daemon/main.cc', '"engine/features/surf.h"'),
            ('platform/daemon/main.cc', '"models/model_writer.h"'),
            ('platform/camera/frame.cc', '<opencv2/core.hpp>'),
            ('platform/camera/frame.cc', '<nlohmann/json.hpp>'),
            ('firmware_tools/cli/main.cc', '"tests/helper.h"'),
        ]:
            with self.subTest(path=path, include=include):
                self.setUp()
                self.assert_forbidden(path, include)

    def test_a_relative_spelling_does_not_hide_an_include(self):
        self.write('firmware_tools/tool.h', SPDX)
        self.assert_forbidden('engine/localizer.cc', '"../firmware_tools/tool.h"')

    def test_an_indented_include_is_seen(self):
        self.write('engine/a.cc', SPDX + '#ifdef X\n#  include <cstdio>\n#endif\n')
        self.assertEqual(list(check_tree.faults(self.root)),
                         ['engine/a.cc:3: engine must not include <cstdio>'])

    def test_a_stray_top_level_entry_is_found(self):
        self.write('docs/guide.md', 'text')
        self.write('.hidden', 'text')
        self.write('build/output', 'text')
        self.assertEqual(list(check_tree.faults(self.root)),
                         ['docs: not one of the entries allowed at the top level'])

    def test_a_large_file_is_found(self):
        self.write('tests/golden/fits', 'x' * check_tree.MAX_BYTES)
        self.write('tests/golden/large', 'x' * (check_tree.MAX_BYTES + 1))
        found = list(check_tree.faults(self.root))
        self.assertEqual(len(found), 1)
        self.assertTrue(found[0].startswith('tests/golden/large: '))

    def test_a_source_without_licence_line_is_found(self):
        self.write('engine/a.cc', '#include <vector>\n')
        self.write('tests/run', '#!/bin/sh\necho\n')
        self.write('tests/good', f'#!/bin/sh\n# {check_tree.SPDX}\n')
        self.write('tests/notes.md', 'text')
        found = [fault.split(':')[0] for fault in check_tree.faults(self.root)]
        self.assertEqual(found, ['engine/a.cc', 'tests/run'])


class LinksTest(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.dir = pathlib.Path(folder.name)

    def compile(self, source, output, *options):
        command = ['c++', '-x', 'c++', '-', '-o', str(self.dir / output), *options]
        subprocess.run(command, input=source, text=True, check=True)
        return str(self.dir / output)

    def archive(self, source):
        self.compile(source, 'part.o', '-c')
        path = str(self.dir / 'libpart.a')
        subprocess.run(['ar', 'rcs', path, str(self.dir / 'part.o')], check=True)
        return path

    def test_pure_code_and_the_standard_library_pass(self):
        program = self.compile('int main() { return 0; }', 'program')
        engine = self.archive('#include <vector>\nint f() { return (int)std::vector<int>(3).size(); }')
        self.assertEqual(list(check_links.faults(program, engine, program)), [])

    def test_a_laptop_library_is_found(self):
        self.compile('int f() { return 0; }', 'libopencv_core.so', '-shared', '-fPIC',
                     '-Wl,-soname,libopencv_core.so.406')
        program = self.compile('int f(); int main() { return f(); }', 'program', f'-L{self.dir}',
                               '-Wl,--no-as-needed', '-Xlinker', '-lopencv_core')
        engine = self.archive('int g() { return 0; }')
        for found in (list(check_links.faults(program, engine, None)),
                      list(check_links.faults(engine, engine, program))):
            self.assertEqual(len(found), 1)
            self.assertIn('libopencv_core.so.406', found[0])

    def test_files_threads_clocks_and_printing_in_the_engine_are_found(self):
        program = self.compile('int main() { return 0; }', 'program')
        for name, code in {
            'fopen': '#include <cstdio>\nvoid* f() { return fopen("x", "r"); }',
            'puts': '#include <cstdio>\nvoid f() { printf("x\\n"); }',
            'std::cout': '#include <iostream>\nvoid f() { std::cout << 1; }',
            'std::thread': '#include <thread>\nvoid f() { std::thread([] {}).join(); }',
            'std::chrono': '#include <chrono>\nlong f() {'
                           ' return std::chrono::steady_clock::now().time_since_epoch().count(); }',
            'clock_gettime': '#include <ctime>\nvoid f() { timespec t; clock_gettime(CLOCK_REALTIME, &t); }',
        }.items():
            with self.subTest(name=name):
                found = list(check_links.faults(program, self.archive(code), None))
                self.assertTrue(any(f'uses {name}' in fault for fault in found), found)


if __name__ == '__main__':
    unittest.main()
