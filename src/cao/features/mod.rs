//! Feature-driven ambient occlusion with contextual updates from change.

pub mod driven;
pub mod fdao;
pub mod labels;
pub mod mask;
