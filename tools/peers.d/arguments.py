"""What tools/peers may be told. Standard library only, so that a mistake is found before anything is installed.

Run by itself it checks its arguments: silent where they are right, one line and exit code 2 where not.
"""

import argparse
import sys
from pathlib import Path

USAGE = """\
cao and VTK beside each other: tools/peers [VOLUME=builtin:engine:128] [options]

Times both eyes after each move of a clip plane along the path of stereo-bench: VTK plain,
with volumetric scattering, with screen-space occlusion; cao in solid colour, with full
and with contextual updates, by rays and by rays by brick. Same opacities, cameras, light and
step; rounds alternate.
Then: how far VTK's occlusion differs between the eyes, and whether its shadows know of a
clip. The first run downloads VTK (140 MB, into target/peers).

  VOLUME            a file that cao reads, or builtin:NAME:SIZE
  --transfer T      opacity of its values: preset or TOML file    [default: auto]
  --size WxH        pixels of one eye                             [default: 512x512]
  --radius-mm R     of both occlusions    [default: 20 of the smallest spacing]
  --rounds N        visits to each system                         [default: 3]
  --moves N         frames of a visit                             [default: 5]
  --json FILE       all numbers
  -o DIR            table.md, peers.json and the pictures
  --check           a small run that shows that everything works
"""


class Parser(argparse.ArgumentParser):
    def error(self, message):
        print(f"peers: {message}; see tools/peers --help", file=sys.stderr)
        sys.exit(2)


def count(most):
    def parse(text):
        if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number, 1 to {most}")
        return int(text)

    return parse


def length(text):
    try:
        mm = float(text)
    except ValueError:
        mm = -1.0
    if not 0.0 < mm < 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a length > 0 mm")
    return mm


def size(text):
    parts = text.split("x")
    if len(parts) != 2 or not all(p.isascii() and p.isdigit() and 16 <= int(p) <= 4096 for p in parts):
        raise argparse.ArgumentTypeError(f"{text!r}: expected WIDTHxHEIGHT, each 16 to 4096")
    return tuple(int(p) for p in parts)


def output(text):
    path = Path(text)
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: expected a file in a folder that exists")
    return path


def folder(text):
    path = Path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: is a file, expected a folder")
    return path


def volume(text):
    if not text.startswith("builtin:") and not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"{text!r}: no such file; expected one, or builtin:NAME:SIZE")
    return text


def parse(arguments):
    parser = Parser(prog="peers", add_help=False, allow_abbrev=False)
    parser.add_argument("volume", nargs="?", default="builtin:engine:128", type=volume)
    parser.add_argument("--transfer", default="auto")
    parser.add_argument("--size", default=(512, 512), type=size)
    parser.add_argument("--radius-mm", type=length)
    parser.add_argument("--rounds", default=3, type=count(1000))
    parser.add_argument("--moves", default=5, type=count(1000))
    parser.add_argument("--json", type=output)
    parser.add_argument("-o", dest="folder", metavar="DIR", type=folder)
    parser.add_argument("--check", action="store_true")
    given = parser.parse_args(arguments)
    if given.check:
        given.volume, given.size, given.rounds, given.moves = "builtin:engine:32", (64, 64), 1, 3
    return given


if __name__ == "__main__":
    if set(sys.argv[1:]) & {"-h", "--help"}:
        print(USAGE, end="")
    else:
        parse(sys.argv[1:])
