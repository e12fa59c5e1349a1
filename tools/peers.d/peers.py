"""cao and VTK beside each other: the same opacities, cameras, light, step and clip plane, in alternating rounds.

Started by tools/peers, which sees to VTK, to an OpenGL driver and to the programs of this package.
"""

import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import vtk_side as vtk
from arguments import parse
from cao_side import BACKGROUND, COLOUR, Plane, Scene, bench, cao, linear, read_nrrd, rig_of, srgb, transfer, write_nrrd
from terminal import progress, stop
from vtkmodules.vtkCommonCore import vtkVersion

OURS = {
    "solid": "solid colour",
    "lao": "LAO, full update",
    "cao": "CAO, contextual update",
    "rays": "rays by brick, contextual update",
}
# The isosurface whose screen-space occlusion is compared between the eyes: half of full opacity.
LEVEL = 0.5
# What a picture shows differs at least so much from the background, of 1: about twice its brightness.
SHOWN = 0.1
# Silhouettes of the two programs' pictures agree at least so far (shared by union): border pixels, a few in a hundred of
# small pictures, may differ by how a sample's place and a face's fade are rounded. Less, and the cameras differ.
SAME_SILHOUETTE = 0.95
# Weights of a pixel's four neighbours are rounded; with it the same eye twice differs by 1e-18.
ROUNDING = 1e-9
# A surface coloured by its place along x, dark to bright, differs between the eyes by the pixels' 8 bits and by no more than
# as much again for edges, where points of the volume are found again. One that is looked up elsewhere differs by tenths.
RAMP = 2.0 / 255.0
# A floor pixel is called too dark from this difference on, of 255.
TOO_DARK = 40.0
NOTES = [
    "Both systems read one volume of opacities, in one colour, with the same light, step, eyes and clip plane.",
    "Times: wall clock from moving the plane to the end of the device's work, both eyes, nothing read back.",
    "VTK draws one eye after the other, as its own stereo and OpenXR windows do; cao both in one pass.",
    "A ratio is a frame's time by that of CAO for the same frame of the same round; systems take turns round by round.",
    "Reach is VTK's GlobalIlluminationReach: from 0, one step towards the light, to 1, through the whole volume.",
    "VTK shades a cut face inside uniform material with its ambient part alone, for it finds no gradient there.",
]


def spread(values):
    """Median, lower and upper quartile."""
    low, median, high = np.percentile(values, (25, 50, 75))
    return float(median), float(low), float(high)


def shown(picture):
    """Pixels that show something, not the background."""
    return np.abs(picture - srgb(linear(BACKGROUND))).max(axis=-1) > SHOWN


def vtk_view(scene):
    window = vtk.Window(scene.size, tuple(linear(BACKGROUND)), scene.look["light"])
    look, colour = scene.look, tuple(linear(COLOUR))
    return vtk.VolumeView(
        window, scene.values, scene.spacing, look["step_mm"], scene.reference, colour, look["ambient"], look["diffuse"]
    )


def eyes_of(scene, rig):
    return vtk.eyes(rig, scene.size[0] / scene.size[1], scene.diagonal)


# --- times ----------------------------------------------------------------------------------------------------------


class Race:
    """All methods along the same frames, system by system, round by round."""

    def __init__(self, scene, view, frames, transfer_file):
        self.scene, self.view, self.transfer_file = scene, view, transfer_file
        self.frames = [(eyes_of(scene, rig), plane) for rig, plane in frames]
        self.times = {name: [] for name in (*OURS, *vtk.MODES)}
        self.parts = {}

    def ours(self):
        scene = self.scene
        answer, times = bench(scene.path, self.transfer_file, scene.size, scene.radius, OURS, len(self.frames))
        for name, one in times.items():
            self.times[name] += one
        for method in answer["methods"]:
            self.parts.setdefault(method["method"], []).append(method["parts_ms"])

    def where(self):
        """Where the time of our frames goes, in one sentence."""
        methods = []
        for name, rounds in self.parts.items():
            mean = {part: np.mean([one[part] for one in rounds]) for part in rounds[0]}
            shares = (f"{part.replace('_', ' ')} {100.0 * ms / sum(mean.values()):.0f} %" for part, ms in mean.items())
            methods.append(f"{name}: {', '.join(shares)}")
        return f"Parts of cao's frames, by GPU timestamps: {'; '.join(methods)}."

    def theirs(self, name):
        self.view.set_mode(vtk.MODES[name], self.scene.radius)
        # The first frame of a mode builds VTK's shaders; stereo-bench leaves its first out too.
        self.view.frame(*self.frames[-1])
        self.times[name] += [self.view.frame(*frame) for frame in self.frames]

    def rows(self):
        """One row of the table for each method."""
        rows = []
        for name, times in self.times.items():
            median, low, high = spread(times)
            ratio, ratio_low, ratio_high = spread(np.divide(times, self.times["cao"]))
            rows.append({
                "system": "cao" if name in OURS else f"VTK {vtkVersion.GetVTKVersion()}",
                "what": OURS[name] if name in OURS else vtk.MODES[name].what,
                "median_ms": median,
                "low": low,
                "high": high,
                "ratio_to_cao": ratio,
                "ratio_low": ratio_low,
                "ratio_high": ratio_high,
                "frames": len(times),
            })  # fmt: skip
        return rows


def pictures_of(scene, view, rig, plane, ours, theirs):
    """The left eye of one frame by these methods, by file name."""
    found = {}
    for method in ours:
        progress(f"picture of {method}")
        found[f"cao-{method}"] = vtk.read_png(scene.draw(rig, plane, method))
    for name in theirs:
        progress(f"picture of {name}")
        view.set_mode(vtk.MODES[name], scene.radius)
        view.frame(eyes_of(scene, rig)[:1], plane)
        found[f"vtk-{name}"] = srgb(view.window.pixels())
    return found


# --- between the eyes -----------------------------------------------------------------------------------------------


def between_eyes(scene, rig, transfer_file):
    """Screen-space occlusion of VTK at the points that both eyes see, beside occlusion that lies in the volume."""
    file = scene.folder / "ambient.nrrd"
    cao("occlusion", scene.path, "--transfer", transfer_file, "--radius-mm", scene.radius, "-o", file)
    mesh = vtk.surface(scene.values, scene.spacing, LEVEL)
    pair = eyes_of(scene, rig)
    rows = []

    def add(what, view, eyes=pair):
        differences = vtk.between_eyes(view, eyes, tolerance=0.5 * min(scene.spacing))
        if len(differences) == 0:
            stop(f"both eyes see no point of the surface of opacity {LEVEL}; choose another volume or transfer function")
        mean, p99 = float(differences.mean()), float(np.percentile(differences, 99))
        rows.append({"what": what, "points": len(differences), "mean": mean, "p99": p99})

    for samples, blur in ((32, False), (32, True), (320, True)):
        view = vtk.SurfaceView(vtk.Window(scene.size), mesh)
        view.window.set_ssao(samples, scene.radius, scene.diagonal, blur)
        add(f"VTK SSAO, {samples} samples, {'blurred' if blur else 'not blurred'}", view)
    add("control: the same, the left eye twice", view, pair[:1] * 2)
    # What is left there is this measurement's own error: pixels of 8 bits, and places between pixels.
    view = vtk.SurfaceView(vtk.Window(scene.size), vtk.probed(mesh, read_nrrd(file)[0], scene.spacing), scalars=True)
    add("control: cao's ambient volume on VTK's surface", view)

    ramp = np.broadcast_to(np.linspace(0.0, 1.0, scene.values.shape[2], dtype=np.float32), scene.values.shape)
    view = vtk.SurfaceView(vtk.Window(scene.size), vtk.probed(mesh, ramp, scene.spacing), scalars=True)
    add("control: a ramp through the volume", view)

    verified = cao("verify", scene.path, "--transfer", transfer_file, "--radius-mm", scene.radius, "--shapes", "plane",
                   "--poses", 1)["volumes"][0]  # fmt: skip
    largest = verified["largest_difference_between_eyes"]
    # No more than the largest; which is 0, or `cao verify` has failed.
    rows.append({
        "what": "cao, as its shader reads it (cao verify)",
        "points": verified["points_seen_by_both_eyes"],
        "mean": largest,
        "p99": largest,
    })  # fmt: skip
    return {"eyes_apart_mm": rig["ipd_mm"], "distance_mm": math.dist(rig["position_mm"], rig["target_mm"]), "rows": rows}


# --- shadows behind a clip ------------------------------------------------------------------------------------------


def clip_shadow(size, pixels, look, folder):
    """How bright a floor is below a block that is taken away: really removed, by a clip plane, by a cropping box."""
    whole = np.zeros((size, size, size), np.float32)
    whole[size // 12 : size // 6] = 1.0
    block = slice(size // 4, 3 * size // 4)
    whole[size // 2 : 2 * size // 3, block, block] = 1.0
    between = size // 3
    removed = whole.copy()
    removed[between:] = 0.0
    height = between - 0.5 * (size - 1)
    plane = Plane([0.0, 0.0, height], [0.0, 0.0, 0.0])
    distance = 2.9 * size
    rig = {
        "position_mm": [0.22 * distance, -0.6 * distance, 0.77 * distance],
        "target_mm": [0.0, 0.0, 0.0],
        "up": [0.0, 0.0, 1.0],
        "ipd_mm": 0.0,
        "fov_deg": 35.0,
    }
    look = {**look, "light": [-0.3, -0.3, 1.0]}
    scenes = {}
    for name, values in (("whole", whole), ("removed", removed)):
        path = folder / f"{name}.nrrd"
        write_nrrd(path, values, (1.0, 1.0, 1.0))
        scenes[name] = Scene(path, (pixels, pixels), 0.25 * size, {**look, "step_mm": 0.25}, folder)

    def theirs(name, plane=None, box=False):
        view = vtk_view(scenes[name])
        view.set_mode(vtk.MODES["scattering-1"], 0.25 * size)
        # Nothing but scattering.
        view.mapper.SetVolumetricScatteringBlending(2.0)
        if box:
            edge = 0.5 * size
            view.mapper.SetCroppingRegionPlanes(-edge, edge, -edge, edge, -edge, height)
            view.mapper.SetCroppingRegionFlagsToSubVolume()
            view.mapper.CroppingOn()
        view.frame(eyes_of(scenes[name], rig)[:1], plane)
        return srgb(view.window.pixels())

    pictures = {
        ("VTK", "data removed"): theirs("removed"),
        ("VTK", "clip plane"): theirs("whole", plane),
        ("VTK", "cropping box"): theirs("whole", box=True),
        ("VTK", "nothing clipped"): theirs("whole"),
    }
    for what, name, cut in (
        ("data removed", "removed", None),
        ("clip plane", "whole", plane),
        ("nothing clipped", "whole", None),
    ):
        pictures["cao", what] = vtk.read_png(scenes[name].draw(rig, cut, "cao"))
    rows = []
    for (system, what), picture in pictures.items():
        truth = pictures[system, "data removed"]
        floor = shown(truth)
        darker = 255.0 * (truth - picture).mean(axis=-1)[floor]
        rows.append({
            "what": f"{system}, {what}",
            "floor_pixels": int(floor.sum()),
            "mean_brightness": float(255.0 * picture.mean(axis=-1)[floor].mean()),
            "too_dark": int((darker > TOO_DARK).sum()),
            "differ": int((np.abs(darker) > 1.0).sum()),
        })  # fmt: skip
    files = {f"floor-{system.lower()}-{what.replace(' ', '-')}": picture for (system, what), picture in pictures.items()}
    return {"too_dark_from": TOO_DARK, "rows": rows}, files


# --- what comes out -------------------------------------------------------------------------------------------------


def tables(found):
    """The report as Markdown."""
    dims, size = (" x ".join(map(str, found[key])) for key in ("dims", "image_size"))
    stereo, shadow = found["stereo"], found["clip_shadow"]
    return "\n".join([
        f"{found['volume']}, {dims} voxels; both eyes, {size} pixels each, a sample every {found['step_mm']:g} mm, "
        f"occlusion within {found['radius_mm']:g} mm; after every move of a clip plane, "
        f"{found['rounds']} x {found['moves']} frames.",
        "",
        found["machine"],
        "",
        "| system | what | median ms | quartiles | by CAO | quartiles |",
        "|---|---|---:|---:|---:|---:|",
        *(
            f"| {r['system']} | {r['what']} | {r['median_ms']:.1f} | {r['low']:.1f} … {r['high']:.1f} "
            f"| {r['ratio_to_cao']:.3f} | {r['ratio_low']:.3f} … {r['ratio_high']:.3f} |"
            for r in found["rows"]
        ),
        "",
        f"Difference of occlusion, 0 … 1, at points that both eyes see; eyes {stereo['eyes_apart_mm']:.0f} mm apart, "
        f"{stereo['distance_mm']:.0f} mm away:",
        "",
        "| what | points | mean | 99th percentile |",
        "|---|---:|---:|---:|",
        *(f"| {r['what']} | {r['points']} | {r['mean']:.4f} | {r['p99']:.3f} |" for r in stereo["rows"]),
        "",
        "Brightness, 0 … 255, of a floor below a block that is taken away:",
        "",
        f"| what | mean | pixels more than {shadow['too_dark_from']:.0f} too dark | pixels that differ by more than 1 |",
        "|---|---:|---:|---:|",
        *(
            f"| {r['what']} | {r['mean_brightness']:.1f} | {r['too_dark']} of {r['floor_pixels']} | {r['differ']} |"
            for r in shadow["rows"]
        ),
        "",
        *(f"* {note}" for note in found["notes"]),
        "",
    ])  # fmt: skip


def wrong(found, pictures, later):
    """What makes the numbers worthless, one sentence each. `later`: pictures of another frame."""
    for frame in (pictures, later):
        a, b = shown(frame["cao-solid"]), shown(frame["vtk-plain"])
        same = (a & b).sum() / max((a | b).sum(), 1)
        if same < SAME_SILHOUETTE:
            yield f"the two systems do not draw the same thing: they share {same:.3f} of the silhouette"
    for name in ("cao-solid", "vtk-plain"):
        if np.array_equal(pictures[name], later[name]):
            yield f"{name}: the clip plane does not move"
    stereo = {r["what"]: r for r in found["stereo"]["rows"]}
    for control, most in (("the same, the left eye twice", ROUNDING), ("a ramp through the volume", RAMP)):
        mean = stereo[f"control: {control}"]["mean"]
        if mean > most:
            yield f"points are not found again in the other eye: {control}, differs by {mean} in the mean"
    floor = {r["what"]: r for r in found["clip_shadow"]["rows"]}
    for system in ("VTK", "cao"):
        if floor[f"{system}, nothing clipped"]["differ"] == 0:
            yield f"{system}: the block that is not clipped does not show on the floor"
    if floor["cao, clip plane"]["differ"] > 0:
        yield f"cao's floor knows of what is clipped in {floor['cao, clip plane']['differ']} pixels"


def measure(given, folder):
    progress("opacities")
    path, transfer_file = folder / "opacity.nrrd", folder / "transfer.toml"
    # Without rays, for their result is not wanted.
    device = cao("occlusion", given.volume, "--transfer", given.transfer, "--radius-mm", 0, "--needed-only",
                 "-o", folder / "none.nrrd", "--opacity-out", path)  # fmt: skip
    values, spacing = read_nrrd(path)
    if not values.any():
        stop(f"{given.volume} has no opacity under transfer function {given.transfer}; choose another")
    transfer_file.write_text(transfer(min(spacing)))
    radius = given.radius_mm or 20.0 * min(spacing)
    # One method suffices to learn what the frames show.
    answer, _ = bench(path, transfer_file, given.size, radius, ["solid"], given.moves)
    frames = [
        (rig_of(frame["views"]), Plane(frame["clip"]["translate_mm"], frame["clip"]["rotate_deg"]))
        for frame in answer["path"]["frames"]
    ]
    # VTK's light stands still in the world; that of `stereo-bench` moves with the head.
    look = {**answer["path"], "light": [-0.4, -0.7, 0.6]}
    scene = Scene(path, given.size, radius, look, folder)
    view = vtk_view(scene)
    pictures = pictures_of(scene, view, *frames[0], OURS, vtk.MODES)
    later = pictures_of(scene, view, *frames[-1], ["solid"], ["plain"])

    race = Race(scene, view, frames, transfer_file)
    for number in range(given.rounds):
        progress(f"round {number + 1} of {given.rounds}: cao")
        race.ours()
        for name in vtk.MODES:
            progress(f"round {number + 1} of {given.rounds}: {name}")
            race.theirs(name)
    progress("between the eyes")
    stereo = between_eyes(scene, frames[0][0], transfer_file)
    progress("shadows behind a clip")
    shadow, floors = clip_shadow(32 if given.check else 96, min(given.size), scene.look, folder)
    progress()
    found = {
        "machine": f"cao on {device['device']} ({device['driver']}); VTK on {view.window.driver()}; {answer['machine']}",
        "volume": given.volume,
        "dims": list(scene.values.shape[::-1]),
        "image_size": list(given.size),
        "step_mm": scene.look["step_mm"],
        "radius_mm": radius,
        "rounds": given.rounds,
        "moves": given.moves,
        "rows": race.rows(),
        "stereo": stereo,
        "clip_shadow": shadow,
        "notes": [*NOTES, race.where()],
    }
    return found, {**pictures, **floors}, list(wrong(found, pictures, later))


def main():
    given = parse(sys.argv[1:])
    with tempfile.TemporaryDirectory(prefix="cao-peers-") as folder:
        found, pictures, problems = measure(given, Path(folder))
    report = tables(found)
    print(report, end="")
    as_json = json.dumps(found, indent=2) + "\n"
    if given.folder:
        given.folder.mkdir(parents=True, exist_ok=True)
        (given.folder / "table.md").write_text(report)
        (given.folder / "peers.json").write_text(as_json)
        for name, pixels in pictures.items():
            vtk.write_png(given.folder / f"{name}.png", pixels)
    if given.json:
        given.json.write_text(as_json)
    if problems:
        stop("these numbers mean nothing: " + "; ".join(problems))


try:
    main()
except KeyboardInterrupt:
    progress()
    sys.exit(130)
