// How near a point is to what a clip hides.

#include "shared/layers.wgsl"

// A lower bound in mm of the distance from a point of the rigid frame to what an analytic clip hides, negative inside it; as
// clip.rs has it.
fn distance_to_hidden(c: u32, rigid: vec3<f32>) -> f32 {
    let kind = clips.clip[c].kind;
    var distance = 0.0;
    switch kind {
        case PLANE: {
            distance = -rigid.z;
        }
        case BOX: {
            distance = box_distance(rigid, clips.clip[c].scale.xyz);
        }
        default: {
            distance = local_distance(kind, rigid / clips.clip[c].scale.xyz) * clips.clip[c].scale.w;
        }
    }
    return select(distance, -distance, clips.clip[c].keep != 0u);
}
