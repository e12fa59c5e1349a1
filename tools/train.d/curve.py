"""The loss curve as CSV and as SVG."""

import csv

COLOURS = {"training loss": "#7f7f7f", "validation loss": "#1f77b4", "1 - SSIM-2D": "#d62728", "MSE x 10": "#2ca02c"}
WIDTH, HEIGHT, LEFT, BOTTOM = 760, 420, 60, 50


def write(history, csv_path, svg_path, title):
    fields = ["minutes", "step", "rate", "loss", "validation_loss", "ssim2", "ssim3", "mse"]
    with open(csv_path, "w", newline="") as file:
        rows = csv.DictWriter(file, fields, lineterminator="\n")
        rows.writeheader()
        rows.writerows({key: f"{row[key]:.6g}" for key in fields} for row in history)
    series = {
        "training loss": [(row["minutes"], row["loss"]) for row in history],
        "validation loss": [(row["minutes"], row["validation_loss"]) for row in history],
        "1 - SSIM-2D": [(row["minutes"], 1 - row["ssim2"]) for row in history],
        "MSE x 10": [(row["minutes"], 10 * row["mse"]) for row in history],
    }
    with open(svg_path, "w") as file:
        file.write(svg(series, title))


def svg(series, title):
    right = max([x for points in series.values() for x, _ in points] or [1.0]) or 1.0
    top = max([y for points in series.values() for _, y in points] or [1.0]) or 1.0

    def at(x, y):
        return f"{LEFT + x / right * (WIDTH - LEFT - 20):.1f},{HEIGHT - BOTTOM - y / top * (HEIGHT - BOTTOM - 40):.1f}"

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="12">']
    out.append(f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/><text x="{LEFT}" y="22" font-size="14">{title}</text>')
    for k in range(6):
        x, y = right * k / 5, top * k / 5
        px, _ = at(x, 0).split(",")
        _, py = at(0, y).split(",")
        out.append(f'<line x1="{LEFT}" y1="{py}" x2="{WIDTH - 20}" y2="{py}" stroke="#dddddd"/>')
        out.append(f'<text x="{LEFT - 6}" y="{float(py) + 4}" text-anchor="end">{y:.3g}</text>')
        out.append(f'<text x="{px}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{x:.3g}</text>')
    out.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 12}" text-anchor="middle">minutes</text>')
    for k, (name, points) in enumerate(series.items()):
        line = " ".join(at(x, y) for x, y in points)
        out.append(f'<polyline points="{line}" fill="none" stroke="{COLOURS[name]}" stroke-width="1.5"/>')
        y = 50 + 16 * k
        out.append(f'<rect x="{WIDTH - 170}" y="{y - 9}" width="10" height="10" fill="{COLOURS[name]}"/><text x="{WIDTH - 154}" y="{y}">{name}</text>')
    return "\n".join([*out, "</svg>", ""])
