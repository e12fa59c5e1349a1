"""cao and VTK beside each other: the same opacities, camera, light, step and clip plane, in alternating rounds.

Started by tools/peers, which sees to VTK, to an OpenGL driver and to the programs of this package.
"""

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import vtk_side as vtk
from arguments import parse
from vtkmodules.vtkCommonCore import vtkVersion
from vtkmodules.vtkIOImage import vtkPNGReader, vtkPNGWriter

OURS = {"solid": "solid colour", "lao": "LAO, full update", "cao": "CAO, contextual update"}
# One colour for all: the volume that both read is one of opacities. sRGB.
COLOUR = "#e6d9c4"
BACKGROUND = "#17191d"
AMBIENT, DIFFUSE = 0.6, 0.6
LIGHT = (-0.4, -0.7, 0.6)
FOV_DEG = 35.0
AZIMUTH_DEG, ELEVATION_DEG = 30.0, 25.0
# Where the clip plane's normal points, from the volume's centre as the eyes do: towards them, so that its cut is seen.
CLIP_AZIMUTH_DEG, CLIP_ELEVATION_DEG = 55.0, 50.0
# The isosurface whose screen-space occlusion is compared between the eyes: half of full opacity.
LEVEL = 0.5
# Silhouettes of the two programs' pictures agree at least so far (shared by union): the border pixels, about 1 % of
# them, may differ by how a sample's place and a face's fade are rounded. Less, and the cameras are not the same.
SAME_SILHOUETTE = 0.97
# A floor pixel is called too dark from this difference on, of 255.
TOO_DARK = 40.0


def stop(message, code=1):
    print(f"peers: {message}", file=sys.stderr)
    sys.exit(code)


class Progress:
    """One line on a terminal, nothing in a pipe."""

    def __init__(self):
        self.shown = sys.stderr.isatty()

    def say(self, text):
        if self.shown:
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)

    def end(self):
        self.say("")


# --- files and colours ----------------------------------------------------------------------------------------------


def linear(colour):
    """Linear red, green, blue of "#rrggbb"."""
    values = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb(values):
    values = np.clip(values, 0.0, 1.0)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


def read_nrrd(path):
    """Values [z, y, x] and spacing of an uncompressed f32 NRRD, as `cao occlusion` writes it."""
    header, data = path.read_bytes().split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines() if ": " in line)
    if (fields.get("type"), fields.get("encoding"), fields.get("endian")) != ("float", "raw", "little"):
        raise ValueError(f"{path}: expected raw little-endian floats, found {fields}")
    dims = [int(n) for n in fields["sizes"].split()]
    if "spacings" in fields:
        spacing = [float(s) for s in fields["spacings"].split()]
    else:
        vectors = fields["space directions"].replace("(", "").replace(")", "").split()
        spacing = [math.hypot(*map(float, v.split(","))) for v in vectors]
    return np.frombuffer(data, "<f4").reshape(dims[::-1]).copy(), spacing


def write_nrrd(path, values, spacing):
    sizes = " ".join(str(n) for n in values.shape[::-1])
    header = f"NRRD0004\ntype: float\ndimension: 3\nsizes: {sizes}\nspacings: {' '.join(map(str, spacing))}\n"
    path.write_bytes((header + "endian: little\nencoding: raw\n\n").encode() + values.astype("<f4").tobytes())


def write_png(path, pixels):
    """[row from the top, column, rgb] 0 … 1."""
    height, width = pixels.shape[:2]
    values = np.ascontiguousarray((255.0 * pixels[::-1] + 0.5).astype(np.uint8)).reshape(-1, 3)
    image = vtk.vtkImageData()
    image.SetDimensions(width, height, 1)
    image.GetPointData().SetScalars(vtk.numpy_to_vtk(values, deep=True))
    writer = vtkPNGWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    writer.Write()


def read_png(path):
    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    width, height, _ = image.GetDimensions()
    values = vtk.vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)
    return values[::-1, :, :3] / 255.0


# --- the scene ------------------------------------------------------------------------------------------------------


def direction(azimuth_deg, elevation_deg):
    """From the volume's centre: degrees about +z from -y, and above the xy plane, as cao's flags have them."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array([math.sin(a) * math.cos(e), -math.cos(a) * math.cos(e), math.sin(e)])


class Scene:
    """What both sides draw."""

    def __init__(self, path, size, step, radius, azimuth=AZIMUTH_DEG, elevation=ELEVATION_DEG, light=LIGHT):
        self.path = path
        self.values, self.spacing = read_nrrd(path)
        self.size = size
        smallest = min(self.spacing)
        self.step = step or 0.25 * smallest
        self.radius = radius or 20.0 * smallest
        self.reference = smallest
        self.light = light
        self.diagonal = float(np.linalg.norm(np.array(self.values.shape[::-1]) * self.spacing))
        # The ball around the volume fits into the picture.
        distance = 0.5 * self.diagonal / math.sin(math.radians(0.5 * FOV_DEG))
        self.rig = {
            "position_mm": [float(v) for v in distance * direction(azimuth, elevation)],
            "target_mm": [0.0, 0.0, 0.0],
            "up": [0.0, 0.0, 1.0],
            "ipd_mm": min(distance / 15.0, 63.0),
            "fov_deg": FOV_DEG,
        }
        self.depths = (distance - 0.55 * self.diagonal, distance + 0.55 * self.diagonal)
        self.normal = direction(CLIP_AZIMUTH_DEG, CLIP_ELEVATION_DEG)

    def eyes(self):
        return vtk.eyes(self.rig, self.size[0] / self.size[1], self.depths)

    def clip_point(self, move, moves):
        """Where the plane stands in a move: through the volume's middle tenth, in steps there and back."""
        share = move / max(moves - 1, 1)
        return (0.1 * (share - 0.5) * self.diagonal) * self.normal

    def toml(self, method, clips):
        """The scene file of cao. `clips`: (point, normal) of planes."""
        n = lambda values: "[" + ", ".join(f"{v:.9g}" for v in values) + "]"  # noqa: E731
        lines = [
            f"volume = {json.dumps(str(self.path))}",
            f'transfer = {{ opacity = [[0, 0], [1, 1]], colour = "{COLOUR}", reference_mm = {self.reference} }}',
        ]
        for point, normal in clips:
            # A plane hides the side of its +z; turned about y and then z that is any direction.
            turn = [0.0, math.degrees(math.acos(normal[2])), math.degrees(math.atan2(normal[1], normal[0]))]
            lines += ["[[clip]]", 'shape = "plane"', f"translate_mm = {n(point)}", f"rotate_deg = {n(turn)}"]
        lines += [
            "[occlusion]",
            f'method = "{"lao" if method == "lao" else "cao"}"',
            f"radius_mm = {self.radius}",
            "[stereo]",
            *(f"{k} = {n(v) if isinstance(v, list) else v}" for k, v in self.rig.items()),
            "[image]",
            f"width = {self.size[0]}",
            f"height = {self.size[1]}",
            f"step_mm = {self.step}",
            f'background = "{BACKGROUND}"',
            "[shading]",
            f"ambient = {AMBIENT}",
            f"diffuse = {DIFFUSE}",
            f"light = {n(self.light)}",
            f"occlusion = {'false' if method == 'solid' else 'true'}",
            "",
        ]
        return "\n".join(lines)

    def window(self):
        return vtk.Window(self.size, self.light, tuple(linear(BACKGROUND)))

    def view(self, window):
        return vtk.VolumeView(
            window, self.values, self.spacing, self.step, self.reference, tuple(linear(COLOUR)), AMBIENT, DIFFUSE
        )


def cao(*arguments):
    """Runs the program; its answer as JSON."""
    done = subprocess.run([os.environ["CAO"], *map(str, arguments), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        stop(f"cao {arguments[0]} failed: {done.stderr.strip()}")
    return json.loads(done.stdout)


def picture(scene, method, clips, folder):
    """Our picture of the left eye."""
    file, left, right = (folder / name for name in ("scene.toml", "left.png", "right.png"))
    file.write_text(scene.toml(method, clips))
    cao("render", file, "--eyes", f"{left},{right}")
    return read_png(left)


# --- times ----------------------------------------------------------------------------------------------------------


def ours_round(scene, method, moves, folder):
    """Milliseconds of each move of one round of ours."""
    times = []
    for move in range(moves + 1):
        file = folder / "scene.toml"
        file.write_text(scene.toml(method, [(scene.clip_point(move, moves + 1), scene.normal)]))
        stages = cao("render", file, "--eyes", f"{folder / 'l.png'},{folder / 'r.png'}")["stages_ms"]
        once = ("opacity", "occupancy", "precompute")
        times.append(sum(ms for stage, ms in stages.items() if not stage.startswith(once)))
    return times[1:]


def vtk_round(scene, view, mode, moves):
    """The same of VTK. The move before the first one that counts builds VTK's shaders."""
    view.set_mode(vtk.MODES[mode], scene.radius)
    pair = scene.eyes()
    times = []
    for move in range(moves + 1):
        view.clip(scene.clip_point(move, moves + 1), scene.normal)
        times.append(view.frame(pair))
    return times[1:]


def spread(values):
    """Median, lower and upper quartile."""
    low, median, high = np.percentile(values, (25, 50, 75))
    return float(median), float(low), float(high)


def race(scene, view, rounds, moves, folder, progress):
    """Rows of the table: every method in every round, ours and VTK's by turns."""
    ours, theirs = list(OURS), list(vtk.MODES)
    turns = [t for pair in zip(theirs, (ours + ours)[: len(theirs)]) for t in pair]
    # Ours are fewer: each takes its turn once a round.
    turns = list(dict.fromkeys(turns))
    times = {name: [] for name in turns}
    for number in range(rounds):
        for name in turns:
            progress.say(f"round {number + 1} of {rounds}: {name}")
            if name in OURS:
                times[name].append(ours_round(scene, name, moves, folder))
            else:
                times[name].append(vtk_round(scene, view, name, moves))
    rows = []
    for name in ours + theirs:
        all_times = [ms for one in times[name] for ms in one]
        ratios = [statistics.median(a) / statistics.median(b) for a, b in zip(times[name], times["cao"])]
        (median, low, high), (ratio, ratio_low, ratio_high) = spread(all_times), spread(ratios)
        rows.append({
            "system": "cao" if name in OURS else f"VTK {vtkVersion.GetVTKVersion()}",
            "what": OURS[name] if name in OURS else vtk.MODES[name].what,
            "median_ms": median,
            "low": low,
            "high": high,
            "ratio_to_cao": ratio,
            "ratio_low": ratio_low,
            "ratio_high": ratio_high,
            "runs": len(all_times),
        })
    return rows


def same_silhouette(a, b):
    """Pixels that both pictures cover, by those that either covers."""
    ground = srgb(linear(BACKGROUND))
    covered = [np.abs(p - ground).max(axis=-1) > 0.1 for p in (a, b)]
    return float((covered[0] & covered[1]).sum() / max((covered[0] | covered[1]).sum(), 1))


# --- the two measurements -------------------------------------------------------------------------------------------


def stereo(scene, folder):
    """Screen-space occlusion of VTK at the points that both eyes see, and occlusion in the volume drawn the same way."""
    transfer = folder / "identity.toml"
    transfer.write_text(f'opacity = [[0, 0], [1, 1]]\ncolour = "{COLOUR}"\nreference_mm = {scene.reference}\n')
    file = folder / "ambient.nrrd"
    cao("occlusion", scene.path, "--transfer", transfer, "--radius-mm", scene.radius, "-o", file)
    ambient, _ = read_nrrd(file)
    mesh = vtk.surface(scene.values, scene.spacing, LEVEL)
    pair = scene.eyes()
    tolerance = 0.5 * min(scene.spacing)
    rows = []

    def measure(what, view):
        differences = vtk.between_eyes(view, pair, tolerance)
        if len(differences) == 0:
            stop(f"no point of the isosurface at opacity {LEVEL} is seen by both eyes; choose another volume")
        rows.append({
            "what": what,
            "points": len(differences),
            "mean": float(differences.mean()),
            "p99": float(np.percentile(differences, 99)),
        })

    for samples, blur in ((32, False), (32, True), (320, True)):
        window = vtk.Window(scene.size, scene.light)
        view = vtk.SurfaceView(window, mesh)
        window.set_ssao(samples, scene.radius, scene.diagonal, blur)
        measure(f"VTK SSAO, {samples} samples, {'blurred' if blur else 'not blurred'}", view)
    # What is left here is this measurement's own error: pixels of 8 bits, between pixels.
    view = vtk.SurfaceView(vtk.Window(scene.size, scene.light), vtk.probed(mesh, ambient, scene.spacing), scalars=True)
    measure("occlusion in the volume (cao's), drawn by VTK", view)
    return {"eyes_apart_mm": scene.rig["ipd_mm"], "distance_mm": float(np.linalg.norm(scene.rig["position_mm"])), "rows": rows}


def floor_and_block(size):
    """A floor, and a block that hovers above it: values [z, y, x]; and where a plane between them is, in voxels."""
    values = np.zeros((size, size, size), np.float32)
    values[size // 12 : size // 6] = 1.0
    block = slice(size // 4, 3 * size // 4)
    values[size // 2 : 2 * size // 3, block, block] = 1.0
    return values, size // 3


def clip_shadow(size, pixels, folder):
    """How bright the floor is below a block: really removed, behind a clip plane, outside a cropping box."""
    values, between = floor_and_block(size)
    removed = values.copy()
    removed[between:] = 0.0
    scenes = {}
    for name, data in (("whole", values), ("removed", removed)):
        path = folder / f"{name}.nrrd"
        write_nrrd(path, data, (1.0, 1.0, 1.0))
        scenes[name] = Scene(path, (pixels, pixels), None, size / 4.0, 20.0, 50.0, (-0.3, -0.3, 1.0))
    height = between - 0.5 * (size - 1)
    plane = (np.array([0.0, 0.0, height]), np.array([0.0, 0.0, 1.0]))

    def shown(name, cut):
        scene = scenes[name]
        window = scene.window()
        view = scene.view(window)
        view.set_mode(vtk.MODES["scattering-1"], scene.radius)
        # Nothing but scattering.
        view.mapper.SetVolumetricScatteringBlending(2.0)
        if cut == "plane":
            view.clip(*plane)
        elif cut == "box":
            edge = 0.5 * size
            view.mapper.SetCroppingRegionPlanes(-edge, edge, -edge, edge, -edge, height)
            view.mapper.SetCroppingRegionFlagsToSubVolume()
            view.mapper.CroppingOn()
        view.frame(scene.eyes()[:1])
        return srgb(window.pixels())

    pictures = {
        "VTK, data removed": shown("removed", None),
        "VTK, clip plane": shown("whole", "plane"),
        "VTK, cropping box": shown("whole", "box"),
        "VTK, not clipped": shown("whole", None),
        "cao, data removed": picture(scenes["removed"], "cao", [], folder),
        "cao, clip plane": picture(scenes["whole"], "cao", [plane], folder),
    }
    ground = srgb(linear(BACKGROUND))
    rows = []
    for what, pixels in pictures.items():
        truth = pictures[what.split(",")[0] + ", data removed"]
        floor = np.abs(truth - ground).max(axis=-1) > 0.1
        darker = 255.0 * (truth - pixels).mean(axis=-1)[floor]
        rows.append({
            "what": what,
            "floor_pixels": int(floor.sum()),
            "mean_brightness": float(255.0 * pixels.mean(axis=-1)[floor].mean()),
            "too_dark": int((darker > TOO_DARK).sum()),
        })
    return {"rows": rows, "too_dark_from": TOO_DARK}, pictures


# --- out ------------------------------------------------------------------------------------------------------------


def tables(found):
    """The report as Markdown."""
    lines = [
        f"{found['volume']} ({' x '.join(map(str, found['dims']))} voxels), both eyes of {found['size'][0]} x {found['size'][1]}"
        f" pixels, a sample each {found['step_mm']:g} mm, radius {found['radius_mm']:g} mm; after each move of a clip plane.",
        "",
        f"{found['machine']}",
        "",
        "| system | what | median ms | quartiles | ratio to CAO | quartiles |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for r in found["rows"]:
        lines.append(
            f"| {r['system']} | {r['what']} | {r['median_ms']:.1f} | {r['low']:.1f} … {r['high']:.1f} "
            f"| {r['ratio_to_cao']:.3g} | {r['ratio_low']:.3g} … {r['ratio_high']:.3g} |"
        )
    s = found["stereo"]
    lines += [
        "",
        f"Occlusion at the points that both eyes see ({s['eyes_apart_mm']:.0f} mm apart, {s['distance_mm']:.0f} mm away):",
        "",
        "| what | points | mean difference | 99th percentile |",
        "|---|---:|---:|---:|",
        *(f"| {r['what']} | {r['points']} | {r['mean']:.4f} | {r['p99']:.3f} |" for r in s["rows"]),
        "",
        "The floor below a block that is clipped away (of 255):",
        "",
        f"| what | mean brightness | pixels more than {found['clip_shadow']['too_dark_from']:.0f} too dark |",
        "|---|---:|---:|",
        *(
            f"| {r['what']} | {r['mean_brightness']:.1f} | {r['too_dark']} of {r['floor_pixels']} |"
            for r in found["clip_shadow"]["rows"]
        ),
        "",
        *(f"* {note}" for note in found["notes"]),
    ]
    return "\n".join(lines) + "\n"


NOTES = [
    "Both systems read the same volume of opacities and one colour, lit by the same light, from the same place.",
    "VTK draws the eyes one after the other, as its own stereo windows do; cao both in one pass.",
    "A ratio is the median of one round by CAO's median of the same round; rounds of all methods alternate.",
    "VTK: wall clock around drawing both eyes and waiting. cao: GPU timestamps of the stages that a clip move asks for.",
    "Reach is VTK's GlobalIlluminationReach: from 0, one step towards the light, to 1, through the whole volume.",
]


def run(given, folder):
    progress = Progress()
    progress.say("preparing")
    opacity = folder / "opacity.nrrd"
    # The clipped opacity of no clip: what both sides draw. No rays, for their result is not wanted.
    device = cao("occlusion", given.volume, "--transfer", given.transfer, "--radius-mm", 0, "--needed-only",
        "-o", folder / "none.nrrd", "--opacity-out", opacity)
    scene = Scene(opacity, given.size, given.step_mm, given.radius_mm)
    window = scene.window()
    view = scene.view(window)
    place = (scene.clip_point(0, 2), scene.normal)

    pictures = {}
    for method in OURS:
        progress.say(f"picture: {method}")
        pictures[f"cao-{method}"] = picture(scene, method, [place], folder)
    for name, mode in vtk.MODES.items():
        progress.say(f"picture: {name}")
        view.set_mode(mode, scene.radius)
        view.clip(*place)
        view.frame(scene.eyes()[:1])
        pictures[f"vtk-{name}"] = srgb(window.pixels())
    agreement = same_silhouette(pictures["cao-solid"], pictures["vtk-plain"])
    rows = race(scene, view, given.rounds, given.moves, folder, progress)
    progress.say("between the eyes")
    between = stereo(scene, folder)
    progress.say("shadows behind a clip")
    shadow, shadow_pictures = clip_shadow(32 if given.check else 96, min(given.size), folder)
    progress.end()
    found = {
        "machine": f"cao on {device['device']} ({device['driver']}); VTK on {window.name()}",
        "volume": given.volume,
        "dims": list(scene.values.shape[::-1]),
        "size": list(given.size),
        "step_mm": scene.step,
        "radius_mm": scene.radius,
        "rounds": given.rounds,
        "moves": given.moves,
        "same_silhouette": agreement,
        "rows": rows,
        "stereo": between,
        "clip_shadow": shadow,
        "notes": NOTES,
    }
    pictures.update({"floor-" + name.lower().replace(", ", "-").replace(" ", "-"): p for name, p in shadow_pictures.items()})
    return found, pictures


def main():
    given = parse(sys.argv[1:])
    with tempfile.TemporaryDirectory(prefix="cao-peers-") as name:
        found, pictures = run(given, Path(name))
    report = tables(found)
    print(report, end="")
    if given.folder:
        given.folder.mkdir(parents=True, exist_ok=True)
        (given.folder / "table.md").write_text(report)
        (given.folder / "peers.json").write_text(json.dumps(found, indent=2) + "\n")
        for picture_name, pixels in pictures.items():
            write_png(given.folder / f"{picture_name}.png", pixels)
    if given.json:
        given.json.write_text(json.dumps(found, indent=2) + "\n")
    if found["same_silhouette"] < SAME_SILHOUETTE:
        stop(f"the two programs' pictures do not show the same thing: {found['same_silhouette']:.3f} of the silhouette is shared")


main()
