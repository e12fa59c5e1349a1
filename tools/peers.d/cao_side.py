"""Our side of tools/peers: the programs run, scene files written, what they write read."""

import csv
import json
import math
import os
import subprocess
from pathlib import Path

import numpy as np
from terminal import stop

# One colour for all: the volume that both systems read is one of opacities. sRGB.
COLOUR = "#e6d9c4"
BACKGROUND = "#17191d"


def run(program, *arguments):
    """Runs a program of ours; its answer as JSON. `program` is the name of the variable that tools/peers set to its path."""
    command = [os.environ[program], *map(str, arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        stop(f"{Path(command[0]).name} {arguments[0]} failed: {done.stderr.strip()}")
    return json.loads(done.stdout)


def cao(*arguments):
    return run("CAO", *arguments)


# --- colours and files ----------------------------------------------------------------------------------------------


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
        spacing = [math.hypot(*map(float, vector.split(","))) for vector in vectors]
    return np.frombuffer(data, "<f4").reshape(dims[::-1]).copy(), spacing


def write_nrrd(path, values, spacing):
    """An f32 NRRD of values[z, y, x]."""
    sizes = " ".join(map(str, values.shape[::-1]))
    header = f"NRRD0004\ntype: float\ndimension: 3\nsizes: {sizes}\nspacings: {' '.join(map(str, spacing))}\n"
    path.write_bytes((header + "endian: little\nencoding: raw\n\n").encode() + values.astype("<f4").tobytes())


# --- what is drawn --------------------------------------------------------------------------------------------------


def rotation(degrees):
    """Matrix of turns about x, then y, then z, as a clip's pose has them."""
    (sx, cx), (sy, cy), (sz, cz) = ((math.sin(a), math.cos(a)) for a in np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


class Plane:
    """A clip plane: hides the side that its +z turned by `rotate_deg` points to, as cao's does."""

    def __init__(self, translate_mm, rotate_deg):
        self.point, self.rotate_deg = list(translate_mm), list(rotate_deg)
        self.normal = rotation(rotate_deg) @ (0.0, 0.0, 1.0)


def rig_of(views):
    """The rig (cao::view::StereoRig) of two views as `stereo-bench --json` gives them."""
    left, right = (np.array(v["position_mm"]) for v in views)
    x, y, z, w = views[0]["orientation_xyzw"]
    forward = -np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    up = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    tan = views[0]["tan"]
    ipd = float(np.linalg.norm(right - left))
    # Each eye's field of view is shifted so that the plane through the target has no parallax.
    screen = ipd / (tan["left"] + tan["right"])
    middle = 0.5 * (left + right)
    return {
        "position_mm": middle.tolist(),
        "target_mm": (middle + screen * forward).tolist(),
        "up": up.tolist(),
        "ipd_mm": ipd,
        "fov_deg": 2.0 * math.degrees(math.atan(tan["up"])),
    }


def transfer(reference_mm):
    """The transfer function of a volume of opacities, as TOML: they stay as they are."""
    return f'opacity = [[0, 0], [1, 1]]\ncolour = "{COLOUR}"\nreference_mm = {reference_mm}\n'


class Scene:
    """A volume of opacities, and how both systems draw it.

    `look` holds ambient, diffuse and step_mm, as `stereo-bench --json` gives them, and light, in the world; files go into `folder`.
    """

    def __init__(self, path, size, radius, look, folder):
        self.path, self.size, self.radius, self.look, self.folder = path, size, radius, look, folder
        self.values, self.spacing = read_nrrd(path)
        self.reference = min(self.spacing)
        self.diagonal = float(np.linalg.norm(np.array(self.values.shape[::-1]) * self.spacing))

    def toml(self, rig, plane, method):
        """The scene file of cao."""
        lines = [f"volume = {json.dumps(str(self.path))}", "[transfer]", transfer(self.reference)]
        if plane:
            lines += ["[[clip]]", 'shape = "plane"', f"translate_mm = {plane.point}", f"rotate_deg = {plane.rotate_deg}"]
        lines += ["[occlusion]", f'method = "{"cao" if method == "solid" else method}"', f"radius_mm = {self.radius}"]
        lines += ["[stereo]", *(f"{key} = {value}" for key, value in rig.items())]
        lines += ["[image]", f"width = {self.size[0]}", f"height = {self.size[1]}"]
        lines += [f"step_mm = {self.look['step_mm']}", f'background = "{BACKGROUND}"', "[shading]"]
        lines += [f"{key} = {self.look[key]}" for key in ("ambient", "diffuse", "light")]
        # As VTK lights: no highlight, both sides of a surface.
        lines += ["specular = 0", "two_sided = true", 'light_from = "world"', 'occlusion = "all"']
        lines += [f'mode = "{"phong" if method == "solid" else "phong+ao"}"', ""]
        return "\n".join(lines)

    def draw(self, rig, plane, method):
        """The left eye's picture by `cao render`, a PNG file that the next one replaces."""
        file, left, right = (self.folder / name for name in ("scene.toml", "left.png", "right.png"))
        file.write_text(self.toml(rig, plane, method))
        cao("render", file, "--eyes", f"{left},{right}")
        return left


def bench(path, transfer_file, size, radius, methods, moves):
    """One visit to `stereo-bench`: its answer, and for each method the wall clock of each frame in ms."""
    times = transfer_file.with_name("frames.csv")
    answer = run("STEREO_BENCH", path, "--transfer", transfer_file, "--radius-mm", radius, "--clip", "plane",
                 "--size", "x".join(map(str, size)), "--views", 2, "--methods", ",".join(methods),
                 "--frames", moves, "--runs", 1, "--warm-up", 1, "--csv", times)  # fmt: skip
    frames = {}
    with open(times, newline="") as file:
        for line in csv.DictReader(file):
            frames.setdefault(line["method"], []).append(float(line["frame_ms"]))
    return answer, frames
