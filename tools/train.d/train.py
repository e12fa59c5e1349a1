"""Trains a network on examples: train.py --data DIR --out DIR [options]; --help lists them. tools/train prepares what it needs."""

import argparse
import json
import pathlib
import time

import curve
import report
import torch
from data import Examples
from loss import LOSSES
from network import INJECTIONS, LABELS, Shape, write
from session import Session, processor

# Seconds between checkpoints, and between validations where an epoch takes longer.
SAVED, JUDGED = 60, 300
# An epoch without better validation halves the rate after two and ends a training without --minutes after five.
STALE = 5


def arguments():
    parser = argparse.ArgumentParser(prog="train.py", description=__doc__)
    parser.add_argument("--data", type=pathlib.Path, required=True, help="folder with train*, validation* and unseen*, each of `cao examples`")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder of this training; goes on where one ended there")
    parser.add_argument("--minutes", type=float, help="train so long; without it until validation gets no better")
    parser.add_argument("--epochs", type=int, default=50, help="at most so many without --minutes [50]")
    parser.add_argument("--label", choices=LABELS, default="mean")
    parser.add_argument("--injection", choices=INJECTIONS, default="preclassified")
    parser.add_argument("--loss", choices=LOSSES, default="ssim2+mse")
    for name, value in (("edge", 64), ("filters", 8), ("cap", 64), ("levels", 5), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=value, help=f"[{value}]")
    parser.add_argument("--threads", type=int, help="of the processor [all]")
    parser.add_argument("--plan", action="store_true", help="say what it would take, and do nothing else")
    return parser.parse_args()


def sets(folder, name, args):
    found = sorted(path.parent for path in folder.glob(f"{name}*/examples.json"))
    return Examples(found, args.label, args.injection) if found else None


def open_session(args, shape):
    examples = sets(args.data, "train", args)
    checks = {name: sets(args.data, name, args) for name in ("validation", "unseen")}
    checks = {name: found for name, found in checks.items() if found}
    if not examples or "validation" not in checks:
        raise SystemExit(f"{args.data}: expected folders train… and validation… of `cao examples`")
    if examples.edge != args.edge:
        raise SystemExit(f"{args.data}: cubes of {examples.edge} voxels, asked for {args.edge}")
    settings = {"shape": shape, "injection": args.injection, "loss": args.loss, "seed": args.seed, "minutes": args.minutes}
    return Session(settings, examples, checks)


def state(session, seconds, args):
    """What it will take, before it starts."""
    weights = sum(weight.numel() for weight in session.net.parameters())
    epoch = seconds * len(session.examples) / 60
    lines = [
        f"{processor()}: {seconds:.3f} s a step in {str(session.net.precision).removeprefix('torch.')}; {weights:,} weights; "
        f"{len(session.examples)} examples, {epoch:.1f} minutes an epoch",
    ]
    if args.minutes is None:
        lines.append(f"will take at most {args.epochs} epochs, {args.epochs * epoch:.0f} minutes")
    else:
        left = max(args.minutes - session.seconds / 60, 0)
        lines.append(f"will take {left:.1f} minutes, about {left / max(epoch, 1e-9):.1f} epochs")
    print("\n".join(lines), flush=True)


def over(session, args):
    if args.minutes is not None:
        return session.seconds >= 60 * args.minutes
    return session.stale >= STALE or session.epochs > args.epochs


def train(session, args):
    """Steps until it is over."""
    last = {"saved": time.perf_counter(), "judged": time.perf_counter(), "epoch": session.epochs}
    tick = time.perf_counter()
    while not over(session, args):
        if args.minutes is not None:
            session.cooled(session.seconds / 60 / args.minutes)
        session.step()
        now = time.perf_counter()
        session.seconds, tick = session.seconds + now - tick, now
        ended = not session.order
        if ended or (args.minutes is not None and now - last["judged"] > JUDGED):
            row = session.validate()
            say(session, row)
            files(session, args)
            now = tick = last["judged"] = time.perf_counter()
        if now - last["saved"] > SAVED:
            session.save(args.out / "checkpoint.pt")
            last["saved"] = tick = time.perf_counter()
    if session.count:
        say(session, session.validate())
    session.save(args.out / "checkpoint.pt")


def say(session, row):
    print(
        f"{row['minutes']:7.1f} min  step {row['step']:6}  epoch {session.epochs:3}  rate {row['rate']:.2e}  loss {row['loss']:.4f}  "
        f"validation {row['validation_loss']:.4f}: SSIM-2D {row['ssim2']:.3f}  SSIM-3D {row['ssim3']:.3f}  MSE {row['mse']:.5f}",
        flush=True,
    )


def files(session, args):
    shape = session.settings["shape"]
    title = f"label {shape.label}, {shape.filters} filters, {session.settings['injection']}, {session.settings['loss']}"
    curve.write(session.history, args.out / "curve.csv", args.out / "curve.svg", title)


def finish(session, args):
    """Judges the weights as files have them and writes everything."""
    with torch.no_grad():
        for weight in session.net.parameters():
            weight.copy_(weight.to(torch.float16))
    judged = session.judge()
    described = report.card(session, processor(), judged)
    weights = sum(weight.numel() for weight in session.net.parameters())
    digest = None
    if args.injection == "preclassified":
        digest = write(args.out / "network.net", session.net, described)
    (args.out / "report.md").write_text(report.markdown(session, described, judged, weights, digest))
    (args.out / "judged.json").write_text(json.dumps({"card": described, "weights": weights, "examples": judged}, indent=1) + "\n")
    files(session, args)


def main():
    args = arguments()
    if args.threads:
        torch.set_num_threads(args.threads)
    shape = Shape(args.edge, args.filters, args.cap, args.levels, args.label)
    session = open_session(args, shape)
    seconds = session.choose()
    args.out.mkdir(parents=True, exist_ok=True)
    if (args.out / "checkpoint.pt").exists():
        session.restore(args.out / "checkpoint.pt")
        print(f"goes on from step {session.steps}, {session.seconds / 60:.1f} minutes")
    state(session, seconds, args)
    if not args.plan:
        train(session, args)
        finish(session, args)


if __name__ == "__main__":
    main()
