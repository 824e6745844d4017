// Made from shaders/skinning.wgsl by naga: edit that. MIT OR Apache-2.0.
// language: metal2.0
#include <metal_stdlib>
#include <simd/simd.h>

using metal::uint;

struct _mslBufferSizes {
    uint size1;
    uint size2;
    uint size3;
    uint size4;
    uint size5;
    uint size6;
    uint size7;
    uint size8;
    uint size9;
    uint size10;
    uint size11;
    uint size12;
};

struct Params {
    uint count;
    uint first;
    uint influence_sets;
    uint power_steps;
    metal::packed_float3 camera;
    uint sh_degree;
    uint sh_stride;
    uint sh_coefficient_stride;
    uint unused_0_;
    uint unused_1_;
};
struct Joint {
    metal::float4 rotation;
    metal::float3 translation;
};
struct Gaussian {
    metal::float3 mean;
    metal::float4 rotation;
    metal::float3 scale;
};
struct Symmetric {
    metal::float4 diagonal;
    metal::float3 between;
    metal::float3 beside_w;
};
struct Blend {
    Symmetric outer;
    metal::packed_float3 translation;
    float weight;
    metal::float4 heaviest;
    float heaviest_weight;
    char _pad5[12];
    metal::float4 earlier;
    float earlier_weight;
    char _pad7[12];
    metal::float4 latest;
    float latest_weight;
    uint bones;
    char _pad10[8];
};
struct Sum {
    metal::float4 real;
    metal::float4 dual;
};
struct Motion {
    metal::float4 rotation;
    metal::float3 translation;
};
struct Covariance {
    metal::float3 first;
    metal::float3 second;
};
struct type_8 {
    float inner[5];
};
struct type_9 {
    float inner[7];
};
struct Turn {
    metal::float2 one;
    metal::float2 two;
    metal::float2 three;
};
struct ShRotation {
    Turn gamma;
    Turn beta;
    Turn alpha;
};
struct type_10 {
    metal::float3 inner[3];
};
struct type_11 {
    metal::float3 inner[5];
};
struct type_12 {
    metal::float3 inner[7];
};
typedef Joint type_13[1];
typedef Gaussian type_14[1];
typedef metal::uint4 type_16[1];
typedef metal::float4 type_17[1];
typedef float type_18[1];
constant float EPSILON = 0.00000011920929;
constant metal::float4 IDENTITY = metal::float4(0.0, 0.0, 0.0, 1.0);
constant float RANK_ONE = 0.0002;
constant uint SQUARINGS = 18u;
constant float C0_ = 0.2820948;
constant float C1_ = 0.48860252;

metal::float4 multiply(
    metal::float4 a,
    metal::float4 b
) {
    return metal::float4(((a.w * b.xyz) + (b.w * a.xyz)) + metal::cross(a.xyz, b.xyz), (a.w * b.w) - metal::dot(a.xyz, b.xyz));
}

metal::float4 conjugate(
    metal::float4 q
) {
    return metal::float4(-(q.xyz), q.w);
}

metal::float3 rotate(
    metal::float4 q_1,
    metal::float3 v
) {
    metal::float3 t_3 = 2.0 * metal::cross(q_1.xyz, v);
    return (v + (q_1.w * t_3)) + metal::cross(q_1.xyz, t_3);
}

float largest_magnitude(
    metal::float4 v_1
) {
    metal::float4 m = metal::abs(v_1);
    return metal::max(metal::max(m.x, m.y), metal::max(m.z, m.w));
}

metal::float4 normalized_or(
    metal::float4 q_2,
    metal::float4 otherwise
) {
    float _e2 = largest_magnitude(q_2);
    if (!((_e2 > 0.0))) {
        return otherwise;
    }
    metal::float4 scaled_1 = q_2 / metal::float4(_e2);
    return scaled_1 / metal::float4(metal::sqrt(metal::dot(scaled_1, scaled_1)));
}

bool is_opposite(
    metal::float4 q_3,
    metal::float4 reference
) {
    float largest = {};
    float cosine = metal::dot(q_3, reference);
    if (metal::abs(cosine) > 0.0000019073486) {
        return cosine < 0.0;
    }
    metal::float4 _e8 = conjugate(reference);
    metal::float4 _e9 = multiply(_e8, q_3);
    largest = _e9.x;
    float _e14 = largest;
    if (metal::abs(_e9.y) > metal::abs(_e14)) {
        largest = _e9.y;
    }
    float _e20 = largest;
    if (metal::abs(_e9.z) > metal::abs(_e20)) {
        largest = _e9.z;
    }
    float _e24 = largest;
    return _e24 < 0.0;
}

Blend empty_blend(
) {
    metal::float3 zero = metal::float3(0.0);
    return Blend {Symmetric {metal::float4(0.0), zero, zero}, zero, 0.0, IDENTITY, 0.0, {}, IDENTITY, 0.0, {}, IDENTITY, 0.0, 0u};
}

void take(
    thread Blend& blend,
    metal::float4 rotation,
    metal::float3 translation,
    float weight
) {
    if (!((weight > 0.0))) {
        return;
    }
    metal::float4 weighted = weight * rotation;
    metal::float4 _e10 = blend.outer.diagonal;
    blend.outer.diagonal = _e10 + (weighted * rotation);
    metal::float3 _e15 = blend.outer.between;
    blend.outer.between = _e15 + (weighted.xxy * rotation.yzz);
    metal::float3 _e22 = blend.outer.beside_w;
    blend.outer.beside_w = _e22 + (weighted.xyz * rotation.w);
    metal::float3 _e28 = blend.translation;
    blend.translation = _e28 + (weight * translation);
    float _e32 = blend.weight;
    blend.weight = _e32 + weight;
    float _e35 = blend.heaviest_weight;
    if (weight > _e35) {
        blend.heaviest = rotation;
        blend.heaviest_weight = weight;
    }
    metal::float4 _e41 = blend.latest;
    blend.earlier = _e41;
    float _e44 = blend.latest_weight;
    blend.earlier_weight = _e44;
    blend.latest = rotation;
    blend.latest_weight = weight;
    uint _e48 = blend.bones;
    blend.bones = _e48 + 1u;
    return;
}

metal::float3 blended_mean(
    Blend blend_1,
    metal::float3 p
) {
    if (blend_1.bones == 0u) {
        return p;
    }
    metal::float4 d_3 = blend_1.outer.diagonal;
    metal::float3 even = 2.0 * blend_1.outer.between;
    metal::float3 odd = 2.0 * blend_1.outer.beside_w;
    float x = ((((blend_1.outer.diagonal.w - blend_1.outer.diagonal.z) + (blend_1.outer.diagonal.x - blend_1.outer.diagonal.y)) * p.x) + ((even.x - odd.z) * p.y)) + ((even.y + odd.y) * p.z);
    float y = (((even.x + odd.z) * p.x) + (((blend_1.outer.diagonal.w - blend_1.outer.diagonal.z) - (blend_1.outer.diagonal.x - blend_1.outer.diagonal.y)) * p.y)) + ((even.z - odd.x) * p.z);
    float z = (((even.y - odd.y) * p.x) + ((even.z + odd.x) * p.y)) + (((blend_1.outer.diagonal.w + blend_1.outer.diagonal.z) - (blend_1.outer.diagonal.x + blend_1.outer.diagonal.y)) * p.z);
    return (metal::float3(x, y, z) + blend_1.translation) / metal::float3(blend_1.weight);
}

float trace(
    Symmetric a_1
) {
    return (a_1.diagonal.x + a_1.diagonal.y) + (a_1.diagonal.z + a_1.diagonal.w);
}

Symmetric scaled(
    Symmetric a_2,
    float factor
) {
    return Symmetric {a_2.diagonal * factor, a_2.between * factor, a_2.beside_w * factor};
}

metal::float4 applied(
    Symmetric a_3,
    metal::float4 v_2
) {
    metal::float3 b_3 = a_3.between;
    metal::float3 w = a_3.beside_w;
    return (a_3.diagonal * v_2) + metal::float4(((a_3.between.x * v_2.y) + (a_3.between.y * v_2.z)) + (a_3.beside_w.x * v_2.w), ((a_3.between.x * v_2.x) + (a_3.between.z * v_2.z)) + (a_3.beside_w.y * v_2.w), ((a_3.between.y * v_2.x) + (a_3.between.z * v_2.y)) + (a_3.beside_w.z * v_2.w), ((a_3.beside_w.x * v_2.x) + (a_3.beside_w.y * v_2.y)) + (a_3.beside_w.z * v_2.z));
}

Symmetric squared(
    Symmetric a_4
) {
    metal::float4 d_4 = a_4.diagonal;
    metal::float3 b_4 = a_4.between;
    metal::float3 w_1 = a_4.beside_w;
    metal::float3 bb = b_4 * b_4;
    metal::float3 ww = w_1 * w_1;
    return Symmetric {(d_4 * d_4) + metal::float4((bb.x + bb.y) + ww.x, (bb.x + bb.z) + ww.y, (bb.y + bb.z) + ww.z, (ww.x + ww.y) + ww.z), (b_4 * (d_4.xxy + d_4.yzz)) + metal::float3((a_4.between.y * a_4.between.z) + (a_4.beside_w.x * a_4.beside_w.y), (a_4.between.x * a_4.between.z) + (a_4.beside_w.x * a_4.beside_w.z), (a_4.between.x * a_4.between.y) + (a_4.beside_w.y * a_4.beside_w.z)), (w_1 * (d_4.xyz + d_4.www)) + metal::float3((a_4.between.x * a_4.beside_w.y) + (a_4.between.y * a_4.beside_w.z), (a_4.between.x * a_4.beside_w.x) + (a_4.between.z * a_4.beside_w.z), (a_4.between.y * a_4.beside_w.x) + (a_4.between.z * a_4.beside_w.y))};
}

metal::float4 largest_column(
    Symmetric a_5
) {
    metal::float4 column = {};
    float best = {};
    metal::float3 b_5 = a_5.between;
    metal::float3 w_2 = a_5.beside_w;
    column = metal::float4(a_5.diagonal.x, a_5.between.x, a_5.between.y, a_5.beside_w.x);
    best = a_5.diagonal.x;
    float _e15 = best;
    if (a_5.diagonal.y > _e15) {
        column = metal::float4(a_5.between.x, a_5.diagonal.y, a_5.between.z, a_5.beside_w.y);
        best = a_5.diagonal.y;
    }
    float _e27 = best;
    if (a_5.diagonal.z > _e27) {
        column = metal::float4(a_5.between.y, a_5.between.z, a_5.diagonal.z, a_5.beside_w.z);
        best = a_5.diagonal.z;
    }
    float _e39 = best;
    if (a_5.diagonal.w > _e39) {
        column = metal::float4(a_5.beside_w.x, a_5.beside_w.y, a_5.beside_w.z, a_5.diagonal.w);
    }
    metal::float4 _e47 = column;
    return _e47;
}

metal::float4 average_of_two(
    metal::float4 p_1,
    float u,
    metal::float4 q_4,
    float v_3
) {
    float cosine_1 = metal::dot(p_1, q_4);
    float c_11 = metal::min(metal::abs(cosine_1), 1.0);
    float kappa = (u - v_3) / (u + v_3);
    float rho = metal::sqrt((c_11 * c_11) + ((kappa * kappa) * ((1.0 - c_11) * (1.0 + c_11))));
    float even_1 = rho + c_11;
    float odd_1 = kappa * (1.0 + c_11);
    if (!(((2.0 * rho) > (0.0000019073486 * (1.0 + rho))))) {
        if (v_3 > u) {
            return q_4;
        }
        return p_1;
    }
    float of_q = (cosine_1 < 0.0) ? (odd_1 - even_1) : (even_1 - odd_1);
    metal::float4 _e43 = normalized_or(((even_1 + odd_1) * p_1) + (of_q * q_4), p_1);
    return _e43;
}

metal::float4 beside(
    Symmetric plane,
    metal::float4 u_1
) {
    metal::float4 best_1 = {};
    metal::float3 b_6 = plane.between;
    metal::float3 w_3 = plane.beside_w;
    metal::float4 x_1 = metal::float4(plane.diagonal.x, plane.between.x, plane.between.y, plane.beside_w.x);
    metal::float4 y_1 = metal::float4(plane.between.x, plane.diagonal.y, plane.between.z, plane.beside_w.y);
    metal::float4 z_1 = metal::float4(plane.between.y, plane.between.z, plane.diagonal.z, plane.beside_w.z);
    metal::float4 last = metal::float4(plane.beside_w.x, plane.beside_w.y, plane.beside_w.z, plane.diagonal.w);
    metal::float4 off_y = y_1 - (metal::dot(y_1, u_1) * u_1);
    metal::float4 off_z = z_1 - (metal::dot(z_1, u_1) * u_1);
    metal::float4 off_w = last - (metal::dot(last, u_1) * u_1);
    best_1 = x_1 - (metal::dot(x_1, u_1) * u_1);
    metal::float4 _e42 = best_1;
    metal::float4 _e43 = best_1;
    if (metal::dot(off_y, off_y) > metal::dot(_e42, _e43)) {
        best_1 = off_y;
    }
    metal::float4 _e47 = best_1;
    metal::float4 _e48 = best_1;
    if (metal::dot(off_z, off_z) > metal::dot(_e47, _e48)) {
        best_1 = off_z;
    }
    metal::float4 _e52 = best_1;
    metal::float4 _e53 = best_1;
    if (metal::dot(off_w, off_w) > metal::dot(_e52, _e53)) {
        best_1 = off_w;
    }
    metal::float4 _e56 = best_1;
    metal::float4 _e59 = normalized_or(_e56, metal::float4(0.0));
    metal::float4 _e65 = normalized_or(_e59 - (metal::dot(_e59, u_1) * u_1), metal::float4(0.0));
    return _e65;
}

metal::float4 leading_in_plane(
    Symmetric a_6,
    Symmetric plane_1,
    metal::float4 heaviest
) {
    metal::float4 _e3 = applied(plane_1, heaviest);
    metal::float4 _e4 = normalized_or(_e3, heaviest);
    metal::float4 _e5 = beside(plane_1, _e4);
    metal::float4 _e6 = applied(a_6, _e5);
    metal::float4 _e7 = applied(a_6, _e4);
    float uu = metal::dot(_e4, _e7);
    float vv = metal::dot(_e5, _e6);
    float half_ = 0.5 * (uu - vv);
    float across = metal::dot(_e4, _e6);
    float rho_1 = metal::sqrt((half_ * half_) + (across * across));
    if (!(((2.0 * rho_1) > (0.0000019073486 * ((0.5 * (uu + vv)) + rho_1))))) {
        return _e4;
    }
    if (half_ >= 0.0) {
        metal::float4 _e34 = normalized_or(((rho_1 + half_) * _e4) + (across * _e5), _e4);
        return _e34;
    }
    metal::float4 _e39 = normalized_or((across * _e4) + ((rho_1 - half_) * _e5), _e4);
    return _e39;
}

metal::float4 average_of_many(
    Symmetric outer,
    metal::float4 heaviest_1
) {
    Symmetric power = {};
    uint k = 0u;
    float _e2 = trace(outer);
    Symmetric _e5 = scaled(outer, 1.0 / _e2);
    power = _e5;
    bool loop_init = true;
    while(true) {
        if (!loop_init) {
            uint _e26 = k;
            k = _e26 + 1u;
        }
        loop_init = false;
        uint _e9 = k;
        if (_e9 < SQUARINGS) {
        } else {
            break;
        }
        {
            Symmetric _e12 = power;
            Symmetric _e13 = squared(_e12);
            float _e14 = trace(_e13);
            Symmetric _e17 = scaled(_e13, 1.0 / _e14);
            power = _e17;
            if (metal::abs(1.0 - _e14) <= RANK_ONE) {
                Symmetric _e23 = power;
                metal::float4 _e24 = largest_column(_e23);
                metal::float4 _e25 = normalized_or(_e24, heaviest_1);
                return _e25;
            }
        }
    }
    Symmetric _e29 = power;
    metal::float4 _e30 = leading_in_plane(_e5, _e29, heaviest_1);
    return _e30;
}

metal::float4 closed_form_of_two(
    Blend blend_2
) {
    if (blend_2.bones < 2u) {
        return blend_2.heaviest;
    }
    metal::float4 _e9 = average_of_two(blend_2.earlier, blend_2.earlier_weight, blend_2.latest, blend_2.latest_weight);
    return _e9;
}

metal::float4 closed_form(
    Blend blend_3
) {
    if (blend_3.bones <= 2u) {
        metal::float4 _e4 = closed_form_of_two(blend_3);
        return _e4;
    }
    metal::float4 _e7 = average_of_many(blend_3.outer, blend_3.heaviest);
    return _e7;
}

metal::float4 power_steps(
    Blend blend_4,
    uint steps
) {
    metal::float4 v_4 = {};
    uint k_1 = 0u;
    if (blend_4.bones < 2u) {
        return blend_4.heaviest;
    }
    Symmetric _e10 = scaled(blend_4.outer, 1.0 / blend_4.weight);
    v_4 = blend_4.heaviest;
    bool loop_init_1 = true;
    while(true) {
        if (!loop_init_1) {
            uint _e23 = k_1;
            k_1 = _e23 + 1u;
        }
        loop_init_1 = false;
        uint _e15 = k_1;
        if (_e15 < steps) {
        } else {
            break;
        }
        {
            metal::float4 _e17 = v_4;
            metal::float4 _e18 = applied(_e10, _e17);
            v_4 = _e18 / metal::float4(metal::sqrt(metal::dot(_e18, _e18)));
        }
    }
    metal::float4 _e26 = v_4;
    return _e26;
}

void take_aligned(
    thread Sum& sum,
    metal::float4 rotation_1,
    metal::float3 translation_1,
    float weight_1,
    metal::float4 reference_1
) {
    if (!((weight_1 > 0.0))) {
        return;
    }
    bool _e9 = is_opposite(rotation_1, reference_1);
    float signed_ = _e9 ? -(weight_1) : weight_1;
    metal::float4 _e12 = sum.real;
    sum.real = _e12 + (signed_ * rotation_1);
    metal::float4 _e16 = sum.dual;
    metal::float4 _e19 = multiply(metal::float4(translation_1, 0.0), rotation_1);
    sum.dual = _e16 + (signed_ * _e19);
    return;
}

metal::float4 aligned_sum(
    Blend blend_5,
    Sum sum_1
) {
    if (blend_5.bones < 2u) {
        return blend_5.heaviest;
    }
    metal::float4 _e8 = normalized_or(sum_1.real, blend_5.heaviest);
    return _e8;
}

Motion dual_quaternion(
    Blend blend_6,
    Sum sum_2
) {
    if (blend_6.bones == 0u) {
        return Motion {metal::float4(0.0, 0.0, 0.0, 1.0), metal::float3(0.0)};
    }
    metal::float4 _e15 = conjugate(sum_2.real);
    metal::float4 _e16 = multiply(sum_2.dual, _e15);
    metal::float3 translation_2 = _e16.xyz / metal::float3(metal::dot(sum_2.real, sum_2.real));
    metal::float4 _e25 = normalized_or(sum_2.real, blend_6.heaviest);
    return Motion {_e25, translation_2};
}

Covariance covariance_of(
    metal::float4 q_5,
    metal::float3 s
) {
    metal::float3 _e6 = rotate(q_5, metal::float3(s.x, 0.0, 0.0));
    metal::float3 _e11 = rotate(q_5, metal::float3(0.0, s.y, 0.0));
    metal::float3 _e16 = rotate(q_5, metal::float3(0.0, 0.0, s.z));
    metal::float2 second = metal::float2(((_e6.y * _e6.y) + (_e11.y * _e11.y)) + (_e16.y * _e16.y), ((_e6.y * _e6.z) + (_e11.y * _e11.z)) + (_e16.y * _e16.z));
    return Covariance {((_e6.x * _e6) + (_e11.x * _e11)) + (_e16.x * _e16), metal::float3(second, ((_e6.z * _e6.z) + (_e11.z * _e11.z)) + (_e16.z * _e16.z))};
}

metal::float3 sh_degree_1_(
    metal::float3 d,
    metal::float3 a_7,
    metal::float3 b_1,
    metal::float3 c
) {
    return C1_ * (((d.z * b_1) - (d.y * a_7)) - (d.x * c));
}

type_8 basis_2_(
    metal::float3 d_1
) {
    return type_8 {{(1.0925485 * d_1.x) * d_1.y, (-1.0925485 * d_1.y) * d_1.z, 0.31539157 * ((((2.0 * d_1.z) * d_1.z) - (d_1.x * d_1.x)) - (d_1.y * d_1.y)), (-1.0925485 * d_1.x) * d_1.z, 0.54627424 * ((d_1.x * d_1.x) - (d_1.y * d_1.y))}};
}

type_9 basis_3_(
    metal::float3 d_2
) {
    float xx = d_2.x * d_2.x;
    float yy = d_2.y * d_2.y;
    float zz = d_2.z * d_2.z;
    return type_9 {{(-0.5900436 * d_2.y) * ((3.0 * xx) - yy), ((2.8906114 * d_2.x) * d_2.y) * d_2.z, (-0.4570458 * d_2.y) * (((4.0 * zz) - xx) - yy), (0.37317634 * d_2.z) * (((2.0 * zz) - (3.0 * xx)) - (3.0 * yy)), (-0.4570458 * d_2.x) * (((4.0 * zz) - xx) - yy), (1.4453057 * d_2.z) * (xx - yy), (-0.5900436 * d_2.x) * (xx - (3.0 * yy))}};
}

metal::float2 compose(
    metal::float2 a_8,
    metal::float2 b_2
) {
    return metal::float2((a_8.x * b_2.x) - (a_8.y * b_2.y), (a_8.y * b_2.x) + (a_8.x * b_2.y));
}

Turn multiples(
    metal::float2 angle
) {
    metal::float2 _e1 = compose(angle, angle);
    metal::float2 _e2 = compose(_e1, angle);
    return Turn {angle, _e1, _e2};
}

metal::float2 direction_of(
    metal::float2 v_5
) {
    float square = metal::dot(v_5, v_5);
    if (square < 0.0000000000000000000000000002) {
        return metal::float2(1.0, 0.0);
    }
    return v_5 / metal::float2(metal::sqrt(square));
}

ShRotation sh_rotation(
    metal::float4 q_6
) {
    metal::float2 _e2 = direction_of(q_6.wz);
    metal::float2 _e7 = direction_of(metal::float2(q_6.y, -(q_6.x)));
    float cos2_ = metal::dot(q_6.wz, q_6.wz);
    float sin2_ = metal::dot(q_6.xy, q_6.xy);
    metal::float2 beta = metal::float2(cos2_ - sin2_, -2.0 * metal::sqrt(cos2_ * sin2_));
    metal::float2 _e24 = compose(_e2, metal::float2(_e7.x, -(_e7.y)));
    Turn _e25 = multiples(_e24);
    Turn _e26 = multiples(beta);
    metal::float2 _e27 = compose(_e2, _e7);
    Turn _e28 = multiples(_e27);
    return ShRotation {_e25, _e26, _e28};
}

metal::float3 plus_turned(
    metal::float3 minus,
    metal::float3 plus,
    metal::float2 turn
) {
    return (plus * turn.x) - (minus * turn.y);
}

metal::float3 minus_turned(
    metal::float3 minus_1,
    metal::float3 plus_1,
    metal::float2 turn_1
) {
    return (plus_1 * turn_1.y) + (minus_1 * turn_1.x);
}

type_10 about_z_1_(
    type_10 c_1,
    Turn t
) {
    metal::float3 _e5 = minus_turned(c_1.inner[0], c_1.inner[2], t.one);
    metal::float3 _e10 = plus_turned(c_1.inner[0], c_1.inner[2], t.one);
    return type_10 {{_e5, c_1.inner[1], _e10}};
}

type_11 about_z_2_(
    type_11 c_2,
    Turn t_1
) {
    metal::float3 _e5 = minus_turned(c_2.inner[0], c_2.inner[4], t_1.two);
    metal::float3 _e9 = minus_turned(c_2.inner[1], c_2.inner[3], t_1.one);
    metal::float3 _e14 = plus_turned(c_2.inner[1], c_2.inner[3], t_1.one);
    metal::float3 _e18 = plus_turned(c_2.inner[0], c_2.inner[4], t_1.two);
    return type_11 {{_e5, _e9, c_2.inner[2], _e14, _e18}};
}

type_12 about_z_3_(
    type_12 c_3,
    Turn t_2
) {
    metal::float3 _e5 = minus_turned(c_3.inner[0], c_3.inner[6], t_2.three);
    metal::float3 _e9 = minus_turned(c_3.inner[1], c_3.inner[5], t_2.two);
    metal::float3 _e13 = minus_turned(c_3.inner[2], c_3.inner[4], t_2.one);
    metal::float3 _e18 = plus_turned(c_3.inner[2], c_3.inner[4], t_2.one);
    metal::float3 _e22 = plus_turned(c_3.inner[1], c_3.inner[5], t_2.two);
    metal::float3 _e26 = plus_turned(c_3.inner[0], c_3.inner[6], t_2.three);
    return type_12 {{_e5, _e9, _e13, c_3.inner[3], _e18, _e22, _e26}};
}

type_10 exchanged_1_(
    type_10 c_4
) {
    return type_10 {{-(c_4.inner[1]), -(c_4.inner[0]), c_4.inner[2]}};
}

type_11 exchanged_2_(
    type_11 c_5
) {
    return type_11 {{-(c_5.inner[3]), c_5.inner[1], -(((c_5.inner[2] * 0.5) + (c_5.inner[4] * 0.8660254))), -(c_5.inner[0]), (c_5.inner[4] * 0.5) - (c_5.inner[2] * 0.8660254)}};
}

type_12 exchanged_3_(
    type_12 c_6
) {
    return type_12 {{(c_6.inner[3] * 0.7905694) - (c_6.inner[5] * 0.61237246), c_6.inner[1], (c_6.inner[3] * 0.61237246) + (c_6.inner[5] * 0.7905694), (c_6.inner[0] * 0.7905694) + (c_6.inner[2] * 0.61237246), -(((c_6.inner[4] * 0.25) + (c_6.inner[6] * 0.96824586))), (c_6.inner[2] * 0.7905694) - (c_6.inner[0] * 0.61237246), (c_6.inner[6] * 0.25) - (c_6.inner[4] * 0.96824586)}};
}

type_10 sh_turned_1_(
    type_10 c_7,
    ShRotation r
) {
    type_10 _e3 = about_z_1_(c_7, r.gamma);
    type_10 _e4 = exchanged_1_(_e3);
    type_10 _e6 = about_z_1_(_e4, r.beta);
    type_10 _e7 = exchanged_1_(_e6);
    type_10 _e9 = about_z_1_(_e7, r.alpha);
    return _e9;
}

type_11 sh_turned_2_(
    type_11 c_8,
    ShRotation r_1
) {
    type_11 _e3 = about_z_2_(c_8, r_1.gamma);
    type_11 _e4 = exchanged_2_(_e3);
    type_11 _e6 = about_z_2_(_e4, r_1.beta);
    type_11 _e7 = exchanged_2_(_e6);
    type_11 _e9 = about_z_2_(_e7, r_1.alpha);
    return _e9;
}

type_12 sh_turned_3_(
    type_12 c_9,
    ShRotation r_2
) {
    type_12 _e3 = about_z_3_(c_9, r_2.gamma);
    type_12 _e4 = exchanged_3_(_e3);
    type_12 _e6 = about_z_3_(_e4, r_2.beta);
    type_12 _e7 = exchanged_3_(_e6);
    type_12 _e9 = about_z_3_(_e7, r_2.alpha);
    return _e9;
}

Blend gathered(
    uint i,
    constant Params& params,
    device type_13 const& joints,
    device type_16 const& indices,
    device type_17 const& weights,
    constant _mslBufferSizes& _buffer_sizes
) {
    Blend blend_7 = {};
    uint k_2 = 0u;
    Blend _e1 = empty_blend();
    blend_7 = _e1;
    bool loop_init_2 = true;
    while(true) {
        if (!loop_init_2) {
            uint _e72 = k_2;
            k_2 = _e72 + 1u;
        }
        loop_init_2 = false;
        uint _e5 = k_2;
        uint _e8 = params.influence_sets;
        if (_e5 < _e8) {
        } else {
            break;
        }
        {
            uint _e13 = params.influence_sets;
            uint _e15 = k_2;
            metal::uint4 joint = indices[(i * _e13) + _e15];
            uint _e22 = params.influence_sets;
            uint _e24 = k_2;
            metal::float4 weight_2 = weights[(i * _e22) + _e24];
            metal::float4 _e32 = joints[joint.x].rotation;
            metal::float3 _e37 = joints[joint.x].translation;
            take(blend_7, _e32, _e37, weight_2.x);
            metal::float4 _e43 = joints[joint.y].rotation;
            metal::float3 _e48 = joints[joint.y].translation;
            take(blend_7, _e43, _e48, weight_2.y);
            metal::float4 _e54 = joints[joint.z].rotation;
            metal::float3 _e59 = joints[joint.z].translation;
            take(blend_7, _e54, _e59, weight_2.z);
            metal::float4 _e65 = joints[joint.w].rotation;
            metal::float3 _e70 = joints[joint.w].translation;
            take(blend_7, _e65, _e70, weight_2.w);
        }
    }
    Blend _e75 = blend_7;
    return _e75;
}

Blend gathered_two(
    uint i_1,
    constant Params& params,
    device type_13 const& joints,
    device type_16 const& indices,
    device type_17 const& weights,
    constant _mslBufferSizes& _buffer_sizes
) {
    Blend blend_8 = {};
    Blend _e1 = empty_blend();
    blend_8 = _e1;
    uint _e6 = params.influence_sets;
    metal::uint4 _e9 = indices[i_1 * _e6];
    metal::uint2 joint_1 = _e9.xy;
    uint _e14 = params.influence_sets;
    metal::float4 _e17 = weights[i_1 * _e14];
    metal::float2 weight_3 = _e17.xy;
    metal::float4 _e23 = joints[joint_1.x].rotation;
    metal::float3 _e28 = joints[joint_1.x].translation;
    take(blend_8, _e23, _e28, weight_3.x);
    metal::float4 _e34 = joints[joint_1.y].rotation;
    metal::float3 _e39 = joints[joint_1.y].translation;
    take(blend_8, _e34, _e39, weight_3.y);
    Blend _e41 = blend_8;
    return _e41;
}

Sum summed(
    uint i_2,
    Blend blend_9,
    constant Params& params,
    device type_13 const& joints,
    device type_16 const& indices,
    device type_17 const& weights,
    constant _mslBufferSizes& _buffer_sizes
) {
    Sum sum_3 = Sum {metal::float4(0.0), metal::float4(0.0)};
    uint k_3 = 0u;
    bool loop_init_3 = true;
    while(true) {
        if (!loop_init_3) {
            uint _e81 = k_3;
            k_3 = _e81 + 1u;
        }
        loop_init_3 = false;
        uint _e10 = k_3;
        uint _e13 = params.influence_sets;
        if (_e10 < _e13) {
        } else {
            break;
        }
        {
            uint _e18 = params.influence_sets;
            uint _e20 = k_3;
            metal::uint4 joint_2 = indices[(i_2 * _e18) + _e20];
            uint _e27 = params.influence_sets;
            uint _e29 = k_3;
            metal::float4 weight_4 = weights[(i_2 * _e27) + _e29];
            metal::float4 _e37 = joints[joint_2.x].rotation;
            metal::float3 _e42 = joints[joint_2.x].translation;
            take_aligned(sum_3, _e37, _e42, weight_4.x, blend_9.heaviest);
            metal::float4 _e49 = joints[joint_2.y].rotation;
            metal::float3 _e54 = joints[joint_2.y].translation;
            take_aligned(sum_3, _e49, _e54, weight_4.y, blend_9.heaviest);
            metal::float4 _e61 = joints[joint_2.z].rotation;
            metal::float3 _e66 = joints[joint_2.z].translation;
            take_aligned(sum_3, _e61, _e66, weight_4.z, blend_9.heaviest);
            metal::float4 _e73 = joints[joint_2.w].rotation;
            metal::float3 _e78 = joints[joint_2.w].translation;
            take_aligned(sum_3, _e73, _e78, weight_4.w, blend_9.heaviest);
        }
    }
    Sum _e84 = sum_3;
    return _e84;
}

void write_motion(
    uint i_3,
    metal::float3 mean,
    metal::float4 relative,
    constant Params& params,
    device type_17& means,
    device type_17& relatives,
    device type_17& views,
    constant _mslBufferSizes& _buffer_sizes
) {
    means[i_3] = metal::float4(mean, 1.0);
    relatives[i_3] = relative;
    metal::float3 _e11 = params.camera;
    metal::float3 view = mean - _e11;
    float distance = metal::length(view);
    metal::float3 unit = (distance == 0.0) ? metal::float3(0.0, 0.0, 1.0) : (view / metal::float3(distance));
    metal::float4 _e25 = conjugate(relative);
    metal::float3 _e26 = rotate(_e25, unit);
    views[i_3] = metal::float4(_e26, 0.0);
    return;
}

void write_covariance(
    uint i_4,
    metal::float3 mean_1,
    metal::float4 relative_1,
    constant Params& params,
    device type_14 const& gaussians,
    device type_17& means,
    device type_18& covariances,
    device type_17& relatives,
    device type_17& views,
    constant _mslBufferSizes& _buffer_sizes
) {
    write_motion(i_4, mean_1, relative_1, params, means, relatives, views, _buffer_sizes);
    metal::float4 _e6 = gaussians[i_4].rotation;
    metal::float4 _e7 = multiply(relative_1, _e6);
    metal::float3 _e11 = gaussians[i_4].scale;
    Covariance _e12 = covariance_of(_e7, _e11);
    covariances[6u * i_4] = _e12.first.x;
    covariances[(6u * i_4) + 1u] = _e12.first.y;
    covariances[(6u * i_4) + 2u] = _e12.first.z;
    covariances[(6u * i_4) + 3u] = _e12.second.x;
    covariances[(6u * i_4) + 4u] = _e12.second.y;
    covariances[(6u * i_4) + 5u] = _e12.second.z;
    return;
}

void write_quaternion(
    uint i_5,
    metal::float3 mean_2,
    metal::float4 relative_2,
    constant Params& params,
    device type_14 const& gaussians,
    device type_17& means,
    device type_17& quaternions,
    device type_17& relatives,
    device type_17& views,
    constant _mslBufferSizes& _buffer_sizes
) {
    write_motion(i_5, mean_2, relative_2, params, means, relatives, views, _buffer_sizes);
    metal::float4 _e8 = gaussians[i_5].rotation;
    metal::float4 _e9 = multiply(relative_2, _e8);
    quaternions[i_5] = _e9;
    return;
}

metal::float3 coefficient(
    uint i_6,
    uint k_4,
    constant Params& params,
    device type_18 const& sh,
    constant _mslBufferSizes& _buffer_sizes
) {
    uint _e4 = params.sh_stride;
    uint _e8 = params.sh_coefficient_stride;
    uint at = (i_6 * _e4) + (k_4 * _e8);
    float _e13 = sh[at];
    float _e18 = sh[at + 1u];
    float _e23 = sh[at + 2u];
    return metal::float3(_e13, _e18, _e23);
}

void write_coefficient(
    uint i_7,
    uint k_5,
    metal::float3 c_10,
    constant Params& params,
    device type_18& turned_sh,
    constant _mslBufferSizes& _buffer_sizes
) {
    uint _e5 = params.sh_stride;
    uint _e9 = params.sh_coefficient_stride;
    uint at_1 = (i_7 * _e5) + (k_5 * _e9);
    turned_sh[at_1] = c_10.x;
    turned_sh[at_1 + 1u] = c_10.y;
    turned_sh[at_1 + 2u] = c_10.z;
    return;
}

type_10 band_1_(
    uint i_8,
    constant Params& params,
    device type_18 const& sh,
    constant _mslBufferSizes& _buffer_sizes
) {
    metal::float3 _e2 = coefficient(i_8, 1u, params, sh, _buffer_sizes);
    metal::float3 _e4 = coefficient(i_8, 2u, params, sh, _buffer_sizes);
    metal::float3 _e6 = coefficient(i_8, 3u, params, sh, _buffer_sizes);
    return type_10 {{_e2, _e4, _e6}};
}

type_11 band_2_(
    uint i_9,
    constant Params& params,
    device type_18 const& sh,
    constant _mslBufferSizes& _buffer_sizes
) {
    metal::float3 _e2 = coefficient(i_9, 4u, params, sh, _buffer_sizes);
    metal::float3 _e4 = coefficient(i_9, 5u, params, sh, _buffer_sizes);
    metal::float3 _e6 = coefficient(i_9, 6u, params, sh, _buffer_sizes);
    metal::float3 _e8 = coefficient(i_9, 7u, params, sh, _buffer_sizes);
    metal::float3 _e10 = coefficient(i_9, 8u, params, sh, _buffer_sizes);
    return type_11 {{_e2, _e4, _e6, _e8, _e10}};
}

type_12 band_3_(
    uint i_10,
    constant Params& params,
    device type_18 const& sh,
    constant _mslBufferSizes& _buffer_sizes
) {
    metal::float3 _e2 = coefficient(i_10, 9u, params, sh, _buffer_sizes);
    metal::float3 _e4 = coefficient(i_10, 10u, params, sh, _buffer_sizes);
    metal::float3 _e6 = coefficient(i_10, 11u, params, sh, _buffer_sizes);
    metal::float3 _e8 = coefficient(i_10, 12u, params, sh, _buffer_sizes);
    metal::float3 _e10 = coefficient(i_10, 13u, params, sh, _buffer_sizes);
    metal::float3 _e12 = coefficient(i_10, 14u, params, sh, _buffer_sizes);
    metal::float3 _e14 = coefficient(i_10, 15u, params, sh, _buffer_sizes);
    return type_12 {{_e2, _e4, _e6, _e8, _e10, _e12, _e14}};
}

struct two_bones_covarianceInput {
};
kernel void two_bones_covariance(
  metal::uint3 id [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_18& covariances [[buffer(6)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id.x < _e4) {
        uint _e8 = params.first;
        uint i_11 = _e8 + id.x;
        Blend _e11 = gathered_two(i_11, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_11].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        metal::float4 _e17 = closed_form_of_two(_e11);
        write_covariance(i_11, _e16, _e17, params, gaussians, means, covariances, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct two_bones_quaternionInput {
};
kernel void two_bones_quaternion(
  metal::uint3 id_1 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_17& quaternions [[buffer(7)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_1.x < _e4) {
        uint _e8 = params.first;
        uint i_12 = _e8 + id_1.x;
        Blend _e11 = gathered_two(i_12, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_12].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        metal::float4 _e17 = closed_form_of_two(_e11);
        write_quaternion(i_12, _e16, _e17, params, gaussians, means, quaternions, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct closed_form_covarianceInput {
};
kernel void closed_form_covariance(
  metal::uint3 id_2 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_18& covariances [[buffer(6)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_2.x < _e4) {
        uint _e8 = params.first;
        uint i_13 = _e8 + id_2.x;
        Blend _e11 = gathered(i_13, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_13].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        metal::float4 _e17 = closed_form(_e11);
        write_covariance(i_13, _e16, _e17, params, gaussians, means, covariances, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct closed_form_quaternionInput {
};
kernel void closed_form_quaternion(
  metal::uint3 id_3 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_17& quaternions [[buffer(7)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_3.x < _e4) {
        uint _e8 = params.first;
        uint i_14 = _e8 + id_3.x;
        Blend _e11 = gathered(i_14, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_14].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        metal::float4 _e17 = closed_form(_e11);
        write_quaternion(i_14, _e16, _e17, params, gaussians, means, quaternions, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct power_covarianceInput {
};
kernel void power_covariance(
  metal::uint3 id_4 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_18& covariances [[buffer(6)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_4.x < _e4) {
        uint _e8 = params.first;
        uint i_15 = _e8 + id_4.x;
        Blend _e11 = gathered(i_15, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_15].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        uint _e19 = params.power_steps;
        metal::float4 _e20 = power_steps(_e11, _e19);
        write_covariance(i_15, _e16, _e20, params, gaussians, means, covariances, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct power_quaternionInput {
};
kernel void power_quaternion(
  metal::uint3 id_5 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_17& quaternions [[buffer(7)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_5.x < _e4) {
        uint _e8 = params.first;
        uint i_16 = _e8 + id_5.x;
        Blend _e11 = gathered(i_16, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_16].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        uint _e19 = params.power_steps;
        metal::float4 _e20 = power_steps(_e11, _e19);
        write_quaternion(i_16, _e16, _e20, params, gaussians, means, quaternions, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct aligned_sum_covarianceInput {
};
kernel void aligned_sum_covariance(
  metal::uint3 id_6 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_18& covariances [[buffer(6)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_6.x < _e4) {
        uint _e8 = params.first;
        uint i_17 = _e8 + id_6.x;
        Blend _e11 = gathered(i_17, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_17].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        Sum _e17 = summed(i_17, _e11, params, joints, indices, weights, _buffer_sizes);
        metal::float4 _e18 = aligned_sum(_e11, _e17);
        write_covariance(i_17, _e16, _e18, params, gaussians, means, covariances, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct aligned_sum_quaternionInput {
};
kernel void aligned_sum_quaternion(
  metal::uint3 id_7 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_17& quaternions [[buffer(7)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_7.x < _e4) {
        uint _e8 = params.first;
        uint i_18 = _e8 + id_7.x;
        Blend _e11 = gathered(i_18, params, joints, indices, weights, _buffer_sizes);
        metal::float3 _e15 = gaussians[i_18].mean;
        metal::float3 _e16 = blended_mean(_e11, _e15);
        Sum _e17 = summed(i_18, _e11, params, joints, indices, weights, _buffer_sizes);
        metal::float4 _e18 = aligned_sum(_e11, _e17);
        write_quaternion(i_18, _e16, _e18, params, gaussians, means, quaternions, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct dual_quaternion_covarianceInput {
};
kernel void dual_quaternion_covariance(
  metal::uint3 id_8 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_18& covariances [[buffer(6)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_8.x < _e4) {
        uint _e8 = params.first;
        uint i_19 = _e8 + id_8.x;
        Blend _e11 = gathered(i_19, params, joints, indices, weights, _buffer_sizes);
        Sum _e12 = summed(i_19, _e11, params, joints, indices, weights, _buffer_sizes);
        Motion _e13 = dual_quaternion(_e11, _e12);
        metal::float3 _e18 = gaussians[i_19].mean;
        metal::float3 _e19 = rotate(_e13.rotation, _e18);
        write_covariance(i_19, _e19 + _e13.translation, _e13.rotation, params, gaussians, means, covariances, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct dual_quaternion_quaternionInput {
};
kernel void dual_quaternion_quaternion(
  metal::uint3 id_9 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_13 const& joints [[buffer(1)]]
, device type_14 const& gaussians [[buffer(2)]]
, device type_16 const& indices [[buffer(3)]]
, device type_17 const& weights [[buffer(4)]]
, device type_17& means [[buffer(5)]]
, device type_17& quaternions [[buffer(7)]]
, device type_17& relatives [[buffer(8)]]
, device type_17& views [[buffer(9)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_9.x < _e4) {
        uint _e8 = params.first;
        uint i_20 = _e8 + id_9.x;
        Blend _e11 = gathered(i_20, params, joints, indices, weights, _buffer_sizes);
        Sum _e12 = summed(i_20, _e11, params, joints, indices, weights, _buffer_sizes);
        Motion _e13 = dual_quaternion(_e11, _e12);
        metal::float3 _e18 = gaussians[i_20].mean;
        metal::float3 _e19 = rotate(_e13.rotation, _e18);
        write_quaternion(i_20, _e19 + _e13.translation, _e13.rotation, params, gaussians, means, quaternions, relatives, views, _buffer_sizes);
        return;
    } else {
        return;
    }
}


struct colourInput {
};
kernel void colour(
  metal::uint3 id_10 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_17 const& views [[buffer(9)]]
, device type_18 const& sh [[buffer(10)]]
, device type_17& colours [[buffer(12)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    metal::float3 rgb = {};
    uint _e4 = params.count;
    if (id_10.x >= _e4) {
        return;
    }
    uint _e8 = params.first;
    uint i_21 = _e8 + id_10.x;
    metal::float4 _e13 = views[i_21];
    metal::float3 d_5 = _e13.xyz;
    metal::float3 _e19 = coefficient(i_21, 0u, params, sh, _buffer_sizes);
    rgb = metal::float3(0.5) + (C0_ * _e19);
    uint _e25 = params.sh_degree;
    if (_e25 >= 1u) {
        type_10 _e28 = band_1_(i_21, params, sh, _buffer_sizes);
        metal::float3 _e29 = rgb;
        metal::float3 _e33 = sh_degree_1_(d_5, _e28.inner[0], _e28.inner[1], _e28.inner[2]);
        rgb = _e29 + _e33;
    }
    uint _e37 = params.sh_degree;
    if (_e37 >= 2u) {
        type_11 _e40 = band_2_(i_21, params, sh, _buffer_sizes);
        type_8 _e41 = basis_2_(d_5);
        metal::float3 _e42 = rgb;
        rgb = _e42 + (((((_e41.inner[0] * _e40.inner[0]) + (_e41.inner[1] * _e40.inner[1])) + (_e41.inner[2] * _e40.inner[2])) + (_e41.inner[3] * _e40.inner[3])) + (_e41.inner[4] * _e40.inner[4]));
    }
    uint _e65 = params.sh_degree;
    if (_e65 >= 3u) {
        type_12 _e68 = band_3_(i_21, params, sh, _buffer_sizes);
        type_9 _e69 = basis_3_(d_5);
        metal::float3 _e70 = rgb;
        rgb = _e70 + (((((((_e69.inner[0] * _e68.inner[0]) + (_e69.inner[1] * _e68.inner[1])) + (_e69.inner[2] * _e68.inner[2])) + (_e69.inner[3] * _e68.inner[3])) + (_e69.inner[4] * _e68.inner[4])) + (_e69.inner[5] * _e68.inner[5])) + (_e69.inner[6] * _e68.inner[6]));
    }
    metal::float3 _e101 = rgb;
    colours[i_21] = metal::float4(metal::max(_e101, metal::float3(0.0)), 1.0);
    return;
}


struct turn_shInput {
};
kernel void turn_sh(
  metal::uint3 id_11 [[thread_position_in_grid]]
, constant Params& params [[buffer(0)]]
, device type_17 const& relatives [[buffer(8)]]
, device type_18 const& sh [[buffer(10)]]
, device type_18& turned_sh [[buffer(11)]]
, constant _mslBufferSizes& _buffer_sizes [[buffer(13)]]
) {
    uint _e4 = params.count;
    if (id_11.x >= _e4) {
        return;
    }
    uint _e8 = params.first;
    uint i_22 = _e8 + id_11.x;
    metal::float4 _e13 = relatives[i_22];
    ShRotation _e14 = sh_rotation(_e13);
    metal::float3 _e17 = coefficient(i_22, 0u, params, sh, _buffer_sizes);
    write_coefficient(i_22, 0u, _e17, params, turned_sh, _buffer_sizes);
    uint _e20 = params.sh_degree;
    if (_e20 >= 1u) {
        type_10 _e23 = band_1_(i_22, params, sh, _buffer_sizes);
        type_10 _e24 = sh_turned_1_(_e23, _e14);
        write_coefficient(i_22, 1u, _e24.inner[0], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 2u, _e24.inner[1], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 3u, _e24.inner[2], params, turned_sh, _buffer_sizes);
    }
    uint _e33 = params.sh_degree;
    if (_e33 >= 2u) {
        type_11 _e36 = band_2_(i_22, params, sh, _buffer_sizes);
        type_11 _e37 = sh_turned_2_(_e36, _e14);
        write_coefficient(i_22, 4u, _e37.inner[0], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 5u, _e37.inner[1], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 6u, _e37.inner[2], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 7u, _e37.inner[3], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 8u, _e37.inner[4], params, turned_sh, _buffer_sizes);
    }
    uint _e50 = params.sh_degree;
    if (_e50 >= 3u) {
        type_12 _e53 = band_3_(i_22, params, sh, _buffer_sizes);
        type_12 _e54 = sh_turned_3_(_e53, _e14);
        write_coefficient(i_22, 9u, _e54.inner[0], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 10u, _e54.inner[1], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 11u, _e54.inner[2], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 12u, _e54.inner[3], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 13u, _e54.inner[4], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 14u, _e54.inner[5], params, turned_sh, _buffer_sizes);
        write_coefficient(i_22, 15u, _e54.inner[6], params, turned_sh, _buffer_sizes);
        return;
    } else {
        return;
    }
}
