"""Writes volumes and what other readers make of them: a folder a case, with `expected.toml` and `values.f64`.

Public files come with the packages (pydicom's test files); the rest is written here by other programs' encoders.
"""
import sys
import warnings
from pathlib import Path

import imagecodecs
import nibabel
import numpy as np
import pydicom
import SimpleITK as sitk
import tifffile
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.uid import UID, generate_uid

warnings.simplefilter("ignore")
OUT = Path(sys.argv[1])
RNG = np.random.default_rng(7)
FLIP = np.diag([-1.0, -1.0, 1.0])  # LPS to RAS


def case(name, file, values, spacing, origin=(0, 0, 0), directions=np.eye(3), ras=False, tolerance=0.0, series=None):
    """values: z, y, x. directions: one row an index axis."""
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    np.ascontiguousarray(values, "<f8").tofile(folder / "values.f64")
    rows = ", ".join(str([float(x) for x in row]) for row in np.asarray(directions, float))
    text = [
        f'file = "{file}"',
        f"dims = {list(values.shape[::-1])}",
        f"spacing = {[float(x) for x in spacing]}",
        f"origin = {[float(x) for x in origin]}",
        f"directions = [{rows}]",
        f"ras = {str(ras).lower()}",
        f"tolerance = {float(tolerance)}",
    ]
    if series is not None:
        text.append(f'series = "{series}"')
    (folder / "expected.toml").write_text("\n".join(text) + "\n")


def refused(name, file, says):
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "expected.toml").write_text(f'file = "{file}"\nrefused = "{says}"\n')


# ------------------------------------------------------------------------------------------------ pydicom's files

def modality_values(dataset, stored):
    return stored.astype(np.float64) * float(dataset.get("RescaleSlope", 1)) + float(dataset.get("RescaleIntercept", 0))


def public_files():
    root = Path(pydicom.__file__).parent / "data/test_files"
    for path in sorted(root.glob("*.dcm")):
        dataset = pydicom.dcmread(path, force=True)
        if "Rows" not in dataset or dataset.get("SamplesPerPixel", 1) != 1:
            continue
        if dataset.get("NumberOfFrames", 1) not in (None, 1) and "GridFrameOffsetVector" not in dataset:
            continue
        # What is refused, and why: formats.md.
        says = {"JPGExtended.dcm": "SamplePrecision(12)", "liver_1frame.dcm": "BitsAllocated", "liver_expb_1frame.dcm": "BitsAllocated"}
        try:
            stored = dataset.pixel_array
        except Exception as error:
            # What the others cannot decode we refuse or read by luck; damaged ones are refused.
            print(f"{path.name}: not decoded by pydicom: {str(error)[:80]}")
            if "truncated" in path.name:
                folder = OUT / f"public-{path.stem}"
                folder.mkdir(parents=True, exist_ok=True)
                (folder / path.name).write_bytes(path.read_bytes())
                refused(f"public-{path.stem}", path.name, "PixelData")
            continue
        name = f"public-{path.stem}"
        folder = OUT / name
        folder.mkdir(parents=True, exist_ok=True)
        # Place and spacing are added where a file has none: its codec is what it is for.
        patched = False
        for key, value in [("ImagePositionPatient", [0, 0, 0]), ("ImageOrientationPatient", [1, 0, 0, 0, 1, 0]),
                           ("PixelSpacing", [1, 1]), ("SliceThickness", 1)]:
            if key not in dataset or dataset[key].value in (None, ""):
                if key == "SliceThickness" and dataset.get("NumberOfFrames", 1) > 1:
                    continue
                setattr(dataset, key, value)
                patched = True
        if patched:
            if not hasattr(dataset, "file_meta") or "TransferSyntaxUID" not in dataset.file_meta:
                print(f"{path.name}: no transfer syntax, left out")
                continue
            dataset.save_as(folder / path.name)
        else:
            (folder / path.name).write_bytes(path.read_bytes())
        if path.name in says:
            refused(name, path.name, says[path.name])
            continue
        values = stored.reshape((-1,) + stored.shape[-2:])
        if "DoseGridScaling" in dataset:
            values = values.astype(np.float64) * float(dataset.DoseGridScaling)
        else:
            values = modality_values(dataset, values)
        iop = np.array(dataset.ImageOrientationPatient, float).reshape(2, 3)
        iop /= np.linalg.norm(iop, axis=1)[:, None]
        normal = np.cross(*iop)
        if "GridFrameOffsetVector" in dataset and values.shape[0] > 1:
            z = float(dataset.GridFrameOffsetVector[1]) - float(dataset.GridFrameOffsetVector[0])
        else:
            z = float(dataset.get("SpacingBetweenSlices") or dataset.SliceThickness)
        spacing = [float(dataset.PixelSpacing[1]), float(dataset.PixelSpacing[0]), z]
        origin = FLIP @ np.array(dataset.ImagePositionPatient, float)
        directions = np.array([*iop, normal]) @ FLIP
        lossy = dataset.file_meta.TransferSyntaxUID in ("1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51", "1.2.840.10008.1.2.4.91")
        case(name, path.name, values, spacing, origin, directions, ras=True, tolerance=1.0 if lossy else 0.0)


def public_series():
    """The tree of a CD: every series as GDCM (SimpleITK) reads it."""
    tree = Path(pydicom.__file__).parent / "data/test_files/dicomdirtests"
    by_uid = {}
    for path in sorted(p for p in tree.rglob("*") if p.is_file() and not p.name.startswith(("DICOMDIR", "README"))):
        dataset = pydicom.dcmread(path, stop_before_pixels=True)
        by_uid.setdefault(str(dataset.SeriesInstanceUID), []).append((path, dataset))
    for uid, files in by_uid.items():
        first = files[0][1]
        if "ImagePositionPatient" not in first:
            continue
        iop = np.array(first.ImageOrientationPatient, float).reshape(2, 3)
        normal = np.cross(*iop)
        places = [(float(np.dot(normal, np.array(d.ImagePositionPatient, float))), p) for p, d in files]
        places.sort(key=lambda x: x[0])
        gaps = np.diff([z for z, _ in places])
        if any(not np.allclose(d.ImageOrientationPatient, first.ImageOrientationPatient, atol=1e-3) for _, d in files):
            continue
        if len(gaps) and (gaps.min() < 1e-3 or gaps.max() > 1.1 * gaps.min()):
            continue
        image = sitk.ReadImage([str(p) for _, p in places])
        values = sitk.GetArrayFromImage(image)
        spacing = list(image.GetSpacing())
        if len(places) == 1:
            spacing[2] = float(first.get("SpacingBetweenSlices") or first.SliceThickness)
        else:
            spacing[2] = float(np.mean(gaps))
        lps = np.array(image.GetDirection()).reshape(3, 3).T
        case(f"series-{uid[-12:]}", tree, values, spacing, FLIP @ np.array(image.GetOrigin()), lps @ FLIP, ras=True,
             series=uid)


# ------------------------------------------------------------------------------------- DICOM by other encoders

SYNTAXES = {
    "implicit": "1.2.840.10008.1.2", "explicit": "1.2.840.10008.1.2.1", "big": "1.2.840.10008.1.2.2",
    "deflated": "1.2.840.10008.1.2.1.99", "rle": "1.2.840.10008.1.2.5", "jpeg": "1.2.840.10008.1.2.4.50",
    "ljpeg": "1.2.840.10008.1.2.4.57", "ljpeg-first": "1.2.840.10008.1.2.4.70", "jpegls": "1.2.840.10008.1.2.4.80",
    "jpegls-near": "1.2.840.10008.1.2.4.81", "j2k": "1.2.840.10008.1.2.4.90", "j2k-lossy": "1.2.840.10008.1.2.4.91",
}


def picture(shape, bits, signed):
    """Smooth with noise, over the whole range."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    wave = np.sin(x / 5.0) * np.cos(y / 7.0) * 0.45 + 0.5 + RNG.normal(0, 0.01, shape)
    wave[:3] = 0.5  # runs
    top = (1 << bits) - 1
    values = np.clip(np.round(wave * top), 0, top).astype(np.int64)
    values[-1, -2:] = [0, top]
    return values - (1 << (bits - 1)) if signed else values


def encoded(kind, stored, bits, signed):
    """A frame as bytes, and what it decodes to by the same program."""
    words = (stored & ((1 << bits) - 1)).astype(np.uint8 if bits <= 8 else np.uint16)
    if kind == "rle":
        planes = words.view(np.uint8).reshape(*words.shape, -1)[..., ::-1]
        segments = [packbits(planes[..., i]) for i in range(planes.shape[-1])]
        offsets, at = [], 64
        for segment in segments:
            offsets.append(at)
            at += len(segment)
        head = np.zeros(16, "<u4")
        head[0] = len(segments)
        head[1 : 1 + len(offsets)] = offsets
        return head.tobytes() + b"".join(segments), stored
    if kind == "jpeg":
        data = imagecodecs.jpeg8_encode(words, level=95)
        return data, imagecodecs.jpeg8_decode(data)
    if kind in ("ljpeg", "ljpeg-first"):
        return imagecodecs.ljpeg_encode(words, bitspersample=bits), stored
    if kind == "jpegls":
        return imagecodecs.jpegls_encode(words), stored
    if kind == "jpegls-near":
        data = imagecodecs.jpegls_encode(words, level=2)
        # The encoder knows 16 bits where the file says 12: its errors may lead beyond.
        return data, np.minimum(imagecodecs.jpegls_decode(data), (1 << bits) - 1)
    if kind == "j2k":
        source = stored.astype((np.int8 if bits <= 8 else np.int16) if signed else words.dtype)
        return imagecodecs.jpeg2k_encode(source, level=0, codecformat="j2k", bitspersample=bits), stored
    data = imagecodecs.jpeg2k_encode(words, level=60, codecformat="j2k", bitspersample=bits, reversible=False)
    return data, imagecodecs.jpeg2k_decode(data)


def packbits(plane):
    rows = b"".join(imagecodecs.packbits_encode(row.tobytes()) for row in plane)
    return rows + b"\0" * (len(rows) % 2)


def slice_file(path, kind, frame, place, bits, allocated, signed, uid, rescale=None, iop=(1, 0, 0, 0, 1, 0), spacing=(0.5, 0.75)):
    d = Dataset()
    d.file_meta = FileMetaDataset()
    d.file_meta.TransferSyntaxUID = UID(SYNTAXES[kind])
    d.file_meta.MediaStorageSOPClassUID = d.SOPClassUID = "1.2.840.10008.5.1.4.1.1.2"
    d.file_meta.MediaStorageSOPInstanceUID = d.SOPInstanceUID = generate_uid()
    d.SeriesInstanceUID, d.StudyInstanceUID, d.Modality = uid, uid, "CT"
    d.Rows, d.Columns = frame.shape
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, "MONOCHROME2"
    d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = allocated, bits, bits - 1, int(signed)
    d.ImagePositionPatient, d.ImageOrientationPatient = [float(x) for x in place], list(iop)
    d.PixelSpacing, d.SliceThickness = list(spacing), 9
    if rescale:
        d.RescaleSlope, d.RescaleIntercept = rescale
    d.is_little_endian, d.is_implicit_VR = kind != "big", kind == "implicit"
    if kind in ("implicit", "explicit", "big", "deflated"):
        word = frame & ((1 << bits) - 1)
        # Bits beyond those stored mean nothing; noise there must not show.
        if bits < allocated:
            word = word | (RNG.integers(0, 2, frame.shape) << bits)
        d.PixelData = word.astype(f"{'>' if kind == 'big' else '<'}u{allocated // 8}").tobytes()
        d["PixelData"].VR = "OW"
        result = frame
    else:
        data, result = encoded(kind, frame, bits, signed)
        d.PixelData = encapsulate([data])
        d["PixelData"].is_undefined_length = True
        d["PixelData"].VR = "OB"
    d.save_as(path, write_like_original=False)
    return result


def encoders():
    for kind in SYNTAXES:
        for bits, allocated, signed in [(8, 8, False), (12, 16, False), (12, 16, True), (16, 16, True), (16, 16, False)]:
            if (kind == "jpeg" and bits != 8) or (kind in ("j2k-lossy", "jpegls-near") and signed):
                continue
            name = f"syntax-{kind}-{bits}{'s' if signed else 'u'}"
            folder = OUT / name / "in"
            folder.mkdir(parents=True, exist_ok=True)
            uid, frames = generate_uid(), []
            for z in range(3):
                try:
                    frame = picture((33, 41), bits, signed)
                    # Names against the order of positions.
                    frames.append(slice_file(folder / f"{9 - z}.dcm", kind, frame, [3, -4, 2.5 * z], bits, allocated, signed, uid, (2, -1000)))
                except Exception as error:
                    print(f"{name}: not encoded: {error}")
                    break
            if len(frames) < 3:
                continue
            values = np.array(frames, np.float64) * 2 - 1000
            # Irreversible wavelets and cosines are rounded differently: two steps of 65536, with a slope of 2.
            tolerance = {"jpeg": 2.0, "j2k-lossy": 4.0}.get(kind, 0.0)
            case(name, "in", values, [0.75, 0.5, 2.5], [-3, 4, 0], FLIP, ras=True, tolerance=tolerance)


def series_written_by_itk():
    """GDCM's own writer, oblique, and PET's slope of each slice."""
    c, s = np.cos(0.3), np.sin(0.3)
    iop = [c, s, 0, -s * 0.8, c * 0.8, -0.6]
    normal = np.cross(iop[:3], iop[3:])
    folder = OUT / "rescale-per-slice" / "in"
    folder.mkdir(parents=True, exist_ok=True)
    uid, values = generate_uid(), []
    for z in range(5):
        frame = picture((20, 30), 16, True)
        slope, intercept = 0.1 * (z + 1), -z
        slice_file(folder / f"{z}", "explicit", frame, normal * 2 * z, 16, 16, True, uid, (f"{slope:.3f}", intercept), iop)
        values.append(frame * float(f"{slope:.3f}") + intercept)
    case("rescale-per-slice", "in", np.array(values), [0.75, 0.5, 2], [0, 0, 0], np.array([iop[:3], iop[3:], normal]) @ FLIP, ras=True)


def enhanced():
    """Frames against the order of positions, own rescale each, in one file; and the same as GDCM reads it, without rescale."""
    for kind in ("explicit", "rle", "j2k"):
        folder = OUT / f"enhanced-{kind}"
        folder.mkdir(parents=True, exist_ok=True)
        d = Dataset()
        d.file_meta = FileMetaDataset()
        d.file_meta.TransferSyntaxUID = UID(SYNTAXES[kind])
        d.file_meta.MediaStorageSOPClassUID = d.SOPClassUID = "1.2.840.10008.5.1.4.1.1.4.1"
        d.file_meta.MediaStorageSOPInstanceUID = d.SOPInstanceUID = generate_uid()
        d.SeriesInstanceUID, d.StudyInstanceUID, d.Modality = generate_uid(), generate_uid(), "MR"
        d.Rows, d.Columns, d.NumberOfFrames = 20, 30, 4
        d.SamplesPerPixel, d.PhotometricInterpretation = 1, "MONOCHROME1"
        d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = 16, 12, 11, 0
        shared, orientation, measures = Dataset(), Dataset(), Dataset()
        orientation.ImageOrientationPatient = [0, 1, 0, 0, 0, -1]
        measures.PixelSpacing, measures.SliceThickness = [0.5, 0.75], 3
        shared.PlaneOrientationSequence, shared.PixelMeasuresSequence = [orientation], [measures]
        d.SharedFunctionalGroupsSequence = [shared]
        frames, own, values = [], [], {}
        for i, z in enumerate([2, 0, 3, 1]):
            frame = picture((20, 30), 12, False)
            group, place, rescale = Dataset(), Dataset(), Dataset()
            place.ImagePositionPatient = [-1.5 * z, 7, 8]
            rescale.RescaleSlope, rescale.RescaleIntercept, rescale.RescaleType = i + 1, 10 * i, "US"
            group.PlanePositionSequence, group.PixelValueTransformationSequence = [place], [rescale]
            own.append(group)
            values[z] = frame * (i + 1) + 10 * i
            frames.append(frame)
        d.PerFrameFunctionalGroupsSequence = own
        d.is_little_endian, d.is_implicit_VR = True, False
        if kind == "explicit":
            d.PixelData = np.array(frames).astype("<u2").tobytes()
            d["PixelData"].VR = "OW"
        else:
            d.PixelData = encapsulate([encoded(kind, f, 12, False)[0] for f in frames])
            d["PixelData"].is_undefined_length = True
            d["PixelData"].VR = "OB"
        d.save_as(folder / "mr.dcm", write_like_original=False)
        directions = np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]]) @ FLIP
        case(f"enhanced-{kind}", "mr.dcm", np.array([values[z] for z in range(4)]), [0.75, 0.5, 1.5], [0, -7, 8], directions, ras=True)


# ---------------------------------------------------------------------------------------------- TIFF and ANALYZE

def tiffs():
    shape = (5, 17, 23)
    for dtype in ("u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8"):
        values = (RNG.normal(0, 40, shape)).astype(dtype) if dtype[0] == "f" else RNG.integers(0, 120, shape).astype(dtype)
        for order in "<>":
            for compression, predictor in [(None, None), ("lzw", None), ("lzw", 2), ("zlib", None), ("packbits", None)]:
                if predictor and dtype[0] == "f":
                    predictor = 3
                for big in (False, True):
                    name = f"tiff-{dtype}-{'le' if order == '<' else 'be'}-{compression}-{predictor}-{'big' if big else 'classic'}"
                    (OUT / name).mkdir(parents=True, exist_ok=True)
                    # The library that we use ends too early in some LZW tiles, and then refuses them.
                    tiled = dtype == "u2" and big and compression != "lzw"
                    options = {"tile": (16, 16)} if tiled else {"rowsperstrip": 4}
                    tifffile.imwrite(OUT / name / "v.tif", values, byteorder=order, bigtiff=big, compression=compression,
                                     predictor=predictor, photometric="minisblack", metadata=None,
                                     resolution=(50, 25), resolutionunit="CENTIMETER", **options)
                    read = tifffile.imread(OUT / name / "v.tif")
                    case(name, "v.tif", read.astype(np.float64), [0.2, 0.4, 0.2])
    values = RNG.integers(0, 60000, shape).astype("u2")
    for unit, mm in [("um", 1e-3), ("mm", 1), ("\\u00B5m", 1e-3), ("cm", 10)]:
        name = f"tiff-imagej-{unit.strip(chr(92))}"
        (OUT / name).mkdir(parents=True, exist_ok=True)
        tifffile.imwrite(OUT / name / "v.tif", values, imagej=True, resolution=(4, 2),
                         metadata={"axes": "ZYX", "spacing": 3.5, "unit": unit})
        case(name, "v.tif", values.astype(np.float64), [0.25 * mm, 0.5 * mm, 3.5 * mm])
    name = "tiff-ome"
    (OUT / name).mkdir(parents=True, exist_ok=True)
    tifffile.imwrite(OUT / name / "v.ome.tif", values, ome=True, photometric="minisblack", metadata={
        "axes": "ZYX", "PhysicalSizeX": 0.25, "PhysicalSizeXUnit": "µm", "PhysicalSizeY": 0.5, "PhysicalSizeYUnit": "µm",
        "PhysicalSizeZ": 2000, "PhysicalSizeZUnit": "nm"})
    case(name, "v.ome.tif", values.astype(np.float64), [0.25e-3, 0.5e-3, 2e-3])
    for name, file in [("tiff-folder", "in"), ("tiff-pattern", "in/s*_?.tif")]:
        (OUT / name / "in").mkdir(parents=True, exist_ok=True)
        for z in range(5):
            tifffile.imwrite(OUT / name / f"in/slice_{z + 8 if name == 'tiff-folder' else z}.tif", values[z], metadata=None)
        case(name, file, values.astype(np.float64), [1, 1, 1])
    # Real ones: the head of a large ImageJ file keeps one page's header, and all pages behind it.
    name = "tiff-imagej-contiguous"
    (OUT / name).mkdir(parents=True, exist_ok=True)
    text = "ImageJ=1.53t\nimages=5\nslices=5\nunit=mm\nspacing=2.0\n"
    tifffile.imwrite(OUT / name / "v.tif", values[0], description=text, metadata=None, resolution=(2, 2), byteorder=">")
    with open(OUT / name / "v.tif", "ab") as out:
        with tifffile.TiffFile(OUT / name / "v.tif") as tif:
            end = tif.pages[0].dataoffsets[0] + values[0].nbytes
        out.truncate(end)
        out.write(values[1:].astype(">u2").tobytes())
    case(name, "v.tif", values.astype(np.float64), [0.5, 0.5, 2])


def analyze():
    for dtype in ("u1", "i2", "i4", "f4", "f8", "i1", "u2", "u4"):
        for order in "<>":
            for scaled in (False, True):
                values = RNG.integers(0, 100, (4, 5, 6)).astype(dtype)
                name = f"analyze-{dtype}-{'le' if order == '<' else 'be'}-{'spm' if scaled else 'plain'}"
                (OUT / name).mkdir(parents=True, exist_ok=True)
                header = nibabel.Spm2AnalyzeHeader(endianness=order)
                # SPM's codes beyond those that nibabel knows.
                code = {"i1": 130, "u2": 132, "u4": 136}.get(dtype)
                header.set_data_dtype("u1" if code else dtype)
                header["datatype"] = code or header["datatype"]
                header.set_data_shape((6, 5, 4))
                header.set_zooms((1.5, 2, 3))
                if scaled:
                    header["scl_slope"], header["scl_inter"] = 0.5, -3
                data = values.astype(np.dtype(dtype).newbyteorder(order)).tobytes()
                (OUT / name / "v.hdr").write_bytes(header.binaryblock)
                (OUT / name / "v.img").write_bytes(data)
                if code:
                    read = values * 0.5 - 3 if scaled else values
                else:
                    read = np.asarray(nibabel.load(OUT / name / "v.hdr").dataobj).T
                case(name, "v.img" if scaled else "v.hdr", read, [1.5, 2, 3])


for make in (public_files, public_series, encoders, series_written_by_itk, enhanced, tiffs, analyze):
    try:
        make()
    except Exception:
        print(f"{make.__name__} failed", file=sys.stderr)
        raise
print(len(list(OUT.glob("*/expected.toml"))), "cases")
