#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks the tree against ARCHITECTURE.md: which part includes what, what stands
at the top level, file sizes and SPDX lines. Prints one line a fault.

  check_tree.py [ROOT]
"""

import pathlib
import re
import subprocess
import sys

ROOT_ENTRIES = {
    'CMakeLists.txt', 'engine', 'platform', 'models', 'toolchains', 'tests', 'firmware_tools',
    'README.md', 'ARCHITECTURE.md', 'CHANGELOG.md', 'LICENSE', 'CMakePresets.json'
}
PARTS = ('engine', 'platform', 'models', 'toolchains', 'tests', 'firmware_tools')
MAX_BYTES = 1 << 20
SPDX = 'SPDX-License-Identifier: BSD-3-Clause'
SOURCE_SUFFIXES = {'.h', '.cc', '.c', '.fbs', '.py', '.sh', '.cmake'}
CXX_SUFFIXES = {'.h', '.cc', '.c'}

# Standard headers that mean a file, a thread, a clock or printing.
IO_HEADERS = (r'(barrier|chrono|condition_variable|csignal|cstdio|ctime|execution|filesystem|'
              r'fstream|future|iomanip|ios|iostream|istream|latch|mutex|ostream|semaphore|'
              r'shared_mutex|stdio\.h|stop_token|streambuf|strstream|syncstream|thread)$')
LAPTOP_HEADERS = r'(opencv2/|opencv/|ceres/|colmap/|dlib/|nlohmann/|CLI/|sqlite3\.h|svm\.h|linear\.h)'


class Part:
    """What the files of one part may include.

    own: pattern of the project's headers it may include.
    external: pattern of other headers with a folder or .h in their name it may include.
    banned: pattern of other headers it may not include.
    """

    def __init__(self, name, files, own, external=r'', banned=r'(?!)'):
        self.name = name
        self.files = re.compile(files)
        self.own = re.compile(own)
        self.external = re.compile(external)
        self.banned = re.compile(banned)


# The first part whose pattern matches a file's path is the file's part.
RULES = (
    Part('what the processor can do', r'engine/base/cpu_path', own=r'engine/base/',
         external=r'sys/auxv\.h$', banned=IO_HEADERS),
    Part('engine/base', r'engine/base/', own=r'engine/base/', external=r'Eigen/|std\w+\.h$',
         banned=IO_HEADERS),
    Part('engine', r'engine/', own=r'engine/|models/model_view\.h$',
         external=r'Eigen/|immintrin\.h$|arm_neon\.h$|ceres/tiny_solver\.h$|std\w+\.h$',
         banned=IO_HEADERS),
    Part('model writer', r'models/model_writer', own=r'engine/|models/',
         banned=r'opencv2/|ceres/'),
    Part('model reader', r'models/', own=r'engine/base/|models/(?!model_writer)',
         external=r'flatbuffers/|sodium\.h$|std\w+\.h$'),
    Part('platform', r'platform/',
         own=r'platform/|models/(?!model_writer)|engine/(localizer\.h|fix_filter\.h|viewfix\.h|base/|image/|geometry/|pose/motion_model\.h$)',
         banned=LAPTOP_HEADERS),
    Part('firmware_tools', r'firmware_tools/', own=r'engine/|models/|platform/|firmware_tools/'),
)

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def project_files(root):
    """Paths, relative to root, of the files that are or would be tracked."""
    git = subprocess.run(
        ['git', '-C', str(root), 'ls-files', '-co', '--exclude-standard', '-z'],
        capture_output=True, check=False)
    if git.returncode == 0 and (root / '.git').exists():
        paths = [pathlib.PurePosixPath(p) for p in git.stdout.decode().split('\0') if p]
    else:
        paths = [pathlib.PurePosixPath(p.relative_to(root).as_posix())
                 for p in root.rglob('*') if p.is_file()]
    return sorted(p for p in paths
                  if p.parts[0] not in ('.git', 'build') and '__pycache__' not in p.parts
                  and (root / p).is_file())


def own_header(root, path, name):
    """The header's path from the root if it is the project's, however it is spelled."""
    if name.split('/')[0] in PARTS:
        return name
    beside = (root / path.parent / name).resolve()
    if beside.is_file() and beside.is_relative_to(root):
        return beside.relative_to(root).as_posix()
    return None


def include_fault(root, path, part, quote, name):
    """Why this include is forbidden, or None."""
    header = own_header(root, path, name)
    if header is not None:
        return None if part.own.match(header) else f'{part.name} must not include {header}'
    if part.banned.match(name):
        return f'{part.name} must not include <{name}>'
    is_standard = quote == '<' and '/' not in name and '.' not in name
    if is_standard or part.external.match(name):
        return None
    return f'{part.name} must not include <{name}>'


def include_faults(root, paths):
    for path in paths:
        if path.suffix not in CXX_SUFFIXES:
            continue
        part = next((p for p in RULES if p.files.match(str(path))), None)
        if part is None:
            continue
        text = (root / path).read_text(encoding='utf-8', errors='replace')
        for match in INCLUDE.finditer(text):
            fault = include_fault(root, path, part, *match.groups())
            if fault:
                line = text.count('\n', 0, match.start(1)) + 1
                yield f'{path}:{line}: {fault}'


def top_level_faults(paths):
    entries = {p.parts[0] for p in paths}
    for entry in sorted(entries - ROOT_ENTRIES):
        if not entry.startswith('.'):
            yield f'{entry}: not one of the entries allowed at the top level'


def size_faults(root, paths):
    for path in paths:
        size = (root / path).stat().st_size
        if size > MAX_BYTES:
            yield f'{path}: {size} bytes; a file in the repository has at most {MAX_BYTES}'


def is_source(path, lines):
    return path.suffix in SOURCE_SUFFIXES or (bool(lines) and lines[0].startswith('#!'))


def spdx_faults(root, paths):
    for path in paths:
        with open(root / path, encoding='utf-8', errors='replace') as file:
            lines = [file.readline(), file.readline()]
        if not is_source(path, lines):
            continue
        line = lines[1] if lines[0].startswith('#!') else lines[0]
        if SPDX not in line:
            yield f'{path}: does not begin with "{SPDX}"'


def faults(root):
    root = pathlib.Path(root).resolve()
    paths = project_files(root)
    yield from top_level_faults(paths)
    yield from size_faults(root, paths)
    yield from spdx_faults(root, paths)
    yield from include_faults(root, paths)


def main():
    if len(sys.argv) > 2 or sys.argv[1:] in (['-h'], ['--help']):
        sys.exit(__doc__)
    root = sys.argv[1] if len(sys.argv) == 2 else pathlib.Path(__file__).parents[2]
    found = list(faults(root))
    print('\n'.join(found) if found else 'The tree is as ARCHITECTURE.md says.')
    sys.exit(1 if found else 0)


if __name__ == '__main__':
    main()
