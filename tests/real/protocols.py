#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Figures on real image sets beyond their own split, which no parameter was chosen on (but for
stretches: 122 and 123 in ARCHITECTURE.md).

  tests/real/protocols.py [NAME]...   rotated, gap, floors, corridor, stretches; without NAME all

rotated:  IE Tower, frame number mod 5 = k as test, k = 0..4
gap:      IE Tower, the first 60 % of each clip as training, the last 40 % but three frames as test
floors:   IE Tower, trained on floors 3-9, asked about floors 10-16 and the basements
corridor: RTAB-Map's corridor, first lap as training (areas of ten frames), second as test
stretches: HoloLens with given poses, stretches of the walk as test: the last or the first 40 %, 35 %
          in the middle, every second 40, 20, 10 frames
Looks for the sets in $VIEWFIX_DATA, else ../shared/data. Needs build/host-release. Models, sets and
figures are left in build/real/protocols.
"""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("VIEWFIX_DATA", ROOT / ".." / "shared" / "data")).resolve()
OUT = ROOT / "build" / "real" / "protocols"
VIEWFIX = ROOT / "build" / "host-release" / "bin" / "viewfix"
TOWER_WORDS, USUAL_WORDS = "2000", "500"


def tower():
    """Rows of the set with the number of each frame."""
    with open(DATA / "ie_tower" / "images.csv", newline="") as file:
        return [row | {"number": int(pathlib.Path(row["path"]).stem)} for row in csv.DictReader(file)]


def make_folder(name, images):
    """The folder of a set, with a link to the images of another."""
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    link = folder / "images"
    if not link.exists():
        link.symlink_to(images)
    return folder


def write_set(name, images, rows):
    """A set of (path, location, split) beside a link to the images of another."""
    folder = make_folder(name, images)
    with open(folder / "images.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["path", "location", "split"])
        writer.writerows(rows)
    return folder


def train_and_eval(name, folder, *options, words=TOWER_WORDS):
    model, figures = OUT / f"{name}.vfx", OUT / f"{name}.json"
    with open(OUT / f"{name}.log", "w") as log:
        for command in (["train", folder, "--out", model, "--words", words],
                        ["eval", folder, "--model", model, "--json", figures, *options]):
            subprocess.run([VIEWFIX, *command], check=True, stdout=log, stderr=log)
    return json.loads(figures.read_text())


def describe(name, figures):
    location, refusal = figures["location"], figures["refusal"]
    print(f"{name}: {figures['images']} images, floor {100 * location['by_level'][0]:.1f} %, area "
          f"{100 * location['accuracy']:.1f} %, answered {100 * refusal['answered']:.1f} %, of these "
          f"wrong {100 * refusal['wrong_of_answered']:.1f} %, AUROC "
          f"{figures['confidence']['auroc']:.3f}", flush=True)


def rotated():
    images = DATA / "ie_tower" / "images"
    total = right = answered = wrong = 0
    for k in range(5):
        rows = [(r["path"], r["location"], "test" if r["number"] % 5 == k else "train") for r in tower()]
        figures = train_and_eval(f"rotated{k}", write_set(f"rotated{k}", images, rows))
        describe(f"rotated, k = {k}", figures)
        n = figures["images"]
        said = figures["refusal"]["answered"] * n
        total, right = total + n, right + figures["location"]["accuracy"] * n
        answered, wrong = answered + said, wrong + figures["refusal"]["wrong_of_answered"] * said
    print(f"rotated: area {100 * right / total:.1f} % of {total}, answered "
          f"{100 * answered / total:.1f} %, of these wrong {100 * wrong / answered:.2f} %")


def gap():
    clips = {}
    for row in tower():
        clips.setdefault(row["location"], []).append(row)
    rows = []
    for clip in clips.values():
        clip.sort(key=lambda row: row["number"])
        cut = int(0.6 * len(clip))
        rows += [(r["path"], r["location"], "train") for r in clip[:cut]]
        rows += [(r["path"], r["location"], "test") for r in clip[cut + 3:]]
    describe("gap", train_and_eval("gap", write_set("gap", DATA / "ie_tower" / "images", rows)))


def floors():
    known = {f"floor{n}" for n in range(3, 10)}
    images = DATA / "ie_tower" / "images"
    rows, unknown = [], []
    for row in tower():
        of_known = row["location"].split("/")[0] in known
        (rows if of_known else unknown).append((row["path"], row["location"], row["split"]))
    others = write_set("other_floors", images, [(p, l, "test") for p, l, _ in unknown])
    figures = train_and_eval("floors", write_set("floors", images, rows), "--unknown", others)
    describe("floors", figures)
    print(f"floors: of {figures['unknown']['images']} frames of other floors "
          f"{100 * figures['unknown']['localized']:.1f} % are localized")


def corridor():
    rows = []
    for lap, split in ((0, "train"), (40, "test")):
        rows += [(f"images/{i + lap:03d}.jpg", f"area{(i - 1) // 10}", split) for i in range(1, 41)]
    folder = write_set("corridor", DATA / "rtabmap_corridor" / "images", rows)
    figures = train_and_eval("corridor", folder)
    describe("corridor", figures)
    near = sum(abs(int(frame["location"][4:]) - int(frame["true_location"][4:])) <= 1
               for frame in figures["frames"] if frame["location"])
    print(f"corridor: within one area of the right one {near} of {figures['images']}")


def is_right(frame):
    return frame["translation_error_m"] <= 0.5 and frame["rotation_error_deg"] <= 10


def stretches():
    source = DATA / "hololens"
    with open(source / "images.csv", newline="") as file:
        reader = csv.DictReader(file)
        columns, rows = reader.fieldnames, list(reader)
    size = len(rows)
    splits = {"last": lambda i: i >= 0.6 * size, "first": lambda i: i < 0.4 * size,
              "middle": lambda i: 0.3 * size <= i < 0.65 * size}
    splits |= {f"every_{n}": lambda i, n=n: i // n % 2 == 1 for n in (40, 20, 10)}
    total = given = right = 0
    for name, is_test in splits.items():
        folder = make_folder(f"stretches_{name}", source / "images")
        shutil.copy(source / "calibration.yaml", folder)
        with open(folder / "images.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(row | {"split": "test" if is_test(i) else "train"}
                             for i, row in enumerate(rows))
        figures = train_and_eval(f"stretches_{name}", folder, words=USUAL_WORDS)
        poses = [f for f in figures["frames"] if f["localized"] and f["translation_error_m"] is not None]
        right_here = sum(map(is_right, poses))
        print(f"stretches, {name}: of {figures['images']} images {len(poses)} have a pose, "
              f"{len(poses) - right_here} of these off by more than 0.5 m or 10 degrees", flush=True)
        total, given, right = total + figures["images"], given + len(poses), right + right_here
    print(f"stretches: of {total} images {given} have a pose, {given - right} of these off by more "
          "than 0.5 m or 10 degrees")


def main():
    known = {"rotated": rotated, "gap": gap, "floors": floors, "corridor": corridor,
             "stretches": stretches}
    names = sys.argv[1:] or list(known)
    if any(name not in known for name in names):
        print(__doc__)
        sys.exit(0 if names[0] in ("-h", "--help") else 2)
    if not (DATA / "ie_tower").is_dir():
        print("skipped: no real image sets")
        sys.exit(77)
    OUT.mkdir(parents=True, exist_ok=True)
    for name in names:
        known[name]()


main()
