// Skinning of Gaussian splats: one source for every graphics language. MIT OR Apache-2.0.
//
// Per Gaussian, from joint motions x' = R(q) x + t relative to the rest pose, four influences or a multiple of four:
//
//   mean      = sum w_j (R(q_j) mean + t_j)                  (Eq. 6; the dual-quaternion entry points move it by their blend)
//   relative  = A, one rotation made of the q_j              (Eq. 7, or what stands in for it: the entry point's name)
//   shape     = covariance of A R_c diag(scale), or its quaternion (scales stay)
//   view      = R(A)^T (mean - camera) / |mean - camera|: read SH of the rest pose along it, or turn SH by A.
//
// Conventions: quaternions are (x, y, z, w), Hamilton's product, active; column vectors; metres; SH in the basis, order and
// signs of 3DGS. Quaternions that come in have unit length; their signs do not matter.
//
// Entry points: {two_bones, closed_form, power, aligned_sum, dual_quaternion}_{covariance, quaternion}, then, if wanted,
// `colour` (RGB read along the view) or `turn_sh`. One invocation per Gaussian, 64 a workgroup; no more than 65535 workgroups a
// dispatch, `first` is for what is beyond. The functions above the entry points read no binding: take them by name.

struct Params {
    // Gaussians of this dispatch, and the index of the first.
    count: u32,
    first: u32,
    // Sets of four influences per Gaussian; missing ones have weight 0 and any valid joint.
    influence_sets: u32,
    // Power steps of the `power` entry points; the paper takes 15.
    power_steps: u32,
    // World position of the eye.
    camera: vec3<f32>,
    // 0 to 3.
    sh_degree: u32,
    // Floats from a Gaussian's SH to the next one's, and from a coefficient's red to the next one's: 48 and 3 where the
    // Gaussians lie one after another, 3 and 3 count where the coefficients do.
    sh_stride: u32,
    sh_coefficient_stride: u32,
    unused_0: u32,
    unused_1: u32,
}

struct Joint {
    rotation: vec4<f32>,
    translation: vec3<f32>,
}

struct Gaussian {
    mean: vec3<f32>,
    rotation: vec4<f32>,
    // Standard deviations, not their logarithms.
    scale: vec3<f32>,
}

// ---- Quaternions -------------------------------------------------------------------------------------------------------

const EPSILON: f32 = 1.1920929e-7;
const IDENTITY: vec4<f32> = vec4<f32>(0.0, 0.0, 0.0, 1.0);

// First b, then a.
fn multiply(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

fn conjugate(q: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(-q.xyz, q.w);
}

// R(q) v of a unit quaternion.
fn rotate(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

fn largest_magnitude(v: vec4<f32>) -> f32 {
    let m = abs(v);
    return max(max(m.x, m.y), max(m.z, m.w));
}

// q / |q|, or `otherwise` if q is zero. Squares neither overflow nor vanish.
fn normalized_or(q: vec4<f32>, otherwise: vec4<f32>) -> vec4<f32> {
    let largest = largest_magnitude(q);
    if !(largest > 0.0) {
        return otherwise;
    }
    let scaled = q / largest;
    return scaled / sqrt(dot(scaled, scaled));
}

// Is q to be negated to lie on the side of the reference? Half a turn apart (to rounding) either sign is as good: the one is taken
// that makes the largest component of the half turn between them positive.
fn is_opposite(q: vec4<f32>, reference: vec4<f32>) -> bool {
    let cosine = dot(q, reference);
    if abs(cosine) > 16.0 * EPSILON {
        return cosine < 0.0;
    }
    let turn = multiply(conjugate(reference), q);
    var largest = turn.x;
    if abs(turn.y) > abs(largest) {
        largest = turn.y;
    }
    if abs(turn.z) > abs(largest) {
        largest = turn.z;
    }
    return largest < 0.0;
}

// ---- The blend of a Gaussian's joints ----------------------------------------------------------------------------------

// A symmetric 4x4 matrix over (x, y, z, w).
struct Symmetric {
    // xx, yy, zz, ww
    diagonal: vec4<f32>,
    // xy, xz, yz
    between: vec3<f32>,
    // xw, yw, zw
    beside_w: vec3<f32>,
}

// What one walk over the influences leaves.
struct Blend {
    // sum w q q^T, sum w t and sum w.
    outer: Symmetric,
    translation: vec3<f32>,
    weight: f32,
    // The joint of largest weight, the first of equals.
    heaviest: vec4<f32>,
    heaviest_weight: f32,
    // The last joint that counts before the last one, the last one, and how many count.
    earlier: vec4<f32>,
    earlier_weight: f32,
    latest: vec4<f32>,
    latest_weight: f32,
    bones: u32,
}

fn empty_blend() -> Blend {
    let zero = vec3<f32>(0.0);
    return Blend(Symmetric(vec4<f32>(0.0), zero, zero), zero, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, 0u);
}

// Takes one influence in. Weights that are not positive do not count.
fn take(blend: ptr<function, Blend>, rotation: vec4<f32>, translation: vec3<f32>, weight: f32) {
    if !(weight > 0.0) {
        return;
    }
    let weighted = weight * rotation;
    (*blend).outer.diagonal += weighted * rotation;
    (*blend).outer.between += weighted.xxy * rotation.yzz;
    (*blend).outer.beside_w += weighted.xyz * rotation.w;
    (*blend).translation += weight * translation;
    (*blend).weight += weight;
    if weight > (*blend).heaviest_weight {
        (*blend).heaviest = rotation;
        (*blend).heaviest_weight = weight;
    }
    (*blend).earlier = (*blend).latest;
    (*blend).earlier_weight = (*blend).latest_weight;
    (*blend).latest = rotation;
    (*blend).latest_weight = weight;
    (*blend).bones += 1u;
}

// Eq. 6. The outer sum already holds the blended matrix sum w R(q), entry by entry.
fn blended_mean(blend: Blend, p: vec3<f32>) -> vec3<f32> {
    if blend.bones == 0u {
        return p;
    }
    let d = blend.outer.diagonal;
    let even = 2.0 * blend.outer.between;
    let odd = 2.0 * blend.outer.beside_w;
    let x = ((d.w - d.z) + (d.x - d.y)) * p.x + (even.x - odd.z) * p.y + (even.y + odd.y) * p.z;
    let y = (even.x + odd.z) * p.x + ((d.w - d.z) - (d.x - d.y)) * p.y + (even.z - odd.x) * p.z;
    let z = (even.y - odd.y) * p.x + (even.z + odd.x) * p.y + ((d.w + d.z) - (d.x + d.y)) * p.z;
    return (vec3<f32>(x, y, z) + blend.translation) / blend.weight;
}

// ---- The average of rotations (Eq. 7) ----------------------------------------------------------------------------------

fn trace(a: Symmetric) -> f32 {
    return (a.diagonal.x + a.diagonal.y) + (a.diagonal.z + a.diagonal.w);
}

fn scaled(a: Symmetric, factor: f32) -> Symmetric {
    return Symmetric(a.diagonal * factor, a.between * factor, a.beside_w * factor);
}

fn applied(a: Symmetric, v: vec4<f32>) -> vec4<f32> {
    let b = a.between;
    let w = a.beside_w;
    return a.diagonal * v + vec4<f32>(
        b.x * v.y + b.y * v.z + w.x * v.w,
        b.x * v.x + b.z * v.z + w.y * v.w,
        b.y * v.x + b.z * v.y + w.z * v.w,
        w.x * v.x + w.y * v.y + w.z * v.z,
    );
}

fn squared(a: Symmetric) -> Symmetric {
    let d = a.diagonal;
    let b = a.between;
    let w = a.beside_w;
    let bb = b * b;
    let ww = w * w;
    return Symmetric(
        d * d + vec4<f32>(bb.x + bb.y + ww.x, bb.x + bb.z + ww.y, bb.y + bb.z + ww.z, ww.x + ww.y + ww.z),
        b * (d.xxy + d.yzz) + vec3<f32>(b.y * b.z + w.x * w.y, b.x * b.z + w.x * w.z, b.x * b.y + w.y * w.z),
        w * (d.xyz + d.www) + vec3<f32>(b.x * w.y + b.y * w.z, b.x * w.x + b.z * w.z, b.y * w.x + b.z * w.y),
    );
}

// The column with the largest diagonal entry: of a multiple of q q^T a multiple of q.
fn largest_column(a: Symmetric) -> vec4<f32> {
    let b = a.between;
    let w = a.beside_w;
    var column = vec4<f32>(a.diagonal.x, b.x, b.y, w.x);
    var best = a.diagonal.x;
    if a.diagonal.y > best {
        column = vec4<f32>(b.x, a.diagonal.y, b.z, w.y);
        best = a.diagonal.y;
    }
    if a.diagonal.z > best {
        column = vec4<f32>(b.y, b.z, a.diagonal.z, w.z);
        best = a.diagonal.z;
    }
    if a.diagonal.w > best {
        column = vec4<f32>(w.x, w.y, w.z, a.diagonal.w);
    }
    return column;
}

// Two joints: (rho + c)(p + q) + kappa (1 + c)(p - q), with q on the side of p, c = p.q, kappa = (u - v) / (u + v) and
// rho^2 = c^2 + kappa^2 (1 - c^2). Nothing cancels; half a turn apart with equal weights it is the heavier one.
fn average_of_two(p: vec4<f32>, u: f32, q: vec4<f32>, v: f32) -> vec4<f32> {
    let cosine = dot(p, q);
    let c = min(abs(cosine), 1.0);
    let kappa = (u - v) / (u + v);
    let rho = sqrt(c * c + kappa * kappa * ((1.0 - c) * (1.0 + c)));
    let even = rho + c;
    let odd = kappa * (1.0 + c);
    if !(2.0 * rho > 16.0 * EPSILON * (1.0 + rho)) {
        if v > u {
            return q;
        }
        return p;
    }
    let of_q = select(even - odd, odd - even, cosine < 0.0);
    return normalized_or((even + odd) * p + of_q * q, p);
}

// 1 - trace(A^2), of unit trace, at which A^2 has rank one to rounding.
const RANK_ONE: f32 = 2.0e-4;
// After these, eigenvalues that are told apart at all by less than a millionth are in the same plane.
const SQUARINGS: u32 = 18u;

// The column of `plane` that lies farthest off u, made orthogonal to u and normalised.
fn beside(plane: Symmetric, u: vec4<f32>) -> vec4<f32> {
    let b = plane.between;
    let w = plane.beside_w;
    let x = vec4<f32>(plane.diagonal.x, b.x, b.y, w.x);
    let y = vec4<f32>(b.x, plane.diagonal.y, b.z, w.y);
    let z = vec4<f32>(b.y, b.z, plane.diagonal.z, w.z);
    let last = vec4<f32>(w.x, w.y, w.z, plane.diagonal.w);
    let off_y = y - dot(y, u) * u;
    let off_z = z - dot(z, u) * u;
    let off_w = last - dot(last, u) * u;
    var best = x - dot(x, u) * u;
    if dot(off_y, off_y) > dot(best, best) {
        best = off_y;
    }
    if dot(off_z, off_z) > dot(best, best) {
        best = off_z;
    }
    if dot(off_w, off_w) > dot(best, best) {
        best = off_w;
    }
    let unit = normalized_or(best, vec4<f32>(0.0));
    return normalized_or(unit - dot(unit, u) * u, vec4<f32>(0.0));
}

// The leading eigenvector of A within a plane (a multiple of its projection): a 2x2 problem over u, the unit vector of the plane
// nearest to the heaviest joint, and v beside it. If the two eigenvalues cannot be told apart it is u.
fn leading_in_plane(a: Symmetric, plane: Symmetric, heaviest: vec4<f32>) -> vec4<f32> {
    let u = normalized_or(applied(plane, heaviest), heaviest);
    let v = beside(plane, u);
    let of_v = applied(a, v);
    let uu = dot(u, applied(a, u));
    let vv = dot(v, of_v);
    let half = 0.5 * (uu - vv);
    let across = dot(u, of_v);
    let rho = sqrt(half * half + across * across);
    if !(2.0 * rho > 16.0 * EPSILON * (0.5 * (uu + vv) + rho)) {
        return u;
    }
    if half >= 0.0 {
        return normalized_or((rho + half) * u + across * v, u);
    }
    return normalized_or(across * u + (rho - half) * v, u);
}

// Any number of joints: A^(2^k) until it is q q^T, or until what is left is a plane whose two eigenvalues are close.
fn average_of_many(outer: Symmetric, heaviest: vec4<f32>) -> vec4<f32> {
    let a = scaled(outer, 1.0 / trace(outer));
    var power = a;
    for (var k = 0u; k < SQUARINGS; k += 1u) {
        let square = squared(power);
        let t = trace(square);
        power = scaled(square, 1.0 / t);
        if abs(1.0 - t) <= RANK_ONE {
            return normalized_or(largest_column(power), heaviest);
        }
    }
    return leading_in_plane(a, power, heaviest);
}

// At most two joints.
fn closed_form_of_two(blend: Blend) -> vec4<f32> {
    if blend.bones < 2u {
        return blend.heaviest;
    }
    return average_of_two(blend.earlier, blend.earlier_weight, blend.latest, blend.latest_weight);
}

fn closed_form(blend: Blend) -> vec4<f32> {
    if blend.bones <= 2u {
        return closed_form_of_two(blend);
    }
    return average_of_many(blend.outer, blend.heaviest);
}

// The paper's engine path: v <- A v / |A v| from the heaviest joint, which A never takes to zero.
fn power_steps(blend: Blend, steps: u32) -> vec4<f32> {
    if blend.bones < 2u {
        return blend.heaviest;
    }
    let a = scaled(blend.outer, 1.0 / blend.weight);
    var v = blend.heaviest;
    for (var k = 0u; k < steps; k += 1u) {
        let next = applied(a, v);
        v = next / sqrt(dot(next, next));
    }
    return v;
}

// ---- Sums of quaternions and of dual quaternions -----------------------------------------------------------------------

// sum +-w q, and twice the dual part: sum +-w t q.
struct Sum {
    real: vec4<f32>,
    dual: vec4<f32>,
}

// Takes one influence in, on the side of the reference. Weights that are not positive do not count.
fn take_aligned(
    sum: ptr<function, Sum>,
    rotation: vec4<f32>,
    translation: vec3<f32>,
    weight: f32,
    reference: vec4<f32>,
) {
    if !(weight > 0.0) {
        return;
    }
    let signed = select(weight, -weight, is_opposite(rotation, reference));
    (*sum).real += signed * rotation;
    (*sum).dual += signed * multiply(vec4<f32>(translation, 0.0), rotation);
}

// The normalised sum of quaternions.
fn aligned_sum(blend: Blend, sum: Sum) -> vec4<f32> {
    if blend.bones < 2u {
        return blend.heaviest;
    }
    return normalized_or(sum.real, blend.heaviest);
}

struct Motion {
    rotation: vec4<f32>,
    translation: vec3<f32>,
}

// Dual quaternions, divided by the length of the real part.
fn dual_quaternion(blend: Blend, sum: Sum) -> Motion {
    if blend.bones == 0u {
        return Motion(IDENTITY, vec3<f32>(0.0));
    }
    let translation = multiply(sum.dual, conjugate(sum.real)).xyz / dot(sum.real, sum.real);
    return Motion(normalized_or(sum.real, blend.heaviest), translation);
}

// ---- Shape -------------------------------------------------------------------------------------------------------------

struct Covariance {
    // xx, xy, xz
    first: vec3<f32>,
    // yy, yz, zz
    second: vec3<f32>,
}

// R(q) diag(s^2) R(q)^T.
fn covariance_of(q: vec4<f32>, s: vec3<f32>) -> Covariance {
    let a = rotate(q, vec3<f32>(s.x, 0.0, 0.0));
    let b = rotate(q, vec3<f32>(0.0, s.y, 0.0));
    let c = rotate(q, vec3<f32>(0.0, 0.0, s.z));
    let second = vec2<f32>(a.y * a.y + b.y * b.y + c.y * c.y, a.y * a.z + b.y * b.z + c.y * c.z);
    return Covariance(a.x * a + b.x * b + c.x * c, vec3<f32>(second, a.z * a.z + b.z * b.z + c.z * c.z));
}

// ---- Spherical harmonics -----------------------------------------------------------------------------------------------

const C0: f32 = 0.28209479177387814;
const C1: f32 = 0.4886025119029199;

// sum of coefficient times basis function, degree 1, along the unit direction d.
fn sh_degree_1(d: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    return C1 * (d.z * b - d.y * a - d.x * c);
}

// The five basis functions of degree 2 are (xy, yz, 2zz - xx - yy, xz, xx - yy) times constants.
fn basis_2(d: vec3<f32>) -> array<f32, 5> {
    return array<f32, 5>(
        1.0925484305920792 * d.x * d.y,
        -1.0925484305920792 * d.y * d.z,
        0.31539156525252005 * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y),
        -1.0925484305920792 * d.x * d.z,
        0.5462742152960396 * (d.x * d.x - d.y * d.y),
    );
}

fn basis_3(d: vec3<f32>) -> array<f32, 7> {
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    return array<f32, 7>(
        -0.5900435899266435 * d.y * (3.0 * xx - yy),
        2.890611442640554 * d.x * d.y * d.z,
        -0.4570457994644658 * d.y * (4.0 * zz - xx - yy),
        0.3731763325901154 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.4570457994644658 * d.x * (4.0 * zz - xx - yy),
        1.445305721320277 * d.z * (xx - yy),
        -0.5900435899266435 * d.x * (xx - 3.0 * yy),
    );
}

// cos and sin of an angle, twice and three times it.
struct Turn {
    one: vec2<f32>,
    two: vec2<f32>,
    three: vec2<f32>,
}

// R(q) = Rz(alpha) Ry(beta) Rz(gamma), and Ry(beta) = J Rz(-beta) J with J the exchange of y and z (Pinchon and Hoggan 2007).
struct ShRotation {
    gamma: Turn,
    beta: Turn,
    alpha: Turn,
}

// The sum of two angles given by cosine and sine.
fn compose(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x - a.y * b.y, a.y * b.x + a.x * b.y);
}

fn multiples(angle: vec2<f32>) -> Turn {
    let double = compose(angle, angle);
    return Turn(angle, double, compose(double, angle));
}

// v / |v|, (1, 0) where it is too short to matter.
fn direction_of(v: vec2<f32>) -> vec2<f32> {
    let square = dot(v, v);
    if square < 2.0e-28 {
        return vec2<f32>(1.0, 0.0);
    }
    return v / sqrt(square);
}

fn sh_rotation(q: vec4<f32>) -> ShRotation {
    let half_sum = direction_of(q.wz);
    let half_difference = direction_of(vec2<f32>(q.y, -q.x));
    let cos2 = dot(q.wz, q.wz);
    let sin2 = dot(q.xy, q.xy);
    let beta = vec2<f32>(cos2 - sin2, -2.0 * sqrt(cos2 * sin2));
    let gamma = compose(half_sum, vec2<f32>(half_difference.x, -half_difference.y));
    return ShRotation(multiples(gamma), multiples(beta), multiples(compose(half_sum, half_difference)));
}

// A turn about the polar axis mixes m (`plus`) and -m (`minus`).
fn plus_turned(minus: vec3<f32>, plus: vec3<f32>, turn: vec2<f32>) -> vec3<f32> {
    return plus * turn.x - minus * turn.y;
}

fn minus_turned(minus: vec3<f32>, plus: vec3<f32>, turn: vec2<f32>) -> vec3<f32> {
    return plus * turn.y + minus * turn.x;
}

fn about_z_1(c: array<vec3<f32>, 3>, t: Turn) -> array<vec3<f32>, 3> {
    return array<vec3<f32>, 3>(minus_turned(c[0], c[2], t.one), c[1], plus_turned(c[0], c[2], t.one));
}

fn about_z_2(c: array<vec3<f32>, 5>, t: Turn) -> array<vec3<f32>, 5> {
    return array<vec3<f32>, 5>(
        minus_turned(c[0], c[4], t.two),
        minus_turned(c[1], c[3], t.one),
        c[2],
        plus_turned(c[1], c[3], t.one),
        plus_turned(c[0], c[4], t.two),
    );
}

fn about_z_3(c: array<vec3<f32>, 7>, t: Turn) -> array<vec3<f32>, 7> {
    return array<vec3<f32>, 7>(
        minus_turned(c[0], c[6], t.three),
        minus_turned(c[1], c[5], t.two),
        minus_turned(c[2], c[4], t.one),
        c[3],
        plus_turned(c[2], c[4], t.one),
        plus_turned(c[1], c[5], t.two),
        plus_turned(c[0], c[6], t.three),
    );
}

fn exchanged_1(c: array<vec3<f32>, 3>) -> array<vec3<f32>, 3> {
    return array<vec3<f32>, 3>(-c[1], -c[0], c[2]);
}

fn exchanged_2(c: array<vec3<f32>, 5>) -> array<vec3<f32>, 5> {
    let root = 0.8660254037844386;
    return array<vec3<f32>, 5>(-c[3], c[1], -(c[2] * 0.5 + c[4] * root), -c[0], c[4] * 0.5 - c[2] * root);
}

fn exchanged_3(c: array<vec3<f32>, 7>) -> array<vec3<f32>, 7> {
    let root15 = 0.9682458365518542;
    let root10 = 0.7905694150420948;
    let root6 = 0.6123724356957945;
    return array<vec3<f32>, 7>(
        c[3] * root10 - c[5] * root6,
        c[1],
        c[3] * root6 + c[5] * root10,
        c[0] * root10 + c[2] * root6,
        -(c[4] * 0.25 + c[6] * root15),
        c[2] * root10 - c[0] * root6,
        c[6] * 0.25 - c[4] * root15,
    );
}

// The coefficients of a degree, m = -l .. l, turned: read along d they are the old ones read along R^T d.
fn sh_turned_1(c: array<vec3<f32>, 3>, r: ShRotation) -> array<vec3<f32>, 3> {
    return about_z_1(exchanged_1(about_z_1(exchanged_1(about_z_1(c, r.gamma)), r.beta)), r.alpha);
}

fn sh_turned_2(c: array<vec3<f32>, 5>, r: ShRotation) -> array<vec3<f32>, 5> {
    return about_z_2(exchanged_2(about_z_2(exchanged_2(about_z_2(c, r.gamma)), r.beta)), r.alpha);
}

fn sh_turned_3(c: array<vec3<f32>, 7>, r: ShRotation) -> array<vec3<f32>, 7> {
    return about_z_3(exchanged_3(about_z_3(exchanged_3(about_z_3(c, r.gamma)), r.beta)), r.alpha);
}

// ---- Bindings ----------------------------------------------------------------------------------------------------------

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> joints: array<Joint>;
@group(0) @binding(2) var<storage, read> gaussians: array<Gaussian>;
@group(0) @binding(3) var<storage, read> indices: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> weights: array<vec4<f32>>;
// Posed mean; w is 1.
@group(0) @binding(5) var<storage, read_write> means: array<vec4<f32>>;
// Six floats a Gaussian: xx, xy, xz, yy, yz, zz.
@group(0) @binding(6) var<storage, read_write> covariances: array<f32>;
@group(0) @binding(7) var<storage, read_write> quaternions: array<vec4<f32>>;
// A, and the view direction in the frame of the rest pose (w is 0).
@group(0) @binding(8) var<storage, read_write> relatives: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> views: array<vec4<f32>>;
@group(1) @binding(0) var<storage, read> sh: array<f32>;
@group(1) @binding(1) var<storage, read_write> turned_sh: array<f32>;
// RGB, not below 0; w is 1.
@group(1) @binding(2) var<storage, read_write> colours: array<vec4<f32>>;

fn gathered(i: u32) -> Blend {
    var blend = empty_blend();
    for (var k = 0u; k < params.influence_sets; k += 1u) {
        let joint = indices[i * params.influence_sets + k];
        let weight = weights[i * params.influence_sets + k];
        take(&blend, joints[joint.x].rotation, joints[joint.x].translation, weight.x);
        take(&blend, joints[joint.y].rotation, joints[joint.y].translation, weight.y);
        take(&blend, joints[joint.z].rotation, joints[joint.z].translation, weight.z);
        take(&blend, joints[joint.w].rotation, joints[joint.w].translation, weight.w);
    }
    return blend;
}

// The first two influences alone.
fn gathered_two(i: u32) -> Blend {
    var blend = empty_blend();
    let joint = indices[i * params.influence_sets].xy;
    let weight = weights[i * params.influence_sets].xy;
    take(&blend, joints[joint.x].rotation, joints[joint.x].translation, weight.x);
    take(&blend, joints[joint.y].rotation, joints[joint.y].translation, weight.y);
    return blend;
}

// Joints on the side of the heaviest one, summed.
fn summed(i: u32, blend: Blend) -> Sum {
    var sum = Sum(vec4<f32>(0.0), vec4<f32>(0.0));
    for (var k = 0u; k < params.influence_sets; k += 1u) {
        let joint = indices[i * params.influence_sets + k];
        let weight = weights[i * params.influence_sets + k];
        take_aligned(&sum, joints[joint.x].rotation, joints[joint.x].translation, weight.x, blend.heaviest);
        take_aligned(&sum, joints[joint.y].rotation, joints[joint.y].translation, weight.y, blend.heaviest);
        take_aligned(&sum, joints[joint.z].rotation, joints[joint.z].translation, weight.z, blend.heaviest);
        take_aligned(&sum, joints[joint.w].rotation, joints[joint.w].translation, weight.w, blend.heaviest);
    }
    return sum;
}

fn write_motion(i: u32, mean: vec3<f32>, relative: vec4<f32>) {
    means[i] = vec4<f32>(mean, 1.0);
    relatives[i] = relative;
    let view = mean - params.camera;
    let distance = length(view);
    let unit = select(view / distance, vec3<f32>(0.0, 0.0, 1.0), distance == 0.0);
    views[i] = vec4<f32>(rotate(conjugate(relative), unit), 0.0);
}

fn write_covariance(i: u32, mean: vec3<f32>, relative: vec4<f32>) {
    write_motion(i, mean, relative);
    let c = covariance_of(multiply(relative, gaussians[i].rotation), gaussians[i].scale);
    covariances[6u * i] = c.first.x;
    covariances[6u * i + 1u] = c.first.y;
    covariances[6u * i + 2u] = c.first.z;
    covariances[6u * i + 3u] = c.second.x;
    covariances[6u * i + 4u] = c.second.y;
    covariances[6u * i + 5u] = c.second.z;
}

fn write_quaternion(i: u32, mean: vec3<f32>, relative: vec4<f32>) {
    write_motion(i, mean, relative);
    quaternions[i] = multiply(relative, gaussians[i].rotation);
}

// ---- Entry points: rotation and shape ----------------------------------------------------------------------------------

@compute @workgroup_size(64)
fn two_bones_covariance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered_two(i);
        write_covariance(i, blended_mean(blend, gaussians[i].mean), closed_form_of_two(blend));
    }
}

@compute @workgroup_size(64)
fn two_bones_quaternion(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered_two(i);
        write_quaternion(i, blended_mean(blend, gaussians[i].mean), closed_form_of_two(blend));
    }
}

@compute @workgroup_size(64)
fn closed_form_covariance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_covariance(i, blended_mean(blend, gaussians[i].mean), closed_form(blend));
    }
}

@compute @workgroup_size(64)
fn closed_form_quaternion(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_quaternion(i, blended_mean(blend, gaussians[i].mean), closed_form(blend));
    }
}

@compute @workgroup_size(64)
fn power_covariance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_covariance(i, blended_mean(blend, gaussians[i].mean), power_steps(blend, params.power_steps));
    }
}

@compute @workgroup_size(64)
fn power_quaternion(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_quaternion(i, blended_mean(blend, gaussians[i].mean), power_steps(blend, params.power_steps));
    }
}

@compute @workgroup_size(64)
fn aligned_sum_covariance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_covariance(i, blended_mean(blend, gaussians[i].mean), aligned_sum(blend, summed(i, blend)));
    }
}

@compute @workgroup_size(64)
fn aligned_sum_quaternion(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        write_quaternion(i, blended_mean(blend, gaussians[i].mean), aligned_sum(blend, summed(i, blend)));
    }
}

@compute @workgroup_size(64)
fn dual_quaternion_covariance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        let motion = dual_quaternion(blend, summed(i, blend));
        write_covariance(i, rotate(motion.rotation, gaussians[i].mean) + motion.translation, motion.rotation);
    }
}

@compute @workgroup_size(64)
fn dual_quaternion_quaternion(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.count {
        let i = params.first + id.x;
        let blend = gathered(i);
        let motion = dual_quaternion(blend, summed(i, blend));
        write_quaternion(i, rotate(motion.rotation, gaussians[i].mean) + motion.translation, motion.rotation);
    }
}

// ---- Entry points: colour ----------------------------------------------------------------------------------------------

fn coefficient(i: u32, k: u32) -> vec3<f32> {
    let at = i * params.sh_stride + k * params.sh_coefficient_stride;
    return vec3<f32>(sh[at], sh[at + 1u], sh[at + 2u]);
}

fn write_coefficient(i: u32, k: u32, c: vec3<f32>) {
    let at = i * params.sh_stride + k * params.sh_coefficient_stride;
    turned_sh[at] = c.x;
    turned_sh[at + 1u] = c.y;
    turned_sh[at + 2u] = c.z;
}

fn band_1(i: u32) -> array<vec3<f32>, 3> {
    return array<vec3<f32>, 3>(coefficient(i, 1u), coefficient(i, 2u), coefficient(i, 3u));
}

fn band_2(i: u32) -> array<vec3<f32>, 5> {
    return array<vec3<f32>, 5>(
        coefficient(i, 4u),
        coefficient(i, 5u),
        coefficient(i, 6u),
        coefficient(i, 7u),
        coefficient(i, 8u),
    );
}

fn band_3(i: u32) -> array<vec3<f32>, 7> {
    return array<vec3<f32>, 7>(
        coefficient(i, 9u),
        coefficient(i, 10u),
        coefficient(i, 11u),
        coefficient(i, 12u),
        coefficient(i, 13u),
        coefficient(i, 14u),
        coefficient(i, 15u),
    );
}

// RGB of SH of the rest pose, read along the turned view.
@compute @workgroup_size(64)
fn colour(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    let d = views[i].xyz;
    var rgb = vec3<f32>(0.5) + C0 * coefficient(i, 0u);
    if params.sh_degree >= 1u {
        let c = band_1(i);
        rgb += sh_degree_1(d, c[0], c[1], c[2]);
    }
    if params.sh_degree >= 2u {
        let c = band_2(i);
        let b = basis_2(d);
        rgb += b[0] * c[0] + b[1] * c[1] + b[2] * c[2] + b[3] * c[3] + b[4] * c[4];
    }
    if params.sh_degree >= 3u {
        let c = band_3(i);
        let b = basis_3(d);
        rgb += b[0] * c[0] + b[1] * c[1] + b[2] * c[2] + b[3] * c[3] + b[4] * c[4] + b[5] * c[5] + b[6] * c[6];
    }
    colours[i] = vec4<f32>(max(rgb, vec3<f32>(0.0)), 1.0);
}

// SH turned by A, for an engine that evaluates them itself.
@compute @workgroup_size(64)
fn turn_sh(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    let r = sh_rotation(relatives[i]);
    write_coefficient(i, 0u, coefficient(i, 0u));
    if params.sh_degree >= 1u {
        let c = sh_turned_1(band_1(i), r);
        write_coefficient(i, 1u, c[0]);
        write_coefficient(i, 2u, c[1]);
        write_coefficient(i, 3u, c[2]);
    }
    if params.sh_degree >= 2u {
        let c = sh_turned_2(band_2(i), r);
        write_coefficient(i, 4u, c[0]);
        write_coefficient(i, 5u, c[1]);
        write_coefficient(i, 6u, c[2]);
        write_coefficient(i, 7u, c[3]);
        write_coefficient(i, 8u, c[4]);
    }
    if params.sh_degree >= 3u {
        let c = sh_turned_3(band_3(i), r);
        write_coefficient(i, 9u, c[0]);
        write_coefficient(i, 10u, c[1]);
        write_coefficient(i, 11u, c[2]);
        write_coefficient(i, 12u, c[3]);
        write_coefficient(i, 13u, c[4]);
        write_coefficient(i, 14u, c[5]);
        write_coefficient(i, 15u, c[6]);
    }
}
