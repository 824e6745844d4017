#version 300 es
// Made from shaders/skinning.wgsl by naga: edit that. MIT OR Apache-2.0.

precision highp float;
precision highp int;

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
struct View {
    vec3 camera;
    uint count;
    uint width;
    uint rows;
    uint influence_sets;
    uint choice;
    uint power_steps;
    uint sh_degree;
    uint turned;
    uint unused;
};
struct Posed {
    vec4 mean;
    vec4 first;
    vec4 second;
    vec4 colour;
};
const float EPSILON = 1.1920929e-7;
const vec4 IDENTITY = vec4(0.0, 0.0, 0.0, 1.0);
const float RANK_ONE = 0.0002;
const uint SQUARINGS = 18u;
const float C0_ = 0.2820948;
const float C1_ = 0.48860252;

layout(std140) uniform View_block_0Fragment { View _group_0_binding_0_fs; };

uniform highp sampler2D _group_0_binding_1_fs;

uniform highp sampler2D _group_0_binding_2_fs;

uniform highp sampler2D _group_0_binding_3_fs;

uniform highp sampler2D _group_0_binding_4_fs;

uniform highp sampler2D _group_0_binding_5_fs;

layout(location = 0) out vec4 _fs2p_location0;
layout(location = 1) out vec4 _fs2p_location1;
layout(location = 2) out vec4 _fs2p_location2;
layout(location = 3) out vec4 _fs2p_location3;

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
    vec4 d_4 = blend_1.outer.diagonal;
    vec3 even = (2.0 * blend_1.outer.between);
    vec3 odd = (2.0 * blend_1.outer.beside_w);
    float x_1 = (((((d_4.w - d_4.z) + (d_4.x - d_4.y)) * p.x) + ((even.x - odd.z) * p.y)) + ((even.y + odd.y) * p.z));
    float y_1 = ((((even.x + odd.z) * p.x) + (((d_4.w - d_4.z) - (d_4.x - d_4.y)) * p.y)) + ((even.z - odd.x) * p.z));
    float z_1 = ((((even.y - odd.y) * p.x) + ((even.z + odd.x) * p.y)) + (((d_4.w + d_4.z) - (d_4.x + d_4.y)) * p.z));
    return ((vec3(x_1, y_1, z_1) + blend_1.translation) / vec3(blend_1.weight));
}

float trace(Symmetric a_1) {
    return ((a_1.diagonal.x + a_1.diagonal.y) + (a_1.diagonal.z + a_1.diagonal.w));
}

Symmetric scaled(Symmetric a_2, float factor) {
    return Symmetric((a_2.diagonal * factor), (a_2.between * factor), (a_2.beside_w * factor));
}

vec4 applied(Symmetric a_3, vec4 v_2) {
    vec3 b_4 = a_3.between;
    vec3 w = a_3.beside_w;
    return ((a_3.diagonal * v_2) + vec4((((b_4.x * v_2.y) + (b_4.y * v_2.z)) + (w.x * v_2.w)), (((b_4.x * v_2.x) + (b_4.z * v_2.z)) + (w.y * v_2.w)), (((b_4.y * v_2.x) + (b_4.z * v_2.y)) + (w.z * v_2.w)), (((w.x * v_2.x) + (w.y * v_2.y)) + (w.z * v_2.z))));
}

Symmetric squared(Symmetric a_4) {
    vec4 d_5 = a_4.diagonal;
    vec3 b_5 = a_4.between;
    vec3 w_1 = a_4.beside_w;
    vec3 bb = (b_5 * b_5);
    vec3 ww = (w_1 * w_1);
    return Symmetric(((d_5 * d_5) + vec4(((bb.x + bb.y) + ww.x), ((bb.x + bb.z) + ww.y), ((bb.y + bb.z) + ww.z), ((ww.x + ww.y) + ww.z))), ((b_5 * (d_5.xxy + d_5.yzz)) + vec3(((b_5.y * b_5.z) + (w_1.x * w_1.y)), ((b_5.x * b_5.z) + (w_1.x * w_1.z)), ((b_5.x * b_5.y) + (w_1.y * w_1.z)))), ((w_1 * (d_5.xyz + d_5.www)) + vec3(((b_5.x * w_1.y) + (b_5.y * w_1.z)), ((b_5.x * w_1.x) + (b_5.z * w_1.z)), ((b_5.y * w_1.x) + (b_5.z * w_1.y)))));
}

vec4 largest_column(Symmetric a_5) {
    vec4 column = vec4(0.0);
    float best = 0.0;
    vec3 b_6 = a_5.between;
    vec3 w_2 = a_5.beside_w;
    column = vec4(a_5.diagonal.x, b_6.x, b_6.y, w_2.x);
    best = a_5.diagonal.x;
    float _e15 = best;
    if ((a_5.diagonal.y > _e15)) {
        column = vec4(b_6.x, a_5.diagonal.y, b_6.z, w_2.y);
        best = a_5.diagonal.y;
    }
    float _e27 = best;
    if ((a_5.diagonal.z > _e27)) {
        column = vec4(b_6.y, b_6.z, a_5.diagonal.z, w_2.z);
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
    float c_10 = min(abs(cosine_1), 1.0);
    float kappa = ((u - v_3) / (u + v_3));
    float rho = sqrt(((c_10 * c_10) + ((kappa * kappa) * ((1.0 - c_10) * (1.0 + c_10)))));
    float even_1 = (rho + c_10);
    float odd_1 = (kappa * (1.0 + c_10));
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
    vec3 b_7 = plane.between;
    vec3 w_3 = plane.beside_w;
    vec4 x_2 = vec4(plane.diagonal.x, b_7.x, b_7.y, w_3.x);
    vec4 y_2 = vec4(b_7.x, plane.diagonal.y, b_7.z, w_3.y);
    vec4 z_2 = vec4(b_7.y, b_7.z, plane.diagonal.z, w_3.z);
    vec4 last = vec4(w_3.x, w_3.y, w_3.z, plane.diagonal.w);
    vec4 off_y = (y_2 - (dot(y_2, u_1) * u_1));
    vec4 off_z = (z_2 - (dot(z_2, u_1) * u_1));
    vec4 off_w = (last - (dot(last, u_1) * u_1));
    best_1 = (x_2 - (dot(x_2, u_1) * u_1));
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

ivec2 place(uint i, uint k_2) {
    uint _e4 = _group_0_binding_0_fs.width;
    uint _e9 = _group_0_binding_0_fs.width;
    uint _e13 = _group_0_binding_0_fs.rows;
    return ivec2(int((i % _e4)), int(((i / _e9) + (k_2 * _e13))));
}

vec4 joint_rotation(float j) {
    vec4 _e8 = texelFetch(_group_0_binding_4_fs, ivec2((2 * int(j)), 0), 0);
    return _e8;
}

vec3 joint_translation(float j_1) {
    vec4 _e10 = texelFetch(_group_0_binding_4_fs, ivec2(((2 * int(j_1)) + 1), 0), 0);
    return _e10.xyz;
}

Blend gathered(uint i_1) {
    Blend blend_7 = Blend(Symmetric(vec4(0.0), vec3(0.0), vec3(0.0)), vec3(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, 0u);
    uint k_3 = 0u;
    Blend _e1 = empty_blend();
    blend_7 = _e1;
    bool loop_init_2 = true;
    while(true) {
        if (!loop_init_2) {
            uint _e40 = k_3;
            k_3 = (_e40 + 1u);
        }
        loop_init_2 = false;
        uint _e5 = k_3;
        uint _e8 = _group_0_binding_0_fs.influence_sets;
        if ((_e5 < _e8)) {
        } else {
            break;
        }
        {
            uint _e11 = k_3;
            ivec2 _e12 = place(i_1, _e11);
            vec4 j_2 = texelFetch(_group_0_binding_2_fs, _e12, 0);
            uint _e16 = k_3;
            ivec2 _e17 = place(i_1, _e16);
            vec4 w_4 = texelFetch(_group_0_binding_3_fs, _e17, 0);
            vec4 _e21 = joint_rotation(j_2.x);
            vec3 _e23 = joint_translation(j_2.x);
            take(blend_7, _e21, _e23, w_4.x);
            vec4 _e26 = joint_rotation(j_2.y);
            vec3 _e28 = joint_translation(j_2.y);
            take(blend_7, _e26, _e28, w_4.y);
            vec4 _e31 = joint_rotation(j_2.z);
            vec3 _e33 = joint_translation(j_2.z);
            take(blend_7, _e31, _e33, w_4.z);
            vec4 _e36 = joint_rotation(j_2.w);
            vec3 _e38 = joint_translation(j_2.w);
            take(blend_7, _e36, _e38, w_4.w);
        }
    }
    Blend _e43 = blend_7;
    return _e43;
}

Sum summed(uint i_2, Blend blend_8) {
    Sum sum_3 = Sum(vec4(0.0), vec4(0.0));
    uint k_4 = 0u;
    bool loop_init_3 = true;
    while(true) {
        if (!loop_init_3) {
            uint _e49 = k_4;
            k_4 = (_e49 + 1u);
        }
        loop_init_3 = false;
        uint _e10 = k_4;
        uint _e13 = _group_0_binding_0_fs.influence_sets;
        if ((_e10 < _e13)) {
        } else {
            break;
        }
        {
            uint _e16 = k_4;
            ivec2 _e17 = place(i_2, _e16);
            vec4 j_3 = texelFetch(_group_0_binding_2_fs, _e17, 0);
            uint _e21 = k_4;
            ivec2 _e22 = place(i_2, _e21);
            vec4 w_5 = texelFetch(_group_0_binding_3_fs, _e22, 0);
            vec4 _e26 = joint_rotation(j_3.x);
            vec3 _e28 = joint_translation(j_3.x);
            take_aligned(sum_3, _e26, _e28, w_5.x, blend_8.heaviest);
            vec4 _e32 = joint_rotation(j_3.y);
            vec3 _e34 = joint_translation(j_3.y);
            take_aligned(sum_3, _e32, _e34, w_5.y, blend_8.heaviest);
            vec4 _e38 = joint_rotation(j_3.z);
            vec3 _e40 = joint_translation(j_3.z);
            take_aligned(sum_3, _e38, _e40, w_5.z, blend_8.heaviest);
            vec4 _e44 = joint_rotation(j_3.w);
            vec3 _e46 = joint_translation(j_3.w);
            take_aligned(sum_3, _e44, _e46, w_5.w, blend_8.heaviest);
        }
    }
    Sum _e52 = sum_3;
    return _e52;
}

vec4 upright(vec4 q_7, float weight_2) {
    return (((q_7.w < 0.0) ? -(q_7) : q_7) * max(weight_2, 0.0));
}

vec4 summed_upright(uint i_3) {
    vec4 sum_4 = vec4(0.0);
    uint k_5 = 0u;
    bool loop_init_4 = true;
    while(true) {
        if (!loop_init_4) {
            uint _e42 = k_5;
            k_5 = (_e42 + 1u);
        }
        loop_init_4 = false;
        uint _e6 = k_5;
        uint _e9 = _group_0_binding_0_fs.influence_sets;
        if ((_e6 < _e9)) {
        } else {
            break;
        }
        {
            uint _e12 = k_5;
            ivec2 _e13 = place(i_3, _e12);
            vec4 j_4 = texelFetch(_group_0_binding_2_fs, _e13, 0);
            uint _e17 = k_5;
            ivec2 _e18 = place(i_3, _e17);
            vec4 w_6 = texelFetch(_group_0_binding_3_fs, _e18, 0);
            vec4 _e21 = sum_4;
            vec4 _e23 = joint_rotation(j_4.x);
            vec4 _e25 = upright(_e23, w_6.x);
            vec4 _e27 = joint_rotation(j_4.y);
            vec4 _e29 = upright(_e27, w_6.y);
            vec4 _e32 = joint_rotation(j_4.z);
            vec4 _e34 = upright(_e32, w_6.z);
            vec4 _e36 = joint_rotation(j_4.w);
            vec4 _e38 = upright(_e36, w_6.w);
            sum_4 = (_e21 + ((_e25 + _e29) + (_e34 + _e38)));
        }
    }
    vec4 _e45 = sum_4;
    vec4 _e47 = normalized_or(_e45, IDENTITY);
    return _e47;
}

vec4 quaternion_of(vec3 x, vec3 y, vec3 z) {
    Symmetric outer_1 = Symmetric(vec4((((1.0 + x.x) - y.y) - z.z), (((1.0 - x.x) + y.y) - z.z), (((1.0 - x.x) - y.y) + z.z), (((1.0 + x.x) + y.y) + z.z)), vec3((x.y + y.x), (x.z + z.x), (y.z + z.y)), vec3((y.z - z.y), (z.x - x.z), (x.y - y.x)));
    vec4 _e53 = largest_column(outer_1);
    vec4 _e55 = normalized_or(_e53, IDENTITY);
    return _e55;
}

vec3 blended_direction(Blend blend_9, vec3 axis) {
    Blend still = Blend(Symmetric(vec4(0.0), vec3(0.0), vec3(0.0)), vec3(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, vec4(0.0), 0.0, 0u);
    still = blend_9;
    still.translation = vec3(0.0);
    Blend _e6 = still;
    vec3 _e7 = blended_mean(_e6, axis);
    return _e7;
}

vec4 gram_schmidt(Blend blend_10) {
    vec3 _e5 = blended_direction(blend_10, vec3(1.0, 0.0, 0.0));
    vec3 _e10 = blended_direction(blend_10, vec3(0.0, 1.0, 0.0));
    vec3 first = (_e5 / vec3(max(length(_e5), 1e-20)));
    vec3 rest = (_e10 - (dot(first, _e10) * first));
    vec3 second_1 = (rest / vec3(max(length(rest), 1e-20)));
    vec4 _e25 = quaternion_of(first, second_1, cross(first, second_1));
    return _e25;
}

float degrees_between(vec4 a_9, vec4 b_3) {
    float near = min(length((a_9 - b_3)), length((a_9 + b_3)));
    float far = max(length((a_9 - b_3)), length((a_9 + b_3)));
    return degrees((4.0 * atan(near, far)));
}

float sh_number(uint i_4, uint at_1) {
    ivec2 _e5 = place(i_4, (at_1 / 4u));
    vec4 four = texelFetch(_group_0_binding_5_fs, _e5, 0);
    uint k_7 = (at_1 % 4u);
    return ((k_7 < 2u) ? ((k_7 == 0u) ? four.x : four.y) : ((k_7 == 2u) ? four.z : four.w));
}

vec3 coefficient(uint i_5, uint k_6) {
    float _e4 = sh_number(i_5, (3u * k_6));
    float _e9 = sh_number(i_5, ((3u * k_6) + 1u));
    float _e14 = sh_number(i_5, ((3u * k_6) + 2u));
    return vec3(_e4, _e9, _e14);
}

vec3 colour_of(uint i_6, vec3 d_3) {
    vec3 rgb = vec3(0.0);
    vec3 _e6 = coefficient(i_6, 0u);
    rgb = (vec3(0.5) + (C0_ * _e6));
    uint _e12 = _group_0_binding_0_fs.sh_degree;
    if ((_e12 >= 1u)) {
        vec3 _e15 = rgb;
        vec3 _e17 = coefficient(i_6, 1u);
        vec3 _e19 = coefficient(i_6, 2u);
        vec3 _e21 = coefficient(i_6, 3u);
        vec3 _e22 = sh_degree_1_(d_3, _e17, _e19, _e21);
        rgb = (_e15 + _e22);
    }
    uint _e26 = _group_0_binding_0_fs.sh_degree;
    if ((_e26 >= 2u)) {
        float _e29[5] = basis_2_(d_3);
        vec3 _e30 = rgb;
        vec3 _e33 = coefficient(i_6, 4u);
        vec3 _e37 = coefficient(i_6, 5u);
        vec3 _e42 = coefficient(i_6, 6u);
        vec3 _e47 = coefficient(i_6, 7u);
        vec3 _e52 = coefficient(i_6, 8u);
        rgb = (_e30 + (((((_e29[0] * _e33) + (_e29[1] * _e37)) + (_e29[2] * _e42)) + (_e29[3] * _e47)) + (_e29[4] * _e52)));
    }
    uint _e58 = _group_0_binding_0_fs.sh_degree;
    if ((_e58 >= 3u)) {
        float _e61[7] = basis_3_(d_3);
        vec3 _e62 = rgb;
        vec3 _e65 = coefficient(i_6, 9u);
        vec3 _e69 = coefficient(i_6, 10u);
        vec3 _e74 = coefficient(i_6, 11u);
        vec3 _e79 = coefficient(i_6, 12u);
        vec3 _e84 = coefficient(i_6, 13u);
        vec3 _e89 = coefficient(i_6, 14u);
        vec3 _e94 = coefficient(i_6, 15u);
        rgb = (_e62 + (((((((_e61[0] * _e65) + (_e61[1] * _e69)) + (_e61[2] * _e74)) + (_e61[3] * _e79)) + (_e61[4] * _e84)) + (_e61[5] * _e89)) + (_e61[6] * _e94)));
    }
    vec3 _e98 = rgb;
    return max(_e98, vec3(0.0));
}

void main() {
    vec4 at = gl_FragCoord;
    vec3 mean = vec3(0.0);
    vec4 relative = vec4(0.0);
    uint _e5 = _group_0_binding_0_fs.width;
    uint i_7 = ((uint(at.y) * _e5) + uint(at.x));
    uint _e12 = _group_0_binding_0_fs.count;
    if ((i_7 >= _e12)) {
        Posed _tmp_return = Posed(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
        _fs2p_location0 = _tmp_return.mean;
        _fs2p_location1 = _tmp_return.first;
        _fs2p_location2 = _tmp_return.second;
        _fs2p_location3 = _tmp_return.colour;
        return;
    }
    ivec2 _e25 = place(i_7, 0u);
    vec4 own = texelFetch(_group_0_binding_1_fs, _e25, 0);
    Blend _e28 = gathered(i_7);
    vec4 _e29 = closed_form(_e28);
    vec3 _e31 = blended_mean(_e28, own.xyz);
    mean = _e31;
    relative = _e29;
    uint _e36 = _group_0_binding_0_fs.choice;
    if ((_e36 == 1u)) {
        uint _e41 = _group_0_binding_0_fs.power_steps;
        vec4 _e42 = power_steps(_e28, _e41);
        relative = _e42;
    } else {
        uint _e45 = _group_0_binding_0_fs.choice;
        if ((_e45 == 2u)) {
            Sum _e48 = summed(i_7, _e28);
            vec4 _e49 = aligned_sum(_e28, _e48);
            relative = _e49;
        } else {
            uint _e52 = _group_0_binding_0_fs.choice;
            if ((_e52 == 3u)) {
                Sum _e55 = summed(i_7, _e28);
                Motion _e56 = dual_quaternion(_e28, _e55);
                relative = _e56.rotation;
                vec3 _e60 = rotate(_e56.rotation, own.xyz);
                mean = (_e60 + _e56.translation);
            } else {
                uint _e65 = _group_0_binding_0_fs.choice;
                if ((_e65 == 4u)) {
                    vec4 _e68 = summed_upright(i_7);
                    relative = _e68;
                } else {
                    uint _e71 = _group_0_binding_0_fs.choice;
                    if ((_e71 == 5u)) {
                        vec4 _e74 = gram_schmidt(_e28);
                        relative = _e74;
                    }
                }
            }
        }
    }
    vec4 _e75 = relative;
    ivec2 _e78 = place(i_7, 1u);
    vec4 _e80 = texelFetch(_group_0_binding_1_fs, _e78, 0);
    vec4 _e81 = multiply(_e75, _e80);
    ivec2 _e84 = place(i_7, 2u);
    vec4 _e86 = texelFetch(_group_0_binding_1_fs, _e84, 0);
    Covariance _e88 = covariance_of(_e81, _e86.xyz);
    vec3 _e89 = mean;
    vec3 _e92 = _group_0_binding_0_fs.camera;
    vec3 eye = (_e89 - _e92);
    vec3 d_6 = (eye / vec3(max(length(eye), 1e-20)));
    vec4 _e99 = relative;
    vec4 _e100 = conjugate(_e99);
    vec3 _e101 = rotate(_e100, d_6);
    uint _e104 = _group_0_binding_0_fs.turned;
    vec3 _e108 = colour_of(i_7, ((_e104 == 1u) ? _e101 : d_6));
    vec3 _e109 = mean;
    vec4 _e110 = relative;
    float _e111 = degrees_between(_e110, _e29);
    Posed _tmp_return = Posed(vec4(_e109, _e111), vec4(_e88.first, _e88.second.x), vec4(_e88.second.yz, 0.0, 0.0), vec4(_e108, own.w));
    _fs2p_location0 = _tmp_return.mean;
    _fs2p_location1 = _tmp_return.first;
    _fs2p_location2 = _tmp_return.second;
    _fs2p_location3 = _tmp_return.colour;
    return;
}
