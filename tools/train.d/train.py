"""Trains a network on examples; tools/train prepares what it needs."""

import json
import time

import arguments
import curve
import report
import torch
from data import Examples
from network import Shape, write
from session import Session, processor

# Seconds between checkpoints, and between validations with --minutes; without, every epoch is validated.
SAVED, JUDGED = 60, 180
# An epoch without better validation halves the rate after two and ends a training without --minutes after five.
STALE = 5
# Without --minutes at most so many epochs.
EPOCHS = 50


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
    settings = {"shape": shape, "injection": args.injection, "loss": args.loss, "seed": args.seed, "planned": bool(args.minutes or args.steps)}
    return Session(settings, examples, checks)


def state(session, seconds, args):
    """What it will take, before it starts."""
    weights = sum(weight.numel() for weight in session.net.parameters())
    epoch = seconds * len(session.examples) / 60
    lines = [
        f"{processor()}: {seconds:.3f} s a step in {str(session.net.precision).removeprefix('torch.')}; {weights:,} weights; "
        f"{len(session.examples)} examples, {epoch:.1f} minutes an epoch",
    ]
    if args.steps is not None:
        left = max(args.steps - session.steps, 0)
        lines.append(f"will take {left} steps, {left * seconds / 60:.1f} minutes")
    elif args.minutes is None:
        lines.append(f"will take at most {EPOCHS} epochs, {EPOCHS * epoch:.0f} minutes")
    else:
        left = max(args.minutes - session.seconds / 60, 0)
        lines.append(f"will take {left:.1f} minutes, about {left / max(epoch, 1e-9):.1f} epochs")
    print("\n".join(lines), flush=True)


def share(session, args):
    """How much of what was asked for is done."""
    return session.steps / args.steps if args.steps else session.seconds / 60 / args.minutes


def over(session, args):
    if args.minutes or args.steps:
        return share(session, args) >= 1
    return session.stale >= STALE or session.epochs > EPOCHS


def train(session, args):
    """Steps until it is over. All time counts, that of validation too."""
    start = time.perf_counter() - session.seconds
    saved = judged = session.seconds
    while not over(session, args):
        if args.minutes or args.steps:
            session.cooled(share(session, args))
        session.step()
        session.seconds = time.perf_counter() - start
        if session.seconds - judged > JUDGED if args.minutes or args.steps else not session.order:
            say(session, session.validate())
            files(session, args)
            judged = session.seconds
        if session.seconds - saved > SAVED:
            session.save(args.out / "checkpoint.pt")
            saved = session.seconds
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
    precision = str(session.net.precision).removeprefix("torch.")
    session.net.precision = torch.float32
    with torch.no_grad():
        for weight in session.net.parameters():
            weight.copy_(weight.to(torch.float16))
    judged = session.judge()
    described = report.card(session, processor(), precision, judged)
    weights = sum(weight.numel() for weight in session.net.parameters())
    digest = None
    if args.injection == "preclassified":
        digest = write(args.out / "network.net", session.net, described)
    (args.out / "report.md").write_text(report.markdown(session, described, judged, weights, digest))
    (args.out / "judged.json").write_text(json.dumps({"card": described, "weights": weights, "examples": judged}, indent=1) + "\n")
    files(session, args)


def main():
    args = arguments.parse()
    args.out = args.folder / "runs" / args.run
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
