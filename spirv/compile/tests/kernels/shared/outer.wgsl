#include "shared/parts.wgsl"

struct Outer {
    inner: array<Inner, 2>,
}
