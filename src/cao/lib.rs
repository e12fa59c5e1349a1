//! Contextual ambient occlusion for volumes: exact under moving clip shapes, the same for both eyes, on plain Vulkan.
//!
//! A volume is classified into opacities, every voxel gets an ambient factor from the opacity around it, and both eyes are
//! drawn from these two volumes. When a clip shape moves, only voxels whose neighbourhood it changed are computed again,
//! and the result equals a full recomputation bit for bit. The ambient factor belongs to the point in space and not to a
//! picture, so the left and the right eye read the same one.
//!
//! ```text
//! volume ─ Renderer::new ─ [occupancy] ─ [opacity, clips, ambient: the method] ─ [distances] ─ [raycast, all views] ─ image / engine's swapchain
//!           field/           field/        a room a method, with clip/             draw/         draw/
//! ```
//!
//! # The modules
//!
//! | module | what it is |
//! |---|---|
//! | [`model`] | plain data, another crate: volumes, transfer functions, clips, views, settings, [`METHODS`]. Files come by `cao-formats` |
//! | [`gpu`] | Vulkan and nothing else, another crate: device (our own, or a host's), memory, pipelines, visible barriers, timestamps |
//! | [`field`] [`clip`] [`draw`] | the host side of kernels: the volume and its bricks; clips; eyes and pictures |
//! | [`cast`] [`rays`] [`features`] [`spao`] [`cones`] [`tables`] [`vicinity`] [`histograms`] [`network`] | the methods, a room each: kernels' host sides, and what there is to do after a change; [`pyramid`]: what two of them share |
//! | [`ambient`] [`method`] [`drive`] | what a method is to the renderer; what makes each; the two ways to walk its parts |
//! | [`by_brick`] | what methods have in common that compute brick by brick from V_o alone |
//! | [`image_space`] | ambient occlusion of what pixels show of meshes or of a volume's first hit, to compare with |
//! | [`subject`] [`renderer`] | a scene on the device; the frame: what changed, which parts run for it, all views |
//! | [`verify`] | instruments: is it exact, do both eyes see the same, what would other settings give |
//! | [`stages`] | every stage whose time is taken |
//!
//! Each kernel of `spirv/` has its host side here, its twin in `cao-twin` and its test in `tests/kernels/` under the same name.
//!
//! # Conventions, once and for all
//!
//! * **Arrays**: `[x, y, z]`, and x is fastest in memory.
//! * **Index space**: voxel (0, 0, 0) is the first in memory; its *centre* is at index position (0, 0, 0), so the volume
//!   reaches from -0.5 to `dims` - 0.5. It is the corner with the smallest world coordinates.
//! * **World frame**: millimetres, origin at the volume's centre, axes along the volume's index axes, right-handed:
//!   `p = (i - (dims - 1)/2) · spacing`. Clips, eyes and light live in it.
//! * **Patient frame**: right, anterior, superior, the same origin. `cao-formats` reads voxels in the order whose index axes
//!   are nearest to these, so that no picture is a mirror image; what is left where a grid is oblique is a rotation,
//!   [`Turn::into_axes_of`] the volume, for the caller to apply to clips, eyes and light. A renderer knows nothing of it, and
//!   takes a volume with left-handed axes as it is. Read-backs have the volume's order; `cao_formats::write_nrrd` writes the
//!   file's.
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
//! # Examples
//!
//! `docs/examples/` has a picture in thirty lines, a whole host in miniature, and every method at its settings.
//!
//! An engine that has a Vulkan device of its own hands it to [`Gpu::adopt`] and records with
//! [`Renderer::record_update`] and [`Renderer::record_draw`] into its own command buffer ([`Gpu::record_into`]); nothing
//! is submitted or waited for there.

#![forbid(unsafe_code)]

pub mod ambient;
pub mod build;
pub mod by_brick;
pub mod cast;
pub mod clip;
pub mod cones;
pub mod draw;
pub mod drive;
pub mod error;
pub mod features;
pub mod field;
pub mod histograms;
pub mod host;
pub mod image_space;
pub mod mesh;
pub mod mesh_renderer;
pub mod method;
pub mod network;
pub mod picture_occlusion;
pub mod pyramid;
pub mod rays;
pub mod renderer;
pub mod spao;
pub mod stages;
pub mod subject;
pub mod tables;
pub mod verify;
pub mod vicinity;

pub use cao_gpu as gpu;
pub use cao_model as model;

pub use build::{Budget, Stale, Updated};
pub use cao_model::clip::{Clip, Mode, Pose, Shape};
pub use cao_model::fit::Fitting;
pub use cao_model::frame::{Frame, Turn};
pub use cao_model::look::Look;
pub use cao_model::mesh::TriangleMesh;
pub use cao_model::methods::{METHODS, Method};
pub use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
pub use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Samples, Scope, Setup, Support};
pub use cao_model::transfer::TransferFunction;
pub use cao_model::view::{StereoRig, View};
pub use cao_model::volume::Volume;
pub use error::{Error, Result};
pub use gpu::{Gpu, OpenOptions};
pub use mesh_renderer::MeshRenderer;
pub use renderer::Renderer;

/// The version whose vectors are in this crate's signatures.
pub use glam;

/// The README's example is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
