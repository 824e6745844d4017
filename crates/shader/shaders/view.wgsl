// The skinning of `skinning.wgsl` for WebGL 2, which has no compute: a fragment per Gaussian, textures in place of buffers, the choice
// made while it runs. Comes after the functions of `skinning.wgsl` that read no binding. MIT OR Apache-2.0.
//
// Texel k of Gaussian i is at (i % width, i / width + k rows).

struct View {
    // World position of the eye.
    camera: vec3<f32>,
    // Gaussians.
    count: u32,
    width: u32,
    rows: u32,
    influence_sets: u32,
    // 0 closed form, 1 power steps, 2 aligned sum, 3 dual quaternions, 4 sum of quaternions with w >= 0, 5 Gram-Schmidt of the blended matrix.
    choice: u32,
    power_steps: u32,
    sh_degree: u32,
    // 1: the view is turned into the frame of the rest pose. 0: SH are read as if nothing had been skinned.
    turned: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> view: View;
// Mean and opacity; quaternion; standard deviations.
@group(0) @binding(1) var gaussians: texture_2d<f32>;
// Joint indices: a texel per set of four influences.
@group(0) @binding(2) var indices: texture_2d<f32>;
@group(0) @binding(3) var weights: texture_2d<f32>;
// Quaternion at (2 j, 0), translation at (2 j + 1, 0).
@group(0) @binding(4) var joints: texture_2d<f32>;
// Coefficients one after another, four numbers a texel.
@group(0) @binding(5) var sh: texture_2d<f32>;

struct Posed {
    // Posed mean; degrees between the choice and the average.
    @location(0) mean: vec4<f32>,
    // xx, xy, xz, yy
    @location(1) first: vec4<f32>,
    // yz, zz, 0, 0
    @location(2) second: vec4<f32>,
    // RGB, opacity.
    @location(3) colour: vec4<f32>,
}

fn place(i: u32, k: u32) -> vec2<i32> {
    return vec2<i32>(i32(i % view.width), i32(i / view.width + k * view.rows));
}

fn joint_rotation(j: f32) -> vec4<f32> {
    return textureLoad(joints, vec2<i32>(2 * i32(j), 0), 0);
}

fn joint_translation(j: f32) -> vec3<f32> {
    return textureLoad(joints, vec2<i32>(2 * i32(j) + 1, 0), 0).xyz;
}

fn gathered(i: u32) -> Blend {
    var blend = empty_blend();
    for (var k = 0u; k < view.influence_sets; k += 1u) {
        let j = textureLoad(indices, place(i, k), 0);
        let w = textureLoad(weights, place(i, k), 0);
        take(&blend, joint_rotation(j.x), joint_translation(j.x), w.x);
        take(&blend, joint_rotation(j.y), joint_translation(j.y), w.y);
        take(&blend, joint_rotation(j.z), joint_translation(j.z), w.z);
        take(&blend, joint_rotation(j.w), joint_translation(j.w), w.w);
    }
    return blend;
}

fn summed(i: u32, blend: Blend) -> Sum {
    var sum = Sum(vec4<f32>(0.0), vec4<f32>(0.0));
    for (var k = 0u; k < view.influence_sets; k += 1u) {
        let j = textureLoad(indices, place(i, k), 0);
        let w = textureLoad(weights, place(i, k), 0);
        take_aligned(&sum, joint_rotation(j.x), joint_translation(j.x), w.x, blend.heaviest);
        take_aligned(&sum, joint_rotation(j.y), joint_translation(j.y), w.y, blend.heaviest);
        take_aligned(&sum, joint_rotation(j.z), joint_translation(j.z), w.z, blend.heaviest);
        take_aligned(&sum, joint_rotation(j.w), joint_translation(j.w), w.w, blend.heaviest);
    }
    return sum;
}

// A quaternion with w >= 0, times a weight that counts.
fn upright(q: vec4<f32>, weight: f32) -> vec4<f32> {
    return select(q, -q, q.w < 0.0) * max(weight, 0.0);
}

// Quaternions of whatever signs, summed: what engines do that do not align them.
fn summed_upright(i: u32) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var k = 0u; k < view.influence_sets; k += 1u) {
        let j = textureLoad(indices, place(i, k), 0);
        let w = textureLoad(weights, place(i, k), 0);
        sum += upright(joint_rotation(j.x), w.x) + upright(joint_rotation(j.y), w.y)
            + (upright(joint_rotation(j.z), w.z) + upright(joint_rotation(j.w), w.w));
    }
    return normalized_or(sum, IDENTITY);
}

// The unit quaternion of a rotation matrix given by its columns: 4 q q^T holds sums of its entries.
fn quaternion_of(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>) -> vec4<f32> {
    let outer = Symmetric(
        vec4<f32>(1.0 + x.x - y.y - z.z, 1.0 - x.x + y.y - z.z, 1.0 - x.x - y.y + z.z, 1.0 + x.x + y.y + z.z),
        vec3<f32>(x.y + y.x, x.z + z.x, y.z + z.y),
        vec3<f32>(y.z - z.y, z.x - x.z, x.y - y.x),
    );
    return normalized_or(largest_column(outer), IDENTITY);
}

// The columns of the blended matrix made orthonormal one after another: what methods do that blend matrices.
fn gram_schmidt(blend: Blend) -> vec4<f32> {
    let x = blended_direction(blend, vec3<f32>(1.0, 0.0, 0.0));
    let y = blended_direction(blend, vec3<f32>(0.0, 1.0, 0.0));
    let first = x / max(length(x), 1.0e-20);
    let rest = y - dot(first, y) * first;
    let second = rest / max(length(rest), 1.0e-20);
    return quaternion_of(first, second, cross(first, second));
}

// A column of sum w R, times whatever length.
fn blended_direction(blend: Blend, axis: vec3<f32>) -> vec3<f32> {
    var still = blend;
    still.translation = vec3<f32>(0.0);
    return blended_mean(still, axis);
}

fn degrees_between(a: vec4<f32>, b: vec4<f32>) -> f32 {
    let near = min(length(a - b), length(a + b));
    let far = max(length(a - b), length(a + b));
    return degrees(4.0 * atan2(near, far));
}

fn sh_number(i: u32, at: u32) -> f32 {
    let four = textureLoad(sh, place(i, at / 4u), 0);
    let k = at % 4u;
    return select(select(four.w, four.z, k == 2u), select(four.y, four.x, k == 0u), k < 2u);
}

fn coefficient(i: u32, k: u32) -> vec3<f32> {
    return vec3<f32>(sh_number(i, 3u * k), sh_number(i, 3u * k + 1u), sh_number(i, 3u * k + 2u));
}

fn colour_of(i: u32, d: vec3<f32>) -> vec3<f32> {
    var rgb = vec3<f32>(0.5) + C0 * coefficient(i, 0u);
    if view.sh_degree >= 1u {
        rgb += sh_degree_1(d, coefficient(i, 1u), coefficient(i, 2u), coefficient(i, 3u));
    }
    if view.sh_degree >= 2u {
        let b = basis_2(d);
        rgb += b[0] * coefficient(i, 4u) + b[1] * coefficient(i, 5u) + b[2] * coefficient(i, 6u)
            + b[3] * coefficient(i, 7u) + b[4] * coefficient(i, 8u);
    }
    if view.sh_degree >= 3u {
        let b = basis_3(d);
        rgb += b[0] * coefficient(i, 9u) + b[1] * coefficient(i, 10u) + b[2] * coefficient(i, 11u)
            + b[3] * coefficient(i, 12u) + b[4] * coefficient(i, 13u) + b[5] * coefficient(i, 14u)
            + b[6] * coefficient(i, 15u);
    }
    return max(rgb, vec3<f32>(0.0));
}

@fragment
fn posed(@builtin(position) at: vec4<f32>) -> Posed {
    let i = u32(at.y) * view.width + u32(at.x);
    if i >= view.count {
        return Posed(vec4<f32>(0.0), vec4<f32>(0.0), vec4<f32>(0.0), vec4<f32>(0.0));
    }
    let own = textureLoad(gaussians, place(i, 0u), 0);
    let blend = gathered(i);
    let average = closed_form(blend);
    var mean = blended_mean(blend, own.xyz);
    var relative = average;
    if view.choice == 1u {
        relative = power_steps(blend, view.power_steps);
    } else if view.choice == 2u {
        relative = aligned_sum(blend, summed(i, blend));
    } else if view.choice == 3u {
        let motion = dual_quaternion(blend, summed(i, blend));
        relative = motion.rotation;
        mean = rotate(motion.rotation, own.xyz) + motion.translation;
    } else if view.choice == 4u {
        relative = summed_upright(i);
    } else if view.choice == 5u {
        relative = gram_schmidt(blend);
    }
    let rotation = multiply(relative, textureLoad(gaussians, place(i, 1u), 0));
    let c = covariance_of(rotation, textureLoad(gaussians, place(i, 2u), 0).xyz);
    let eye = mean - view.camera;
    let d = eye / max(length(eye), 1.0e-20);
    let colour = colour_of(i, select(d, rotate(conjugate(relative), d), view.turned == 1u));
    return Posed(
        vec4<f32>(mean, degrees_between(relative, average)),
        vec4<f32>(c.first, c.second.x),
        vec4<f32>(c.second.yz, 0.0, 0.0),
        vec4<f32>(colour, own.w),
    );
}
