"""What tools/train may be told. Standard library only, so that a mistake is found before anything is installed.

Run by itself it checks its arguments and prints what the script needs of them as assignments of a shell.
"""

import argparse
import pathlib
import shlex
import sys

USAGE = """\
Trains the network of deep volumetric ambient occlusion: tools/train [options]

Makes examples of phantoms and of the volumes of tools/get-data, fetches PyTorch (200 MB; some GB
with CUDA) into its folder, says what it will take, trains, and writes into FOLDER/runs/NAME
network.net, report.md, curve.csv and curve.svg. A second run goes on where the first ended.

  --minutes N       train so long             [default: until validation gets no better]
  --steps N         so many steps instead, the same on any machine
  --label L         mean transmittance of rays, or at their end: mean, end [default: mean]
  --filters N --cap N --levels N --edge N   shape           [default: 8, 64, 5, 64]
  --injection I     preclassified, global, latent           [default: preclassified]
  --loss L          mse, ssim2, ssim3, ssim2+mse, ssim3+mse [default: ssim2+mse]
  --seed N          of weights, examples, order             [default: 1]
  --examples N      to train on                             [default: 450]
  --phantoms        no volumes but built-in ones: fetch none
  --threads N       of the processor                        [default: all]
  --folder DIR      where everything is kept                [default: target/train]
  --run NAME        of this training        [default: of label, filters, injection, loss]
  --suite           three injections, five losses, three sizes, one after the other; --minutes
                    are for all of them, --steps for each
  --check           check what trains against PyTorch's own operations, and do nothing else
  --plan            say what it would take, and do not train
  --pack DIR        only make everything that a machine without network needs; copy it there
                    with the repository, and then
  --from DIR        train with what was packed: with the machine's own PyTorch, else the packed one
  --help
"""

LABELS = ("mean", "end")
INJECTIONS = ("preclassified", "global", "latent")
LOSSES = ("mse", "ssim2", "ssim3", "ssim2+mse", "ssim3+mse")


class Parser(argparse.ArgumentParser):
    def error(self, message):
        print(f"train: {message}; see tools/train --help", file=sys.stderr)
        sys.exit(2)

    def print_help(self, file=None):
        print(USAGE, end="", file=file)


def whole(least, most):
    def parse(text):
        if not text.isascii() or not text.isdigit() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number, {least} to {most}")
        return int(text)

    return parse


def minutes(text):
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0.0 < number < 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: expected minutes > 0")
    return number


def parser():
    found = Parser(prog="train")
    add = found.add_argument
    add("--minutes", type=minutes)
    add("--steps", type=whole(1, 10**9))
    add("--label", choices=LABELS, default="mean")
    for name, value, least, most in (("filters", 8, 1, 1024), ("cap", 64, 1, 1024), ("levels", 5, 1, 9), ("edge", 64, 16, 512)):
        add(f"--{name}", type=whole(least, most), default=value)
    add("--injection", choices=INJECTIONS, default="preclassified")
    add("--loss", choices=LOSSES, default="ssim2+mse")
    add("--seed", type=whole(0, 2**32 - 1), default=1)
    add("--examples", type=whole(1, 100_000), default=450)
    add("--phantoms", action="store_true")
    add("--threads", type=whole(1, 1024))
    add("--folder", type=pathlib.Path)
    add("--run")
    add("--suite", action="store_true")
    add("--plan", action="store_true")
    add("--check", action="store_true")
    add("--pack", type=pathlib.Path)
    add("--from", dest="packed", type=pathlib.Path)
    # Where the script found or made the examples.
    add("--data", type=pathlib.Path, help=argparse.SUPPRESS)
    return found


def parse(given=None):
    args = parser().parse_args(given)
    if args.cap < args.filters:
        parser().error(f"--cap {args.cap}: expected at least as many as --filters, {args.filters}")
    if args.edge % (1 << args.levels):
        parser().error(f"--edge {args.edge}: expected a multiple of {1 << args.levels} for {args.levels} levels")
    if args.pack and args.packed:
        parser().error("--pack and --from: expected one of them")
    if args.minutes and args.steps:
        parser().error("--minutes and --steps: expected one of them")
    if args.suite and not (args.minutes or args.steps or args.pack):
        parser().error("--suite needs --minutes, for all of its runs together, or --steps, for each")
    args.run = args.run or f"{args.label}-{args.filters}-{args.injection}-{args.loss}"
    return args


def main():
    args = parse()
    # Paths are from where the user stands.
    path = lambda value: str(value.absolute()) if value else ""
    values = {
        "folder": path(args.folder),
        "pack": path(args.pack),
        "packed": path(args.packed),
        "label": args.label,
        "edge": args.edge,
        "seed": args.seed,
        "examples": args.examples,
        "phantoms": "yes" if args.phantoms else "",
        "program": "check.py" if args.check else "suite.py" if args.suite else "train.py",
    }
    for name, value in values.items():
        print(f"{name}={shlex.quote(str(value))}")


if __name__ == "__main__":
    main()
