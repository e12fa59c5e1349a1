// Voxels that clips leave whole, because their feature is spared. Needs the bindings `features` and `feature_index`.

#include "shared/features.wgsl"

fn is_spared(voxel: vec3<u32>) -> bool {
    return features.any_spared == 1u && features.each[textureLoad(feature_index, voxel, 0).r].spared == 1u;
}
