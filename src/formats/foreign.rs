//! Formats that people try and that are not read: named, with what converts them.

use std::path::Path;

/// Bytes at the start of a file that only this format has.
struct Magic(usize, &'static [u8]);

/// A format: name, signatures, endings of names, what to do.
struct Foreign(&'static str, &'static [Magic], &'static [&'static str], &'static str);

const BIO_FORMATS: &str = "Fiji (File > Import > Bio-Formats, then Save As > Tiff) converts it";
const VTK: &str = "ParaView, or vtk in Python (vtkMetaImageWriter), saves it as .mha";
const NIBABEL: &str = "nibabel in Python (nibabel.save(nibabel.load(FILE), 'out.nii.gz')) converts it";
const UNPACK: &str = "unpack it first, then name the folder or the file";
const SLICES: &str =
    "pictures with 8 bits a value; Fiji (File > Import > Image Sequence) saves them as one TIFF";

const DICOM: &str = match cfg!(feature = "dicom") {
    true => "its content is not that of a DICOM file; dcm2niix may say more",
    false => "this build leaves it out (feature dicom of cao-formats); dcm2niix converts a folder to NIfTI",
};

/// Content is asked before names, and in this order.
const FORMATS: [Foreign; 24] = [
    Foreign("DICOM", &[Magic(128, b"DICM")], &[".dcm", ".ima"], DICOM),
    Foreign("MGH/MGZ", &[], &[".mgz", ".mgh"], "mri_convert, or nibabel in Python, saves it as .nii.gz"),
    Foreign("VTK XML image data", &[Magic(0, b"<?xml"), Magic(0, b"<VTKFile")], &[".vti", ".vtk.xml"], VTK),
    Foreign("legacy VTK", &[Magic(0, b"# vtk DataFile")], &[".vtk"], VTK),
    // Endings first where one container has several formats.
    Foreign("MINC", &[], &[".mnc"], "mnc2nii, or nibabel in Python, saves it as .nii"),
    Foreign("NeXus", &[], &[".nxs"], "h5py in Python reads its data; tifffile.imwrite saves them as TIFF"),
    Foreign(
        "HDF5",
        &[Magic(0, b"\x89HDF\r\n\x1a\n")],
        &[".h5", ".hdf5", ".hdf"],
        "h5py in Python reads its data; tifffile.imwrite saves them as TIFF",
    ),
    Foreign(
        "NetCDF",
        &[Magic(0, b"CDF\x01"), Magic(0, b"CDF\x02"), Magic(0, b"CDF\x05")],
        &[".nc"],
        "xarray in Python reads its data; tifffile.imwrite saves them as TIFF",
    ),
    Foreign("Zarr", &[], &[".zarr"], ZARR),
    Foreign("Nikon ND2", &[Magic(0, b"\xda\xce\xbe\x0a")], &[".nd2"], BIO_FORMATS),
    Foreign("Zeiss CZI", &[Magic(0, b"ZISRAWFILE")], &[".czi"], BIO_FORMATS),
    Foreign("Leica LIF", &[], &[".lif", ".lof"], BIO_FORMATS),
    Foreign("a microscope's format", &[], &[".oib", ".oif", ".oir", ".ims", ".lsm5", ".vsi"], BIO_FORMATS),
    Foreign(
        "MRC",
        &[Magic(208, b"MAP ")],
        &[".mrc", ".rec", ".st", ".map"],
        "mrc2tif (IMOD), or mrcfile in Python, converts it",
    ),
    Foreign("Amira mesh", &[Magic(0, b"# AmiraMesh"), Magic(0, b"# Avizo")], &[".am"], BIO_FORMATS),
    Foreign("Philips PAR/REC", &[], &[".par"], NIBABEL),
    Foreign("ECAT", &[Magic(0, b"MATRIX7")], &[".v"], NIBABEL),
    Foreign(
        "NumPy array",
        &[Magic(0, b"\x93NUMPY")],
        &[".npy", ".npz"],
        "tifffile.imwrite('out.tif', numpy.load(FILE)) in Python saves it as TIFF",
    ),
    Foreign(
        "OpenVDB",
        &[Magic(0, b" BDV")],
        &[".vdb"],
        "vdb_tool or pyopenvdb copies its grid to an array for TIFF",
    ),
    Foreign("PNG", &[Magic(0, b"\x89PNG\r\n\x1a\n")], &[".png"], SLICES),
    Foreign("JPEG", &[Magic(0, b"\xff\xd8\xff")], &[".jpg", ".jpeg"], SLICES),
    Foreign("BMP", &[Magic(0, b"BM")], &[".bmp"], SLICES),
    Foreign("a zip archive", &[Magic(0, b"PK\x03\x04")], &[".zip"], UNPACK),
    Foreign(
        "an archive",
        &[Magic(257, b"ustar"), Magic(0, b"7z\xbc\xaf\x27\x1c")],
        &[".tar", ".tar.gz", ".tgz", ".7z"],
        UNPACK,
    ),
];

const ZARR: &str = "zarr in Python reads its arrays; tifffile.imwrite saves them as TIFF, ngff-zarr converts OME-Zarr to .nrrd";

/// What to say of a file that is none of ours; `None` when nobody knows it.
pub(crate) fn advice(path: &Path, head: &[u8]) -> Option<String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let starts = |Magic(at, bytes): &Magic| head.get(*at..).is_some_and(|rest| rest.starts_with(bytes));
    let ends = |format: &Foreign| format.2.iter().any(|end| name.ends_with(end));
    let specific = FORMATS.iter().find(|format| format.1.is_empty() && ends(format));
    let content = || FORMATS.iter().find(|format| format.1.iter().any(starts));
    let ending = || FORMATS.iter().find(|format| ends(format));
    let Foreign(name, _, _, advice) = specific.or_else(content).or_else(ending)?;
    Some(format!("{name}, which is not read: {advice}"))
}

/// The same of a folder.
pub(crate) fn advice_on_folder(path: &Path) -> Option<String> {
    let zarr = [".zarray", ".zgroup", "zarr.json"].iter().any(|name| path.join(name).is_file());
    zarr.then(|| format!("Zarr, which is not read: {ZARR}"))
}
