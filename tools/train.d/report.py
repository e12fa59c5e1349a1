"""The report of a training: its card, which goes into the weights, and report.md."""

import datetime
import statistics

ERRORS = ("ssim2", "ssim3", "mse", "bias", "variance")


def grouped(judged, key):
    """Means of the errors by a key of the rows, in the order in which they come."""
    groups = {}
    for row in judged:
        groups.setdefault(key(row), []).append(row)
    return {name: {"examples": len(rows)} | {e: statistics.mean(row[e] for row in rows) for e in ERRORS} for name, rows in groups.items()}


def card(session, processor, precision, judged):
    """What weights say of themselves: strings and numbers only."""
    settings = session.settings
    credits = {row["credit"] for row in session.examples.list}
    sources = {row["source"] for row in session.examples.list}
    out = {
        "trained": datetime.date.today().isoformat(),
        "injection": settings["injection"],
        "loss": settings["loss"],
        "seed": settings["seed"],
        "examples": len(session.examples),
        "sources": ", ".join(sorted(sources)),
        "data": "; ".join(sorted(credits)),
        "steps": session.steps,
        "minutes": round(session.seconds / 60, 1),
        "processor": processor,
        "precision": precision,
    }
    for name, group in grouped(judged, lambda row: row["set"]).items():
        out |= {f"{name} {error}": round(group[error], 5) for error in ("ssim2", "ssim3", "mse")}
    return out


def table(groups, first):
    lines = [f"| {first} | examples | SSIM-2D | SSIM-3D | MSE | bias | variance of the truth |", "|---|---|---|---|---|---|---|"]
    for name, g in groups.items():
        lines.append(f"| {name} | {g['examples']} | {g['ssim2']:.3f} | {g['ssim3']:.3f} | {g['mse']:.5f} | {g['bias']:+.4f} | {g['variance']:.4f} |")
    return lines


def markdown(session, card, judged, weights, digest):
    shape = session.settings["shape"]
    lines = [
        f"# A network of label `{shape.label}`",
        "",
        f"{weights:,} weights: edge {shape.edge}, {shape.filters} filters, at most {shape.cap} channels, {shape.levels} levels."
        + (f" SHA-256 of all but its last 32 bytes, which are it: {digest}." if digest else ""),
        "",
        *[f"* {key}: {value}" for key, value in card.items()],
        "",
        "Errors at the end, with the weights in f16 and everything else in f32, each the mean over examples of the mean over voxels:",
        "",
        *table(grouped(judged, lambda row: row["set"]), "set"),
        "",
        *table(grouped(judged, lambda row: f"{row['set']}, {row['kind']}"), "set, kind"),
        "",
        *table(grouped(judged, lambda row: f"{row['set']}, {row['source']}"), "set, source"),
        "",
        "`validation` are other examples of sources that were trained on, `unseen` those of volumes that were not.",
        "Data that were trained on:",
        "",
        *[f"* {credit}" for credit in sorted({f"{row['source']}: {row['credit']}" for row in session.examples.list})],
        "",
    ]
    return "\n".join(lines)
