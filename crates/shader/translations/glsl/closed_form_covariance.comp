#version 430 core
// Made from shaders/skinning.wgsl by naga: edit that. MIT OR Apache-2.0.
#extension GL_ARB_compute_shader : require
#extension GL_ARB_shader_storage_buffer_object : require
layout(local_size_x = 64, local_size_y = 1, local_size_z = 1) in;

struct Params {
    uint count;
    uint first;
    uint influence_sets;
    uint power_steps;
    vec3 camera;
    uint sh_degree;
    uint sh_stride;
    uint sh_coefficient_stride;
    uint unused_0_;
    uint unused_1_;
};
struct Joint {
    vec4 rotation;
    vec3 translation;
};
struct Gaussian {
    vec3 mean;
    vec4 rotation;
    vec3 scale;
};
struct Symmetric {
    vec4 diagonal;
    vec3 between;
    vec3 beside_w;
};
struct Blend {
    Symmetric outer;
    vec3 translation;
    float weight;
    vec4 heaviest;
    float heaviest_weight;
    vec4 earlier;
    float earlier_weight;
    vec4 latest;
    float latest_weight;
    uint bones;
};
struct Sum {
    vec4 real;
    vec4 dual;
};
struct Motion {
    vec4 rotation;
    vec3 translation;
};
struct Covariance {
    vec3 first;
    vec3 second;
};
struct Turn {
    vec2 one;
    vec2 two;
    vec2 three;
};
struct ShRotation {
    Turn gamma;
    Turn beta;
    Turn alpha;
};
const float EPSILON = 1.1920929e-7;
const vec4 IDENTITY = vec4(0.0, 0.0, 0.0, 1.0);
const float RANK_ONE = 0.0002;
const uint SQUARINGS = 18u;
const float C0_ = 0.2820948;
const float C1_ = 0.48860252;

layout(std140, binding = 0) uniform Params_block_0Compute { Params _group_0_binding_0_cs; };

layout(std430, binding = 1) readonly buffer type_13_block_1Compute { Joint _group_0_binding_1_cs[]; };

layout(std430, binding = 2) readonly buffer type_14_block_2Compute { Gaussian _group_0_binding_2_cs[]; };

layout(std430, binding = 3) readonly buffer type_16_block_3Compute { uvec4 _group_0_binding_3_cs[]; };

layout(std430, binding = 4) readonly buffer type_17_block_4Compute { vec4 _group_0_binding_4_cs[]; };

layout(std430, binding = 5) buffer type_17_block_5Compute { vec4 _group_0_binding_5_cs[]; };

layout(std430, binding = 6) buffer type_18_block_6Compute { float _group_0_binding_6_cs[]; };

layout(std430, binding = 8) buffer type_17_block_7Compute { vec4 _group_0_binding_8_cs[]; };

layout(std430, binding = 9) buffer type_17_block_8Compute { vec4 _group_0_binding_9_cs[]; };


vec4 multiply(vec4 a, vec4 b) {
    return vec4((((a.w * b.xyz) + (b.w * a.xyz)) + cross(a.xyz, b.xyz)), ((a.w * b.w) - dot(a.xyz, b.xyz)));
}

vec4 conjugate(vec4 q) {
    return vec4(-(q.xyz), q.w);
}

vec3 rotate(vec4 q_1, vec3 v) {
    vec3 t_3 = (2.0 * cross(q_1.xyz, v));
    return ((v + (q_1.w * t_3)) + cross(q_1.xyz, t_3));
}

float largest_magnitude(vec4 v_1) {
    vec4 m = abs(v_1);
    return max(max(m.x, m.y), max(m.z, m.w));
}

vec4 normalized_or(vec4 q_2, vec4 otherwise) {
    float _e2 = largest_magnitude(q_2);
    if (!((_e2 > 0.0))) {
        return otherwise;
    }
    vec4 scaled_1 = (q_2 / vec4(_e2));
    return (scaled_1 / vec4(sqrt(dot(scaled_1, scaled_1))));
}

bool is_opposite(vec4 q_3, vec4 reference) {
    float largest = 0.0;
    float cosine = dot(q_3, reference);
    if ((abs(cosine) > 1.9073486e-6)) {
        return (cosine < 0.0);
    }
    vec4 _e8 = conjugate(reference);
    vec4 _e9 = multiply(_e8, q_3);
    largest = _e9.x;
    float _e14 = largest;
    if ((abs(_e9.y) > abs(_e14))) {
        largest = _e9.y;
    }
    float _e20 = largest;
    if ((abs(_e9.z) > abs(_e20))) {
        largest = _e9.z;
    }
    float _e24 = largest;
    return (_e24 < 0.0);
}

Blend empty_blend() {
    vec3 zero = vec3(0.0);
    return Blend(Symmetric(vec4(0.0), zero, zero), zero, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, 0u);
}

void take(inout Blend blend, vec4 rotation, vec3 translation, float weight) {
    if (!((weight > 0.0))) {
        return;
    }
    vec4 weighted = (weight * rotation);
    vec4 _e10 = blend.outer.diagonal;
    blend.outer.diagonal = (_e10 + (weighted * rotation));
    vec3 _e15 = blend.outer.between;
    blend.outer.between = (_e15 + (weighted.xxy * rotation.yzz));
    vec3 _e22 = blend.outer.beside_w;
    blend.outer.beside_w = (_e22 + (weighted.xyz * rotation.w));
    vec3 _e28 = blend.translation;
    blend.translation = (_e28 + (weight * translation));
    float _e32 = blend.weight;
    blend.weight = (_e32 + weight);
    float _e35 = blend.heaviest_weight;
    if ((weight > _e35)) {
        blend.heaviest = rotation;
        blend.heaviest_weight = weight;
    }
    vec4 _e41 = blend.latest;
    blend.earlier = _e41;
    float _e44 = blend.latest_weight;
    blend.earlier_weight = _e44;
    blend.latest = rotation;
    blend.latest_weight = weight;
    uint _e48 = blend.bones;
    blend.bones = (_e48 + 1u);
    return;
}

vec3 blended_mean(Blend blend_1, vec3 p) {
    if ((blend_1.bones == 0u)) {
        return p;
    }
    vec4 d_3 = blend_1.outer.diagonal;
    vec3 even = (2.0 * blend_1.outer.between);
    vec3 odd = (2.0 * blend_1.outer.beside_w);
    float x = (((((d_3.w - d_3.z) + (d_3.x - d_3.y)) * p.x) + ((even.x - odd.z) * p.y)) + ((even.y + odd.y) * p.z));
    float y = ((((even.x + odd.z) * p.x) + (((d_3.w - d_3.z) - (d_3.x - d_3.y)) * p.y)) + ((even.z - odd.x) * p.z));
    float z = ((((even.y - odd.y) * p.x) + ((even.z + odd.x) * p.y)) + (((d_3.w + d_3.z) - (d_3.x + d_3.y)) * p.z));
    return ((vec3(x, y, z) + blend_1.translation) / vec3(blend_1.weight));
}

float trace(Symmetric a_1) {
    return ((a_1.diagonal.x + a_1.diagonal.y) + (a_1.diagonal.z + a_1.diagonal.w));
}

Symmetric scaled(Symmetric a_2, float factor) {
    return Symmetric((a_2.diagonal * factor), (a_2.between * factor), (a_2.beside_w * factor));
}

vec4 applied(Symmetric a_3, vec4 v_2) {
    vec3 b_3 = a_3.between;
    vec3 w = a_3.beside_w;
    return ((a_3.diagonal * v_2) + vec4((((b_3.x * v_2.y) + (b_3.y * v_2.z)) + (w.x * v_2.w)), (((b_3.x * v_2.x) + (b_3.z * v_2.z)) + (w.y * v_2.w)), (((b_3.y * v_2.x) + (b_3.z * v_2.y)) + (w.z * v_2.w)), (((w.x * v_2.x) + (w.y * v_2.y)) + (w.z * v_2.z))));
}

Symmetric squared(Symmetric a_4) {
    vec4 d_4 = a_4.diagonal;
    vec3 b_4 = a_4.between;
    vec3 w_1 = a_4.beside_w;
    vec3 bb = (b_4 * b_4);
    vec3 ww = (w_1 * w_1);
    return Symmetric(((d_4 * d_4) + vec4(((bb.x + bb.y) + ww.x), ((bb.x + bb.z) + ww.y), ((bb.y + bb.z) + ww.z), ((ww.x + ww.y) + ww.z))), ((b_4 * (d_4.xxy + d_4.yzz)) + vec3(((b_4.y * b_4.z) + (w_1.x * w_1.y)), ((b_4.x * b_4.z) + (w_1.x * w_1.z)), ((b_4.x * b_4.y) + (w_1.y * w_1.z)))), ((w_1 * (d_4.xyz + d_4.www)) + vec3(((b_4.x * w_1.y) + (b_4.y * w_1.z)), ((b_4.x * w_1.x) + (b_4.z * w_1.z)), ((b_4.y * w_1.x) + (b_4.z * w_1.y)))));
}

vec4 largest_column(Symmetric a_5) {
    vec4 column = vec4(0.0);
    float best = 0.0;
    vec3 b_5 = a_5.between;
    vec3 w_2 = a_5.beside_w;
    column = vec4(a_5.diagonal.x, b_5.x, b_5.y, w_2.x);
    best = a_5.diagonal.x;
    float _e15 = best;
    if ((a_5.diagonal.y > _e15)) {
        column = vec4(b_5.x, a_5.diagonal.y, b_5.z, w_2.y);
        best = a_5.diagonal.y;
    }
    float _e27 = best;
    if ((a_5.diagonal.z > _e27)) {
        column = vec4(b_5.y, b_5.z, a_5.diagonal.z, w_2.z);
        best = a_5.diagonal.z;
    }
    float _e39 = best;
    if ((a_5.diagonal.w > _e39)) {
        column = vec4(w_2.x, w_2.y, w_2.z, a_5.diagonal.w);
    }
    vec4 _e47 = column;
    return _e47;
}

vec4 average_of_two(vec4 p_1, float u, vec4 q_4, float v_3) {
    float cosine_1 = dot(p_1, q_4);
    float c_11 = min(abs(cosine_1), 1.0);
    float kappa = ((u - v_3) / (u + v_3));
    float rho = sqrt(((c_11 * c_11) + ((kappa * kappa) * ((1.0 - c_11) * (1.0 + c_11)))));
    float even_1 = (rho + c_11);
    float odd_1 = (kappa * (1.0 + c_11));
    if (!(((2.0 * rho) > (1.9073486e-6 * (1.0 + rho))))) {
        if ((v_3 > u)) {
            return q_4;
        }
        return p_1;
    }
    float of_q = ((cosine_1 < 0.0) ? (odd_1 - even_1) : (even_1 - odd_1));
    vec4 _e43 = normalized_or((((even_1 + odd_1) * p_1) + (of_q * q_4)), p_1);
    return _e43;
}

vec4 beside(Symmetric plane, vec4 u_1) {
    vec4 best_1 = vec4(0.0);
    vec3 b_6 = plane.between;
    vec3 w_3 = plane.beside_w;
    vec4 x_1 = vec4(plane.diagonal.x, b_6.x, b_6.y, w_3.x);
    vec4 y_1 = vec4(b_6.x, plane.diagonal.y, b_6.z, w_3.y);
    vec4 z_1 = vec4(b_6.y, b_6.z, plane.diagonal.z, w_3.z);
    vec4 last = vec4(w_3.x, w_3.y, w_3.z, plane.diagonal.w);
    vec4 off_y = (y_1 - (dot(y_1, u_1) * u_1));
    vec4 off_z = (z_1 - (dot(z_1, u_1) * u_1));
    vec4 off_w = (last - (dot(last, u_1) * u_1));
    best_1 = (x_1 - (dot(x_1, u_1) * u_1));
    vec4 _e42 = best_1;
    vec4 _e43 = best_1;
    if ((dot(off_y, off_y) > dot(_e42, _e43))) {
        best_1 = off_y;
    }
    vec4 _e47 = best_1;
    vec4 _e48 = best_1;
    if ((dot(off_z, off_z) > dot(_e47, _e48))) {
        best_1 = off_z;
    }
    vec4 _e52 = best_1;
    vec4 _e53 = best_1;
    if ((dot(off_w, off_w) > dot(_e52, _e53))) {
        best_1 = off_w;
    }
    vec4 _e56 = best_1;
    vec4 _e59 = normalized_or(_e56, vec4(0.0));
    vec4 _e65 = normalized_or((_e59 - (dot(_e59, u_1) * u_1)), vec4(0.0));
    return _e65;
}

vec4 leading_in_plane(Symmetric a_6, Symmetric plane_1, vec4 heaviest) {
    vec4 _e3 = applied(plane_1, heaviest);
    vec4 _e4 = normalized_or(_e3, heaviest);
    vec4 _e5 = beside(plane_1, _e4);
    vec4 _e6 = applied(a_6, _e5);
    vec4 _e7 = applied(a_6, _e4);
    float uu = dot(_e4, _e7);
    float vv = dot(_e5, _e6);
    float half_ = (0.5 * (uu - vv));
    float across = dot(_e4, _e6);
    float rho_1 = sqrt(((half_ * half_) + (across * across)));
    if (!(((2.0 * rho_1) > (1.9073486e-6 * ((0.5 * (uu + vv)) + rho_1))))) {
        return _e4;
    }
    if ((half_ >= 0.0)) {
        vec4 _e34 = normalized_or((((rho_1 + half_) * _e4) + (across * _e5)), _e4);
        return _e34;
    }
    vec4 _e39 = normalized_or(((across * _e4) + ((rho_1 - half_) * _e5)), _e4);
    return _e39;
}

vec4 average_of_many(Symmetric outer, vec4 heaviest_1) {
    Symmetric power = Symmetric(vec4(0.0), vec3(0.0), vec3(0.0));
    uint k = 0u;
    float _e2 = trace(outer);
    Symmetric _e5 = scaled(outer, (1.0 / _e2));
    power = _e5;
    bool loop_init = true;
    while(true) {
        if (!loop_init) {
            uint _e26 = k;
            k = (_e26 + 1u);
        }
        loop_init = false;
        uint _e9 = k;
        if ((_e9 < SQUARINGS)) {
        } else {
            break;
        }
        {
            Symmetric _e12 = power;
            Symmetric _e13 = squared(_e12);
            float _e14 = trace(_e13);
            Symmetric _e17 = scaled(_e13, (1.0 / _e14));
            power = _e17;
            if ((abs((1.0 - _e14)) <= RANK_ONE)) {
                Symmetric _e23 = power;
                vec4 _e24 = largest_column(_e23);
                vec4 _e25 = normalized_or(_e24, heaviest_1);
                return _e25;
            }
        }
    }
    Symmetric _e29 = power;
    vec4 _e30 = leading_in_plane(_e5, _e29, heaviest_1);
    return _e30;
}

vec4 closed_form_of_two(Blend blend_2) {
    if ((blend_2.bones < 2u)) {
        return blend_2.heaviest;
    }
    vec4 _e9 = average_of_two(blend_2.earlier, blend_2.earlier_weight, blend_2.latest, blend_2.latest_weight);
    return _e9;
}

vec4 closed_form(Blend blend_3) {
    if ((blend_3.bones <= 2u)) {
        vec4 _e4 = closed_form_of_two(blend_3);
        return _e4;
    }
    vec4 _e7 = average_of_many(blend_3.outer, blend_3.heaviest);
    return _e7;
}

vec4 power_steps(Blend blend_4, uint steps) {
    vec4 v_4 = vec4(0.0);
    uint k_1 = 0u;
    if ((blend_4.bones < 2u)) {
        return blend_4.heaviest;
    }
    Symmetric _e10 = scaled(blend_4.outer, (1.0 / blend_4.weight));
    v_4 = blend_4.heaviest;
    bool loop_init_1 = true;
    while(true) {
        if (!loop_init_1) {
            uint _e23 = k_1;
            k_1 = (_e23 + 1u);
        }
        loop_init_1 = false;
        uint _e15 = k_1;
        if ((_e15 < steps)) {
        } else {
            break;
        }
        {
            vec4 _e17 = v_4;
            vec4 _e18 = applied(_e10, _e17);
            v_4 = (_e18 / vec4(sqrt(dot(_e18, _e18))));
        }
    }
    vec4 _e26 = v_4;
    return _e26;
}

void take_aligned(inout Sum sum, vec4 rotation_1, vec3 translation_1, float weight_1, vec4 reference_1) {
    if (!((weight_1 > 0.0))) {
        return;
    }
    bool _e9 = is_opposite(rotation_1, reference_1);
    float signed = (_e9 ? -(weight_1) : weight_1);
    vec4 _e12 = sum.real;
    sum.real = (_e12 + (signed * rotation_1));
    vec4 _e16 = sum.dual;
    vec4 _e19 = multiply(vec4(translation_1, 0.0), rotation_1);
    sum.dual = (_e16 + (signed * _e19));
    return;
}

vec4 aligned_sum(Blend blend_5, Sum sum_1) {
    if ((blend_5.bones < 2u)) {
        return blend_5.heaviest;
    }
    vec4 _e8 = normalized_or(sum_1.real, blend_5.heaviest);
    return _e8;
}

Motion dual_quaternion(Blend blend_6, Sum sum_2) {
    if ((blend_6.bones == 0u)) {
        return Motion(vec4(0.0, 0.0, 0.0, 1.0), vec3(0.0));
    }
    vec4 _e15 = conjugate(sum_2.real);
    vec4 _e16 = multiply(sum_2.dual, _e15);
    vec3 translation_2 = (_e16.xyz / vec3(dot(sum_2.real, sum_2.real)));
    vec4 _e25 = normalized_or(sum_2.real, blend_6.heaviest);
    return Motion(_e25, translation_2);
}

Covariance covariance_of(vec4 q_5, vec3 s) {
    vec3 _e6 = rotate(q_5, vec3(s.x, 0.0, 0.0));
    vec3 _e11 = rotate(q_5, vec3(0.0, s.y, 0.0));
    vec3 _e16 = rotate(q_5, vec3(0.0, 0.0, s.z));
    vec2 second = vec2((((_e6.y * _e6.y) + (_e11.y * _e11.y)) + (_e16.y * _e16.y)), (((_e6.y * _e6.z) + (_e11.y * _e11.z)) + (_e16.y * _e16.z)));
    return Covariance((((_e6.x * _e6) + (_e11.x * _e11)) + (_e16.x * _e16)), vec3(second, (((_e6.z * _e6.z) + (_e11.z * _e11.z)) + (_e16.z * _e16.z))));
}

vec3 sh_degree_1_(vec3 d, vec3 a_7, vec3 b_1, vec3 c) {
    return (C1_ * (((d.z * b_1) - (d.y * a_7)) - (d.x * c)));
}

float[5] basis_2_(vec3 d_1) {
    return float[5](((1.0925485 * d_1.x) * d_1.y), ((-1.0925485 * d_1.y) * d_1.z), (0.31539157 * ((((2.0 * d_1.z) * d_1.z) - (d_1.x * d_1.x)) - (d_1.y * d_1.y))), ((-1.0925485 * d_1.x) * d_1.z), (0.54627424 * ((d_1.x * d_1.x) - (d_1.y * d_1.y))));
}

float[7] basis_3_(vec3 d_2) {
    float xx = (d_2.x * d_2.x);
    float yy = (d_2.y * d_2.y);
    float zz = (d_2.z * d_2.z);
    return float[7](((-0.5900436 * d_2.y) * ((3.0 * xx) - yy)), (((2.8906114 * d_2.x) * d_2.y) * d_2.z), ((-0.4570458 * d_2.y) * (((4.0 * zz) - xx) - yy)), ((0.37317634 * d_2.z) * (((2.0 * zz) - (3.0 * xx)) - (3.0 * yy))), ((-0.4570458 * d_2.x) * (((4.0 * zz) - xx) - yy)), ((1.4453057 * d_2.z) * (xx - yy)), ((-0.5900436 * d_2.x) * (xx - (3.0 * yy))));
}

vec2 compose(vec2 a_8, vec2 b_2) {
    return vec2(((a_8.x * b_2.x) - (a_8.y * b_2.y)), ((a_8.y * b_2.x) + (a_8.x * b_2.y)));
}

Turn multiples(vec2 angle) {
    vec2 _e1 = compose(angle, angle);
    vec2 _e2 = compose(_e1, angle);
    return Turn(angle, _e1, _e2);
}

vec2 direction_of(vec2 v_5) {
    float square = dot(v_5, v_5);
    if ((square < 2e-28)) {
        return vec2(1.0, 0.0);
    }
    return (v_5 / vec2(sqrt(square)));
}

ShRotation sh_rotation(vec4 q_6) {
    vec2 _e2 = direction_of(q_6.wz);
    vec2 _e7 = direction_of(vec2(q_6.y, -(q_6.x)));
    float cos2_ = dot(q_6.wz, q_6.wz);
    float sin2_ = dot(q_6.xy, q_6.xy);
    vec2 beta = vec2((cos2_ - sin2_), (-2.0 * sqrt((cos2_ * sin2_))));
    vec2 _e24 = compose(_e2, vec2(_e7.x, -(_e7.y)));
    Turn _e25 = multiples(_e24);
    Turn _e26 = multiples(beta);
    vec2 _e27 = compose(_e2, _e7);
    Turn _e28 = multiples(_e27);
    return ShRotation(_e25, _e26, _e28);
}

vec3 plus_turned(vec3 minus, vec3 plus, vec2 turn) {
    return ((plus * turn.x) - (minus * turn.y));
}

vec3 minus_turned(vec3 minus_1, vec3 plus_1, vec2 turn_1) {
    return ((plus_1 * turn_1.y) + (minus_1 * turn_1.x));
}

vec3[3] about_z_1_(vec3 c_1[3], Turn t) {
    vec3 _e5 = minus_turned(c_1[0], c_1[2], t.one);
    vec3 _e10 = plus_turned(c_1[0], c_1[2], t.one);
    return vec3[3](_e5, c_1[1], _e10);
}

vec3[5] about_z_2_(vec3 c_2[5], Turn t_1) {
    vec3 _e5 = minus_turned(c_2[0], c_2[4], t_1.two);
    vec3 _e9 = minus_turned(c_2[1], c_2[3], t_1.one);
    vec3 _e14 = plus_turned(c_2[1], c_2[3], t_1.one);
    vec3 _e18 = plus_turned(c_2[0], c_2[4], t_1.two);
    return vec3[5](_e5, _e9, c_2[2], _e14, _e18);
}

vec3[7] about_z_3_(vec3 c_3[7], Turn t_2) {
    vec3 _e5 = minus_turned(c_3[0], c_3[6], t_2.three);
    vec3 _e9 = minus_turned(c_3[1], c_3[5], t_2.two);
    vec3 _e13 = minus_turned(c_3[2], c_3[4], t_2.one);
    vec3 _e18 = plus_turned(c_3[2], c_3[4], t_2.one);
    vec3 _e22 = plus_turned(c_3[1], c_3[5], t_2.two);
    vec3 _e26 = plus_turned(c_3[0], c_3[6], t_2.three);
    return vec3[7](_e5, _e9, _e13, c_3[3], _e18, _e22, _e26);
}

vec3[3] exchanged_1_(vec3 c_4[3]) {
    return vec3[3](-(c_4[1]), -(c_4[0]), c_4[2]);
}

vec3[5] exchanged_2_(vec3 c_5[5]) {
    return vec3[5](-(c_5[3]), c_5[1], -(((c_5[2] * 0.5) + (c_5[4] * 0.8660254))), -(c_5[0]), ((c_5[4] * 0.5) - (c_5[2] * 0.8660254)));
}

vec3[7] exchanged_3_(vec3 c_6[7]) {
    return vec3[7](((c_6[3] * 0.7905694) - (c_6[5] * 0.61237246)), c_6[1], ((c_6[3] * 0.61237246) + (c_6[5] * 0.7905694)), ((c_6[0] * 0.7905694) + (c_6[2] * 0.61237246)), -(((c_6[4] * 0.25) + (c_6[6] * 0.96824586))), ((c_6[2] * 0.7905694) - (c_6[0] * 0.61237246)), ((c_6[6] * 0.25) - (c_6[4] * 0.96824586)));
}

vec3[3] sh_turned_1_(vec3 c_7[3], ShRotation r) {
    vec3 _e3[3] = about_z_1_(c_7, r.gamma);
    vec3 _e4[3] = exchanged_1_(_e3);
    vec3 _e6[3] = about_z_1_(_e4, r.beta);
    vec3 _e7[3] = exchanged_1_(_e6);
    vec3 _e9[3] = about_z_1_(_e7, r.alpha);
    return _e9;
}

vec3[5] sh_turned_2_(vec3 c_8[5], ShRotation r_1) {
    vec3 _e3[5] = about_z_2_(c_8, r_1.gamma);
    vec3 _e4[5] = exchanged_2_(_e3);
    vec3 _e6[5] = about_z_2_(_e4, r_1.beta);
    vec3 _e7[5] = exchanged_2_(_e6);
    vec3 _e9[5] = about_z_2_(_e7, r_1.alpha);
    return _e9;
}

vec3[7] sh_turned_3_(vec3 c_9[7], ShRotation r_2) {
    vec3 _e3[7] = about_z_3_(c_9, r_2.gamma);
    vec3 _e4[7] = exchanged_3_(_e3);
    vec3 _e6[7] = about_z_3_(_e4, r_2.beta);
    vec3 _e7[7] = exchanged_3_(_e6);
    vec3 _e9[7] = about_z_3_(_e7, r_2.alpha);
    return _e9;
}

Blend gathered(uint i) {
    Blend blend_7 = Blend(Symmetric(vec4(0.0), vec3(0.0), vec3(0.0)), vec3(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, 0u);
    uint k_2 = 0u;
    Blend _e1 = empty_blend();
    blend_7 = _e1;
    bool loop_init_2 = true;
    while(true) {
        if (!loop_init_2) {
            uint _e72 = k_2;
            k_2 = (_e72 + 1u);
        }
        loop_init_2 = false;
        uint _e5 = k_2;
        uint _e8 = _group_0_binding_0_cs.influence_sets;
        if ((_e5 < _e8)) {
        } else {
            break;
        }
        {
            uint _e13 = _group_0_binding_0_cs.influence_sets;
            uint _e15 = k_2;
            uvec4 joint = _group_0_binding_3_cs[((i * _e13) + _e15)];
            uint _e22 = _group_0_binding_0_cs.influence_sets;
            uint _e24 = k_2;
            vec4 weight_2 = _group_0_binding_4_cs[((i * _e22) + _e24)];
            vec4 _e32 = _group_0_binding_1_cs[joint.x].rotation;
            vec3 _e37 = _group_0_binding_1_cs[joint.x].translation;
            take(blend_7, _e32, _e37, weight_2.x);
            vec4 _e43 = _group_0_binding_1_cs[joint.y].rotation;
            vec3 _e48 = _group_0_binding_1_cs[joint.y].translation;
            take(blend_7, _e43, _e48, weight_2.y);
            vec4 _e54 = _group_0_binding_1_cs[joint.z].rotation;
            vec3 _e59 = _group_0_binding_1_cs[joint.z].translation;
            take(blend_7, _e54, _e59, weight_2.z);
            vec4 _e65 = _group_0_binding_1_cs[joint.w].rotation;
            vec3 _e70 = _group_0_binding_1_cs[joint.w].translation;
            take(blend_7, _e65, _e70, weight_2.w);
        }
    }
    Blend _e75 = blend_7;
    return _e75;
}

Blend gathered_two(uint i_1) {
    Blend blend_8 = Blend(Symmetric(vec4(0.0), vec3(0.0), vec3(0.0)), vec3(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, 0u);
    Blend _e1 = empty_blend();
    blend_8 = _e1;
    uint _e6 = _group_0_binding_0_cs.influence_sets;
    uvec4 _e9 = _group_0_binding_3_cs[(i_1 * _e6)];
    uvec2 joint_1 = _e9.xy;
    uint _e14 = _group_0_binding_0_cs.influence_sets;
    vec4 _e17 = _group_0_binding_4_cs[(i_1 * _e14)];
    vec2 weight_3 = _e17.xy;
    vec4 _e23 = _group_0_binding_1_cs[joint_1.x].rotation;
    vec3 _e28 = _group_0_binding_1_cs[joint_1.x].translation;
    take(blend_8, _e23, _e28, weight_3.x);
    vec4 _e34 = _group_0_binding_1_cs[joint_1.y].rotation;
    vec3 _e39 = _group_0_binding_1_cs[joint_1.y].translation;
    take(blend_8, _e34, _e39, weight_3.y);
    Blend _e41 = blend_8;
    return _e41;
}

Sum summed(uint i_2, Blend blend_9) {
    Sum sum_3 = Sum(vec4(0.0), vec4(0.0));
    uint k_3 = 0u;
    bool loop_init_3 = true;
    while(true) {
        if (!loop_init_3) {
            uint _e81 = k_3;
            k_3 = (_e81 + 1u);
        }
        loop_init_3 = false;
        uint _e10 = k_3;
        uint _e13 = _group_0_binding_0_cs.influence_sets;
        if ((_e10 < _e13)) {
        } else {
            break;
        }
        {
            uint _e18 = _group_0_binding_0_cs.influence_sets;
            uint _e20 = k_3;
            uvec4 joint_2 = _group_0_binding_3_cs[((i_2 * _e18) + _e20)];
            uint _e27 = _group_0_binding_0_cs.influence_sets;
            uint _e29 = k_3;
            vec4 weight_4 = _group_0_binding_4_cs[((i_2 * _e27) + _e29)];
            vec4 _e37 = _group_0_binding_1_cs[joint_2.x].rotation;
            vec3 _e42 = _group_0_binding_1_cs[joint_2.x].translation;
            take_aligned(sum_3, _e37, _e42, weight_4.x, blend_9.heaviest);
            vec4 _e49 = _group_0_binding_1_cs[joint_2.y].rotation;
            vec3 _e54 = _group_0_binding_1_cs[joint_2.y].translation;
            take_aligned(sum_3, _e49, _e54, weight_4.y, blend_9.heaviest);
            vec4 _e61 = _group_0_binding_1_cs[joint_2.z].rotation;
            vec3 _e66 = _group_0_binding_1_cs[joint_2.z].translation;
            take_aligned(sum_3, _e61, _e66, weight_4.z, blend_9.heaviest);
            vec4 _e73 = _group_0_binding_1_cs[joint_2.w].rotation;
            vec3 _e78 = _group_0_binding_1_cs[joint_2.w].translation;
            take_aligned(sum_3, _e73, _e78, weight_4.w, blend_9.heaviest);
        }
    }
    Sum _e84 = sum_3;
    return _e84;
}

void write_motion(uint i_3, vec3 mean, vec4 relative) {
    _group_0_binding_5_cs[i_3] = vec4(mean, 1.0);
    _group_0_binding_8_cs[i_3] = relative;
    vec3 _e11 = _group_0_binding_0_cs.camera;
    vec3 view = (mean - _e11);
    float distance_ = length(view);
    vec3 unit = ((distance_ == 0.0) ? vec3(0.0, 0.0, 1.0) : (view / vec3(distance_)));
    vec4 _e25 = conjugate(relative);
    vec3 _e26 = rotate(_e25, unit);
    _group_0_binding_9_cs[i_3] = vec4(_e26, 0.0);
    return;
}

void write_covariance(uint i_4, vec3 mean_1, vec4 relative_1) {
    write_motion(i_4, mean_1, relative_1);
    vec4 _e6 = _group_0_binding_2_cs[i_4].rotation;
    vec4 _e7 = multiply(relative_1, _e6);
    vec3 _e11 = _group_0_binding_2_cs[i_4].scale;
    Covariance _e12 = covariance_of(_e7, _e11);
    _group_0_binding_6_cs[(6u * i_4)] = _e12.first.x;
    _group_0_binding_6_cs[((6u * i_4) + 1u)] = _e12.first.y;
    _group_0_binding_6_cs[((6u * i_4) + 2u)] = _e12.first.z;
    _group_0_binding_6_cs[((6u * i_4) + 3u)] = _e12.second.x;
    _group_0_binding_6_cs[((6u * i_4) + 4u)] = _e12.second.y;
    _group_0_binding_6_cs[((6u * i_4) + 5u)] = _e12.second.z;
    return;
}

void main() {
    uvec3 id_2 = gl_GlobalInvocationID;
    uint _e4 = _group_0_binding_0_cs.count;
    if ((id_2.x < _e4)) {
        uint _e8 = _group_0_binding_0_cs.first;
        uint i_11 = (_e8 + id_2.x);
        Blend _e11 = gathered(i_11);
        vec3 _e15 = _group_0_binding_2_cs[i_11].mean;
        vec3 _e16 = blended_mean(_e11, _e15);
        vec4 _e17 = closed_form(_e11);
        write_covariance(i_11, _e16, _e17);
        return;
    } else {
        return;
    }
}
