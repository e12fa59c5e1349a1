//! Every stage of a frame, by the phase that it belongs to.

use cao_gpu::{Phase, Stage};

/// Depth layers of a clip mesh.
pub const PEEL: Stage = Stage::new("peel", Phase::Clip);
/// Dilation maps of a clip mesh.
pub const DILATE: Stage = Stage::new("dilate", Phase::Clip);
/// The table of rays.
pub const DIRECTIONS: Stage = Stage::new("directions", Phase::Prepare);
/// The bricks of V_PAO.
pub const PRECOMPUTE_BRICKS: Stage = Stage::new("precompute bricks", Phase::Prepare);
/// V_PAO.
pub const PRECOMPUTE: Stage = Stage::new("precompute lao", Phase::Prepare);
/// Opacities after features.
pub const FEATURES: Stage = Stage::new("features", Phase::Opacity);
/// Which bricks can have opacity.
pub const OCCUPANCY: Stage = Stage::new("occupancy", Phase::Opacity);
/// V_o before clipping.
pub const OPACITY: Stage = Stage::new("opacity", Phase::Opacity);
/// The clips, and what they do to each brick, for the picture alone.
pub const CLIPS: Stage = Stage::new("clips", Phase::Clip);
/// V_o after clipping, and the category of every voxel.
pub const CLASSIFY: Stage = Stage::new("classify", Phase::Clip);
/// V_o in place, and what changed.
pub const CARVE: Stage = Stage::new("carve", Phase::Clip);
/// What solids fill of each voxel.
pub const SOLIDS: Stage = Stage::new("solids", Phase::Clip);
/// The bricks to work on.
pub const BRICKS: Stage = Stage::new("bricks", Phase::Ambient);
/// Rays of all voxels.
pub const LAO: Stage = Stage::new("lao", Phase::Ambient);
/// Rays of the voxels that a clip affects.
pub const CONTEXTUAL: Stage = Stage::new("contextual", Phase::Ambient);
/// The bricks within reach of a change.
pub const CHOOSE: Stage = Stage::new("choose", Phase::Ambient);
/// How volumes of means are looked up.
pub const TABLE: Stage = Stage::new("table", Phase::Prepare);
/// Volumes of means, level by level.
pub const LEVELS: [Stage; 9] = [
    Stage::new("level 1", Phase::Ambient),
    Stage::new("level 2", Phase::Ambient),
    Stage::new("level 3", Phase::Ambient),
    Stage::new("level 4", Phase::Ambient),
    Stage::new("level 5", Phase::Ambient),
    Stage::new("level 6", Phase::Ambient),
    Stage::new("level 7", Phase::Ambient),
    Stage::new("level 8", Phase::Ambient),
    Stage::new("level 9", Phase::Ambient),
];
/// Shells of cubes.
pub const PRODUCT: Stage = Stage::new("product", Phase::Ambient);
/// Cones of these bricks.
pub const CONES: Stage = Stage::new("cones", Phase::Ambient);
/// Rays of these bricks.
pub const RAYS: Stage = Stage::new("rays", Phase::Ambient);
/// Which bricks have other features.
pub const LABELS: Stage = Stage::new("labels", Phase::Ambient);
/// Opacities of each feature.
pub const MASK: Stage = Stage::new("mask", Phase::Ambient);
/// Rays of features of the bricks within reach of a change.
pub const FDAO: Stage = Stage::new("fdao", Phase::Ambient);
/// V_o as a network takes it.
pub const GRID: Stage = Stage::new("grid", Phase::Ambient);
/// The network.
pub const NETWORK: Stage = Stage::new("network", Phase::Ambient);
/// What it gives these bricks.
pub const OUTPUT: Stage = Stage::new("output", Phase::Ambient);
/// The table of shells.
pub const SHELLS: Stage = Stage::new("shells", Phase::Prepare);
/// The summed-area table.
pub const SUMS: Stage = Stage::new("sums", Phase::Ambient);
/// Lines of these bricks.
pub const LINES: Stage = Stage::new("lines", Phase::Ambient);
/// Boxes of these bricks.
pub const BOXES: Stage = Stage::new("boxes", Phase::Ambient);
/// Histograms of samples.
pub const HISTOGRAMS: Stage = Stage::new("histograms", Phase::Ambient);
/// Their clusters.
pub const CLUSTERS: Stage = Stage::new("clusters", Phase::Ambient);
/// The cluster of every voxel.
pub const ASSIGN: Stage = Stage::new("assign", Phase::Ambient);
/// Ambient factors of the clusters.
pub const SHADE: Stage = Stage::new("shade", Phase::Ambient);
/// Those of the voxels of these bricks.
pub const EXPAND: Stage = Stage::new("expand", Phase::Ambient);
/// What a build made of several frames is shown.
pub const COMMIT: Stage = Stage::new("commit", Phase::Ambient);
/// How far rays of the picture may leap.
pub const DISTANCES: Stage = Stage::new("distances", Phase::Draw);
/// Where a host's scene ends the picture's rays.
pub const SCENE_DEPTH: Stage = Stage::new("scene depth", Phase::Draw);
/// What pixels show of surfaces.
pub const GBUFFER: Stage = Stage::new("gbuffer", Phase::Draw);
/// Occlusion of pixels by rays.
pub const TRACE: Stage = Stage::new("trace", Phase::Ambient);
/// Occlusion of pixels by volumes of triangles.
pub const GATHER: Stage = Stage::new("gather", Phase::Ambient);
/// Occlusion of pixels by volumes of triangles, drawn.
pub const VOLUMES: Stage = Stage::new("volumes", Phase::Ambient);
/// Occlusion of all pixels from that of some.
pub const UPSAMPLE: Stage = Stage::new("upsample", Phase::Ambient);
/// Occlusion of pixels by what the image shows.
pub const IMAGE_SPACE: Stage = Stage::new("image space", Phase::Ambient);
/// Pixels that no other is like.
pub const FAILED: Stage = Stage::new("failed pixels", Phase::Ambient);
/// The light of surfaces.
pub const LIGHT: Stage = Stage::new("light", Phase::Draw);
/// The picture.
pub const RAYCAST: Stage = Stage::new("raycast", Phase::Draw);
/// The picture into a host's attachments.
pub const PRESENT: Stage = Stage::new("present", Phase::Draw);
