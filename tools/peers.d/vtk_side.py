"""VTK's side of tools/peers: the same volume, camera, light and clip plane in VTK's GPU volume mapper.

Lengths are millimetres, the origin is the volume's centre, as in cao. Nothing here knows of cao itself.
"""

import math
import time
from collections import namedtuple

import numpy as np

# Imported for what they register: the OpenGL classes behind vtkRenderingCore's names.
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkFloatArray, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction, vtkPlane
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkProbeFilter
from vtkmodules.vtkIOImage import vtkPNGReader, vtkPNGWriter
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkColorTransferFunction,
    vtkLight,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
)
from vtkmodules.vtkRenderingOpenGL2 import vtkRenderStepsPass, vtkSSAOPass, vtkTextureObject
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

# VolumetricScatteringBlending, 0 … 2. At 1 light scatters where gradients are weak, and where they are strong surfaces are shaded.
BLENDING = 1.0
# SSAO as 3D Slicer sets it, but for the radius: bias in units of the volume's diagonal, samples, blur.
SSAO_BIAS = 0.001

Mode = namedtuple("Mode", "what reach ssao")
MODES = {
    "plain": Mode("plain volume rendering", None, None),
    "scattering-0": Mode("volumetric scattering, reach 0", 0.0, None),
    "scattering-1": Mode("volumetric scattering, reach 1", 1.0, None),
    "ssao-32": Mode("SSAO, 32 samples (VTK's default), blurred", None, 32),
    "ssao-320": Mode("SSAO, 320 samples (3D Slicer's), blurred", None, 320),
}

Eye = namedtuple("Eye", "position forward up fov_deg window_centre near far")


def eyes(rig, aspect, diagonal):
    """Left and right eye of a cao::view::StereoRig: parallel axes, fields of view shifted to the screen plane.

    Near and far plane lie close before and behind the volume, as VTK's own: its screen-space occlusion works on depths.
    """
    position, target, up = (np.array(rig[k], float) for k in ("position_mm", "target_mm", "up"))
    ahead = target - position
    screen = float(np.linalg.norm(ahead))
    ahead /= screen
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    slope = math.tan(math.radians(0.5 * rig["fov_deg"]))
    centre = -float(position @ ahead)
    near, far = max(centre - 0.55 * diagonal, 0.01 * diagonal), centre + 0.55 * diagonal
    pair = []
    for side in (-1.0, 1.0):
        shift = -side * 0.5 * rig["ipd_mm"] / screen
        at = position + right * (side * 0.5 * rig["ipd_mm"])
        pair.append(Eye(at, ahead, np.cross(right, ahead), rig["fov_deg"], shift / (slope * aspect), near, far))
    return pair


def image_data(values, spacing):
    """vtkImageData of values[z, y, x], centred on the origin."""
    image = vtkImageData()
    dims = values.shape[::-1]
    image.SetDimensions(*dims)
    image.SetSpacing(*spacing)
    image.SetOrigin(*(-0.5 * (n - 1) * s for n, s in zip(dims, spacing)))
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values).ravel(), deep=True, array_type=VTK_FLOAT))
    return image


def read_png(path):
    """[row from the top, column, rgb] 0 … 1."""
    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, :3] / 255.0


def write_png(path, pixels):
    """The reverse of read_png."""
    height, width = pixels.shape[:2]
    values = np.ascontiguousarray((255.0 * pixels[::-1] + 0.5).astype(np.uint8)).reshape(-1, 3)
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    image.GetPointData().SetScalars(numpy_to_vtk(values, deep=True))
    writer = vtkPNGWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    writer.Write()


class Window:
    """One off-screen window with a renderer, a directional light and the eyes' cameras."""

    def __init__(self, size, background=(0.0, 0.0, 0.0), light=(0.0, 0.0, 1.0)):
        """`background`: linear red, green, blue; `light`: direction towards it."""
        self.size = size
        self.renderer = vtkRenderer()
        self.renderer.SetBackground(*background)
        self.renderer.AutomaticLightCreationOff()
        lamp = vtkLight()
        lamp.SetLightTypeToSceneLight()
        lamp.PositionalOff()
        lamp.SetPosition(*(1e4 * np.array(light, float)))
        lamp.SetFocalPoint(0.0, 0.0, 0.0)
        self.renderer.AddLight(lamp)
        self.lamp = lamp
        self.window = vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(*size)
        self.window.AddRenderer(self.renderer)

    def driver(self):
        """What draws, in OpenGL's own words."""
        lines = (line.partition(":") for line in self.window.ReportCapabilities().splitlines())
        says = {key.strip(): value.strip() for key, _, value in lines}
        return f"{says.get('OpenGL renderer string', '?')}, OpenGL {says.get('OpenGL version string', '?')}"

    def look_from(self, eye):
        camera = self.renderer.GetActiveCamera()
        camera.SetPosition(*eye.position)
        camera.SetFocalPoint(*(eye.position + eye.forward))
        camera.SetViewUp(*eye.up)
        camera.SetViewAngle(eye.fov_deg)
        camera.SetWindowCenter(eye.window_centre, 0.0)
        camera.SetClippingRange(eye.near, eye.far)

    def set_ssao(self, samples, radius, diagonal, blur=True):
        """Screen-space occlusion of so many samples; None switches it off."""
        if samples is None:
            self.renderer.SetPass(None)
            return
        ssao = vtkSSAOPass()
        ssao.SetDelegatePass(vtkRenderStepsPass())
        ssao.SetRadius(radius)
        ssao.SetBias(SSAO_BIAS * diagonal)
        ssao.SetKernelSize(samples)
        ssao.SetBlur(blur)
        # Without it volumes come out black.
        ssao.SetDepthFormat(vtkTextureObject.Fixed32)
        self.renderer.SetPass(ssao)

    def draw(self):
        """Draws and waits for the end, as glFinish does."""
        self.window.Render()
        self.window.WaitForCompletion()

    def pixels(self):
        """[row from the top, column, rgb] as floats 0 … 1."""
        width, height = self.size
        data = vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, width - 1, height - 1, 0, data, 0)
        return vtk_to_numpy(data).reshape(height, width, 3)[::-1] / 255.0

    def depth(self):
        """[row from the top, column] OpenGL depth, 1 where nothing is drawn."""
        width, height = self.size
        data = vtkFloatArray()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, data)
        return vtk_to_numpy(data).reshape(height, width)[::-1].astype(float)


class VolumeView:
    """A volume of opacities in a window, behind a clip plane that moves."""

    def __init__(self, window, values, spacing, step, reference, colour, ambient, diffuse):
        self.window = window
        # The mapper's ambient part is the light's colour alone, not times the volume's, and black by default.
        window.lamp.SetAmbientColor(*colour)
        self.diagonal = float(np.linalg.norm(np.array(values.shape[::-1]) * spacing))
        self.image = image_data(values, spacing)
        self.mapper = vtkGPUVolumeRayCastMapper()
        self.mapper.SetInputData(self.image)
        # Otherwise VTK takes fewer samples when it is late.
        self.mapper.SetAutoAdjustSampleDistances(0)
        self.mapper.SetSampleDistance(step)
        self.mapper.SetUseJittering(1)
        look = vtkVolumeProperty()
        as_it_is = vtkPiecewiseFunction()
        as_it_is.AddPoint(0.0, 0.0)
        as_it_is.AddPoint(1.0, 1.0)
        look.SetScalarOpacity(as_it_is)
        flat = vtkColorTransferFunction()
        flat.AddRGBPoint(0.0, *colour)
        look.SetColor(flat)
        look.SetScalarOpacityUnitDistance(reference)
        look.SetInterpolationTypeToLinear()
        look.ShadeOn()
        look.SetAmbient(ambient)
        look.SetDiffuse(diffuse)
        look.SetSpecular(0.0)
        volume = vtkVolume()
        volume.SetMapper(self.mapper)
        volume.SetProperty(look)
        window.renderer.AddVolume(volume)
        self.plane = vtkPlane()
        self.mapper.AddClippingPlane(self.plane)
        self.clip(None)

    def set_mode(self, mode, radius):
        self.mapper.SetVolumetricScatteringBlending(0.0 if mode.reach is None else BLENDING)
        self.mapper.SetGlobalIlluminationReach(mode.reach or 0.0)
        self.window.set_ssao(mode.ssao, radius, self.diagonal)

    def clip(self, plane):
        """Hides the side of the plane that its normal points to; None hides nothing. VTK keeps the side of its normal."""
        self.plane.SetOrigin(*(plane.point if plane else (2.0 * self.diagonal, 0.0, 0.0)))
        self.plane.SetNormal(*(-plane.normal if plane else (-1.0, 0.0, 0.0)))

    def frame(self, eyes, plane):
        """Draws the eyes one after the other, as VTK's own stereo and OpenXR windows do; wall clock in ms."""
        begin = time.perf_counter()
        self.clip(plane)
        for eye in eyes:
            self.window.look_from(eye)
            self.window.draw()
        return 1e3 * (time.perf_counter() - begin)


# --- screen-space occlusion between two eyes ------------------------------------------------------------------------


def surface(values, spacing, level):
    """The isosurface of values[z, y, x] at `level`."""
    edges = vtkFlyingEdges3D()
    edges.SetInputData(image_data(values, spacing))
    edges.SetValue(0, level)
    edges.ComputeNormalsOn()
    edges.Update()
    return edges.GetOutput()


def probed(mesh, values, spacing):
    """The same surface with values[z, y, x] of the places of its points as its scalars."""
    probe = vtkProbeFilter()
    probe.SetInputData(mesh)
    probe.SetSourceData(image_data(values, spacing))
    probe.Update()
    return probe.GetOutput()


class SurfaceView:
    """A surface whose picture is its ambient occlusion and nothing else: white, lit from everywhere."""

    def __init__(self, window, mesh, scalars=False):
        self.window = window
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(mesh)
        mapper.SetScalarVisibility(scalars)
        if scalars:
            grey = vtkColorTransferFunction()
            grey.AddRGBPoint(0.0, 0.0, 0.0, 0.0)
            grey.AddRGBPoint(1.0, 1.0, 1.0, 1.0)
            mapper.SetLookupTable(grey)
            # Values between vertices, not colours.
            mapper.InterpolateScalarsBeforeMappingOn()
        actor = vtkActor()
        actor.SetMapper(mapper)
        look = actor.GetProperty()
        look.SetAmbient(1.0)
        look.SetDiffuse(0.0)
        look.SetSpecular(0.0)
        window.renderer.AddActor(actor)

    def look(self, eye):
        """Occlusion and depth in mm along the view axis (infinite where nothing is), [row from the top, column]."""
        self.window.look_from(eye)
        self.window.draw()
        depth = self.window.depth()
        near, far = eye.near, eye.far
        with np.errstate(divide="ignore"):
            mm = np.where(depth < 1.0, near * far / (far - depth * (far - near)), np.inf)
        return self.window.pixels()[..., 0], mm


def tangents(eye, aspect):
    slope = math.tan(math.radians(0.5 * eye.fov_deg))
    return slope * aspect, slope, eye.window_centre * slope * aspect


def between_eyes(view, pair, tolerance):
    """|difference of occlusion| at the points that both eyes see: the left eye's pixels, looked up in the right eye.

    A point is seen by both where the right eye's four pixels around it are as far as the point is, to `tolerance` mm.
    """
    (left, left_mm), (right, right_mm) = (view.look(eye) for eye in pair)
    height, width = left.shape
    aspect = width / height
    across, up, shift = tangents(pair[0], aspect)
    rows, columns = np.nonzero(np.isfinite(left_mm))
    mm = left_mm[rows, columns]
    x = (2.0 * (columns + 0.5) / width - 1.0) * across + shift
    y = (1.0 - 2.0 * (rows + 0.5) / height) * up
    # Both eyes look along the same axis: a point's depth is the same, its x moves by the distance between them.
    apart = float(np.linalg.norm(pair[1].position - pair[0].position))
    across, up, shift = tangents(pair[1], aspect)
    column = ((x * mm - apart) / mm - shift) / across
    column = 0.5 * (column + 1.0) * width - 0.5
    row = 0.5 * (1.0 - y / up) * height - 0.5
    c0, r0 = np.floor(column + 1e-4).astype(int), np.floor(row + 1e-4).astype(int)
    inside = (c0 >= 0) & (r0 >= 0) & (c0 < width - 1) & (r0 < height - 1)
    rows, columns, mm, c0, r0 = (v[inside] for v in (rows, columns, mm, c0, r0))
    fx = np.clip(column[inside] - c0, 0.0, 1.0)
    fy = np.clip(row[inside] - r0, 0.0, 1.0)
    seen, value = np.ones(len(mm), bool), np.zeros(len(mm))
    for dr, wy in ((0, 1.0 - fy), (1, fy)):
        for dc, wx in ((0, 1.0 - fx), (1, fx)):
            seen &= np.abs(right_mm[r0 + dr, c0 + dc] - mm) < tolerance
            value += wx * wy * right[r0 + dr, c0 + dc]
    return np.abs(value - left[rows, columns])[seen]
