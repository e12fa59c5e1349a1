//! Contextual ambient occlusion for volumes: exact under moving clip shapes, the same for both eyes, on plain Vulkan.
//!
//! A volume is classified into opacities, every voxel gets an ambient factor from the opacity around it, and both eyes are
//! drawn from these two volumes. When a clip shape moves, only voxels whose neighbourhood it changed are computed again,
//! and the result equals a full recomputation bit for bit. The ambient factor belongs to the point in space and not to a
//! picture, so the left and the right eye read the same one.
//!
//! ```text
//! volume file ─ volume/ ─ transfer ─ [opacity] ─ [clip] ─ [ambient occlusion] ─ [raycast, both eyes] ─ image / engine's swapchain
//!                                         stage/ + method/ + spirv/                   └ measure/ (errors, charts, stability)
//! ```
//!
//! # The modules, in the order in which data pass through them
//!
//! Each uses only those above it.
//!
//! | module | what it is |
//! |---|---|
//! | [`error`] | what can go wrong, with the file, field, call or limit |
//! | [`view`] [`transfer`] [`mesh`] [`occlusion`] [`lattice`] [`clip`] [`scene`] | plain data: the eyes; opacity and colour; triangle meshes; how occlusion is computed; the directions of a sweep; clip shapes and poses; the scene file |
//! | [`volume`] [`picture`] | files in: NRRD, NIfTI, MetaImage, raw, built-in volumes; files out: NRRD, PNG |
//! | [`cpu`] | the truth: each numerical stage once more, the paper's equation in plain loops. For tests, not a fallback |
//! | [`gpu`] | Vulkan and nothing else: device (our own, or a host's), memory, pipelines, visible barriers, timestamps |
//! | [`stage`] | the host side of each kernel of `spirv/`: parameters, bindings, `record` |
//! | [`method`] | one method of ambient occlusion on one page each: dispatch, barrier, dispatch |
//! | [`renderer`] | the frame: what changed, which stages run for it, both eyes |
//! | [`measure`] | is it exact, do both eyes see the same; how far is each method from the truth, how fast, and where does it fail |
//!
//! # Conventions, once and for all
//!
//! * **Arrays**: `[x, y, z]`, and x is fastest in memory.
//! * **Index space**: voxel (0, 0, 0) is the first in memory; its *centre* is at index position (0, 0, 0), so the volume
//!   reaches from -0.5 to `dims` - 0.5. It is the corner with the smallest world coordinates.
//! * **World frame**: millimetres, origin at the volume's centre, axes along the volume's index axes, right-handed:
//!   `p = (i - (dims - 1)/2) · spacing`. Clips, eyes and light live in it. Origin and directions of a file are carried to
//!   output files and change nothing else; where they make the axes left-handed, pictures are mirror images, and
//!   `cao info` says so.
//! * **Lengths** in mm, **angles** in degrees, rotations about the fixed axes x, then y, then z
//!   (`p = T + Rz·Ry·Rx·(S·p_local)`); column vectors, matrices as [`glam`] has them.
//! * **Eyes** look along -z of their frame, +y is up, +x to the right, as in OpenXR; the field of view is four signed
//!   tangents. Clip space is Vulkan's: y down, depth 0 at the near plane and 1 at the far plane. Rows of images and `uv`
//!   start at the top left. Index 0 is the left eye, 1 the right one, 2 and 3 are their insets where there are four views.
//! * **Opacity** is in 0 … 1 *per reference length* (by default the smallest spacing): a path of length `s` lets
//!   `(1 - a)^(s / reference)` through. Between voxels it is trilinear, and voxels outside the volume count as 0, so that it
//!   fades over one voxel beyond the outermost centres.
//! * **Ambient factor**: 0 fully occluded, 1 unobstructed; 1 also where no value is needed.
//! * **Colours** are sRGB in files (transfer function, scene, PNG) and linear everywhere else; rendered pixels are linear and
//!   premultiplied by their opacity.
//! * **Values** of a volume keep the file's type and meaning (Hounsfield, 16 bits); nothing is rescaled to 8 bits.
//!
//! # A picture
//!
//! ```no_run
//! use cao::glam::Vec3;
//! use cao::{Clip, Gpu, Look, OpenOptions, Picture, Pose, Renderer, Setup, Shape, StereoRig, TransferFunction};
//!
//! # fn main() -> cao::Result<()> {
//! let volume = cao::volume::open("builtin:engine:64")?; // or the path of a file
//! let transfer = TransferFunction::load("auto", volume.range())?;
//! let gpu = Gpu::open(&OpenOptions::default())?;
//! let setup = Setup::swept(volume.min_spacing());
//! let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, cao::renderer::COLOUR)?;
//!
//! // A ball of 20 mm is cut out of one corner. In a loop over frames: move it, update, draw.
//! let pose = Pose { translate_mm: Vec3::new(19.0, -19.0, 19.0), scale: Vec3::splat(20.0), ..Pose::default() };
//! renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }])?;
//! renderer.update(&mut |_share_done| ())?;
//!
//! let views = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 1.0, 1000.0)?;
//! let (image, _times) = renderer.draw(&views, &Look::default(), [512, 512])?;
//! let [left, right] = image.colour.each_ref().map(|eye| Picture::over(512, 512, eye, [0.0; 3]));
//! Picture::beside(&left, &right).write_png("stereo.png".as_ref())?;
//! # Ok(())
//! # }
//! ```
//!
//! An engine that has a Vulkan device of its own hands it to [`Gpu::adopt`] and records with
//! [`Renderer::record_update`] and [`Renderer::record_draw`] into its own command buffer ([`Gpu::record_into`]); nothing
//! is submitted or waited for there.

#![forbid(unsafe_code)]

pub mod cast;
pub mod clip;
pub mod draw;
pub mod drive;
pub mod error;
pub mod field;
pub mod host;
pub mod method;
pub mod renderer;
pub mod stages;
pub mod subject;
pub mod sweep;
pub mod verify;

pub use cao_gpu as gpu;
pub use cao_model as model;

pub use cao_model::clip::{Clip, Mode, Pose, Shape};
pub use cao_model::look::Look;
pub use cao_model::mesh::TriangleMesh;
pub use cao_model::methods::{METHODS, Method};
pub use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
pub use cao_model::settings::{AntiAliasing, MapSettings, Scope, Setup};
pub use cao_model::transfer::TransferFunction;
pub use cao_model::view::{StereoRig, View};
pub use cao_model::volume::Volume;
pub use error::{Error, Result};
pub use gpu::{Gpu, OpenOptions};
pub use renderer::Renderer;

/// The version whose vectors are in this crate's signatures.
pub use glam;
