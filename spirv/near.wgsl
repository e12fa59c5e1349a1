// Which bricks an edit concerns: those with voxels that need a value and within reach of a changed brick (method.md section 5).
//
// `spread` is one pass of a separable Euclidean distance transform over bricks, along one axis; the distance between two
// bricks is that of their nearest voxels. After three passes `choose` decides.

struct NearParams {
    bricks: vec3<u32>,
    axis: u32,
    // mm
    spacing: vec3<f32>,
    // how far a change of opacity reaches, mm
    reach: f32,
    // 1: voxels that no sample with opacity interpolates get a value too
    unneeded: u32,
}

struct Distance {
    squared: array<f32>,
}

struct Contact {
    // as in carve.wgsl
    bits: array<u32>,
}

struct Todo {
    brick: array<u32>,
}

struct Count {
    bricks: atomic<u32>,
}

var<immediate> params: NearParams;
@group(0) @binding(0) var<storage, read> before: Distance;
@group(0) @binding(1) var<storage, read_write> after: Distance;
@group(0) @binding(2) var<storage, read> contact: Contact;
@group(0) @binding(3) var<storage, read_write> todo: Todo;
@group(0) @binding(4) var<storage, read_write> count: Count;

fn brick_of(index: u32) -> vec3<u32> {
    return vec3(index % params.bricks.x, index / params.bricks.x % params.bricks.y, index / (params.bricks.x * params.bricks.y));
}

// One invocation a brick.
@compute @workgroup_size(64)
fn spread(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if index >= params.bricks.x * params.bricks.y * params.bricks.z {
        return;
    }
    let here = i32(brick_of(index)[params.axis]);
    let size = i32(params.bricks[params.axis]);
    let stride = vec3(1u, params.bricks.x, params.bricks.x * params.bricks.y)[params.axis];
    let edge = params.spacing[params.axis];
    let first = index - u32(here) * stride;
    // Bricks n apart have 8 (n - 1) + 1 voxels' spacing between their nearest voxels.
    let most = i32(min(params.reach / (8.0 * edge) + 2.0, f32(size)));
    var least = before.squared[index];
    for (var there = max(here - most, 0); there <= min(here + most, size - 1); there++) {
        let gap = f32(max(8 * abs(there - here) - 7, 0)) * edge;
        least = min(least, before.squared[first + u32(there) * stride] + gap * gap);
    }
    after.squared[index] = least;
}

// One invocation a brick.
@compute @workgroup_size(64)
fn choose(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.x + id.y * groups.x * 64u;
    if index >= params.bricks.x * params.bricks.y * params.bricks.z {
        return;
    }
    var chosen = 0u;
    if before.squared[index] <= params.reach * params.reach {
        chosen = params.unneeded;
        // The brick's own opacity, or a neighbour's that touches it.
        let middle = vec3<i32>(brick_of(index));
        for (var n = 0; n < 27; n++) {
            let beside = vec3(n % 3, n / 3 % 3, n / 9) - 1;
            let place = middle + beside;
            if all(place >= vec3(0)) && all(place < vec3<i32>(params.bricks)) {
                let at = vec3<u32>(place);
                let bits = contact.bits[(at.z * params.bricks.y + at.y) * params.bricks.x + at.x];
                chosen |= bits >> u32(26 - n) & 1u;
            }
        }
    }
    todo.brick[index] = chosen;
    if chosen == 1u {
        atomicAdd(&count.bricks, 1u);
    }
}
