"""warp's kernel, in a module of its own: warp reads the source of the module."""

# mypy: ignore-errors

import warp as wp


@wp.kernel
def spring_force(
    x: wp.array(dtype=wp.vec3d),
    f: wp.array(dtype=wp.vec3d),
    ends: wp.array(dtype=wp.vec2i),
    rest: wp.array(dtype=wp.float64),
    k: wp.float64,
    b: wp.float64,
):
    """One spring per thread; b = 0 is the constant spring."""
    s = wp.tid()
    i = ends[s][0]
    j = ends[s][1]
    gap = x[j] - x[i]
    length = rest[s]
    size = wp.length(gap)
    one = wp.float64(1.0)
    stiff = k
    if b > wp.float64(0.0):
        stiff = k * wp.exp(b * wp.abs(size / length - one))
    pull = stiff * (one - length / size) * gap
    wp.atomic_add(f, i, pull)
    wp.atomic_add(f, j, -pull)
