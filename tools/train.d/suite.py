"""The trainings of tables 1 and 2 of DVAO, each for the same time or of the same number of steps, one after the other: five losses with opacity alone, two more
injections with the best loss, three sizes. Ends with tables.md; goes on where it ended."""

import json
import pathlib
import subprocess
import sys

import arguments

HERE = pathlib.Path(__file__).parent
BEST = "ssim2+mse"


def runs(args):
    """Name, injection, loss, filters; the cap is eight times as many."""
    found = [("preclassified", loss, args.filters) for loss in arguments.LOSSES]
    found += [(injection, BEST, args.filters) for injection in ("global", "latent")]
    found += [("preclassified", BEST, filters) for filters in (4, 8, 16)]
    return list(dict.fromkeys(found))


def train(args, run, each):
    injection, loss, filters = run
    name = f"suite-{args.label}-{filters}-{injection}-{loss}"
    done = args.folder / "runs" / name / "judged.json"
    if not done.exists():
        command = [sys.executable, "-B", HERE / "train.py", "--folder", args.folder, "--data", args.data, "--run", name]
        command += ["--injection", injection, "--loss", loss, "--filters", filters, "--cap", 8 * filters, *each]
        command += ["--label", args.label, "--edge", args.edge, "--levels", args.levels, "--seed", args.seed]
        command += ["--threads", args.threads] if args.threads else []
        print(f"--- {name}", flush=True)
        subprocess.run([str(word) for word in command], check=True)
    return json.loads(done.read_text())


def tables(args, found, each):
    lines = [f"Label `{args.label}`, {args.edge}³ voxels, {each[0]} {each[1]} each, seed {args.seed}.", ""]
    lines += ["| injection | loss | filters | weights | steps | SSIM-2D | SSIM-3D | MSE | unseen SSIM-2D | unseen MSE |", "|---" * 10 + "|"]
    for (injection, loss, filters), judged in found.items():
        card = judged["card"]
        errors = [card.get(f"validation {e}") for e in ("ssim2", "ssim3", "mse")] + [card.get(f"unseen {e}") for e in ("ssim2", "mse")]
        shown = ["–" if e is None else f"{e:.4f}" for e in errors]
        lines.append(" | ".join([f"| {injection}", loss, str(filters), f"{judged['weights']:,}", str(card["steps"]), *shown]) + " |")
    return "\n".join([*lines, ""])


def main():
    args = arguments.parse()
    wanted = runs(args)
    each = ("--steps", args.steps) if args.steps else ("--minutes", round(args.minutes / len(wanted), 2))
    print(f"{len(wanted)} trainings with {each[0]} {each[1]} each", flush=True)
    if args.plan:
        return
    found = {run: train(args, run, each) for run in wanted}
    (args.folder / "tables.md").write_text(tables(args, found, each))
    print(f"wrote {args.folder / 'tables.md'}")


if __name__ == "__main__":
    main()
