// Made from shaders/skinning.wgsl by naga: edit that. MIT OR Apache-2.0.
struct Params {
    uint count;
    uint first;
    uint influence_sets;
    uint power_steps;
    float3 camera;
    uint sh_degree;
    uint sh_stride;
    uint sh_coefficient_stride;
    uint unused_0_;
    uint unused_1_;
};

struct Joint {
    float4 rotation;
    float3 translation;
    int _end_pad_0;
};

struct Gaussian {
    float3 mean;
    int _pad1_0;
    float4 rotation;
    float3 scale;
    int _end_pad_0;
};

struct Symmetric {
    float4 diagonal;
    float3 between;
    int _pad2_0;
    float3 beside_w;
    int _end_pad_0;
};

struct Blend {
    Symmetric outer;
    float3 translation;
    float weight;
    float4 heaviest;
    float heaviest_weight;
    int _pad5_0;
    int _pad5_1;
    int _pad5_2;
    float4 earlier;
    float earlier_weight;
    int _pad7_0;
    int _pad7_1;
    int _pad7_2;
    float4 latest;
    float latest_weight;
    uint bones;
    int _end_pad_0;
    int _end_pad_1;
};

struct Sum {
    float4 real;
    float4 dual;
};

struct Motion {
    float4 rotation;
    float3 translation;
    int _end_pad_0;
};

struct Covariance {
    float3 first;
    int _pad1_0;
    float3 second;
    int _end_pad_0;
};

struct Turn {
    float2 one;
    float2 two;
    float2 three;
};

struct ShRotation {
    Turn gamma;
    Turn beta;
    Turn alpha;
};

static const float EPSILON = 1.1920929e-7;
static const float4 IDENTITY = float4(0.0, 0.0, 0.0, 1.0);
static const float RANK_ONE = 0.0002;
static const uint SQUARINGS = 18u;
static const float C0_ = 0.2820948;
static const float C1_ = 0.48860252;

cbuffer params : register(b0) { Params params; }
ByteAddressBuffer joints : register(t1);
ByteAddressBuffer gaussians : register(t2);
ByteAddressBuffer indices_ : register(t3);
ByteAddressBuffer weights : register(t4);
RWByteAddressBuffer means : register(u5);
RWByteAddressBuffer covariances : register(u6);
RWByteAddressBuffer quaternions : register(u7);
RWByteAddressBuffer relatives : register(u8);
RWByteAddressBuffer views : register(u9);
ByteAddressBuffer sh : register(t0, space1);
RWByteAddressBuffer turned_sh : register(u1, space1);
RWByteAddressBuffer colours : register(u2, space1);

float4 multiply(float4 a, float4 b)
{
    return float4((((a.w * b.xyz) + (b.w * a.xyz)) + cross(a.xyz, b.xyz)), ((a.w * b.w) - dot(a.xyz, b.xyz)));
}

float4 conjugate(float4 q)
{
    return float4(-(q.xyz), q.w);
}

float3 rotate(float4 q_1, float3 v)
{
    float3 t_3 = (2.0 * cross(q_1.xyz, v));
    return ((v + (q_1.w * t_3)) + cross(q_1.xyz, t_3));
}

float largest_magnitude(float4 v_1)
{
    float4 m = abs(v_1);
    return max(max(m.x, m.y), max(m.z, m.w));
}

float4 normalized_or(float4 q_2, float4 otherwise)
{
    const float _e2 = largest_magnitude(q_2);
    if (!((_e2 > 0.0))) {
        return otherwise;
    }
    float4 scaled_1 = (q_2 / (_e2).xxxx);
    return (scaled_1 / (sqrt(dot(scaled_1, scaled_1))).xxxx);
}

bool is_opposite(float4 q_3, float4 reference)
{
    float largest = (float)0;

    float cosine = dot(q_3, reference);
    if ((abs(cosine) > 1.9073486e-6)) {
        return (cosine < 0.0);
    }
    const float4 _e8 = conjugate(reference);
    const float4 _e9 = multiply(_e8, q_3);
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

Symmetric ConstructSymmetric(float4 arg0, float3 arg1, float3 arg2) {
    Symmetric ret = (Symmetric)0;
    ret.diagonal = arg0;
    ret.between = arg1;
    ret.beside_w = arg2;
    return ret;
}

Blend ConstructBlend(Symmetric arg0, float3 arg1, float arg2, float4 arg3, float arg4, float4 arg5, float arg6, float4 arg7, float arg8, uint arg9) {
    Blend ret = (Blend)0;
    ret.outer = arg0;
    ret.translation = arg1;
    ret.weight = arg2;
    ret.heaviest = arg3;
    ret.heaviest_weight = arg4;
    ret.earlier = arg5;
    ret.earlier_weight = arg6;
    ret.latest = arg7;
    ret.latest_weight = arg8;
    ret.bones = arg9;
    return ret;
}

Blend empty_blend()
{
    float3 zero = (0.0).xxx;
    const Blend blend_10 = ConstructBlend(ConstructSymmetric((0.0).xxxx, zero, zero), zero, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, IDENTITY, 0.0, 0u);
    return blend_10;
}

void take(inout Blend blend, float4 rotation, float3 translation, float weight)
{
    if (!((weight > 0.0))) {
        return;
    }
    float4 weighted = (weight * rotation);
    float4 _e10 = blend.outer.diagonal;
    blend.outer.diagonal = (_e10 + (weighted * rotation));
    float3 _e15 = blend.outer.between;
    blend.outer.between = (_e15 + (weighted.xxy * rotation.yzz));
    float3 _e22 = blend.outer.beside_w;
    blend.outer.beside_w = (_e22 + (weighted.xyz * rotation.w));
    float3 _e28 = blend.translation;
    blend.translation = (_e28 + (weight * translation));
    float _e32 = blend.weight;
    blend.weight = (_e32 + weight);
    float _e35 = blend.heaviest_weight;
    if ((weight > _e35)) {
        blend.heaviest = rotation;
        blend.heaviest_weight = weight;
    }
    float4 _e41 = blend.latest;
    blend.earlier = _e41;
    float _e44 = blend.latest_weight;
    blend.earlier_weight = _e44;
    blend.latest = rotation;
    blend.latest_weight = weight;
    uint _e48 = blend.bones;
    blend.bones = (_e48 + 1u);
    return;
}

float3 blended_mean(Blend blend_1, float3 p)
{
    if ((blend_1.bones == 0u)) {
        return p;
    }
    float4 d_3 = blend_1.outer.diagonal;
    float3 even = (2.0 * blend_1.outer.between);
    float3 odd = (2.0 * blend_1.outer.beside_w);
    float x = (((((d_3.w - d_3.z) + (d_3.x - d_3.y)) * p.x) + ((even.x - odd.z) * p.y)) + ((even.y + odd.y) * p.z));
    float y = ((((even.x + odd.z) * p.x) + (((d_3.w - d_3.z) - (d_3.x - d_3.y)) * p.y)) + ((even.z - odd.x) * p.z));
    float z = ((((even.y - odd.y) * p.x) + ((even.z + odd.x) * p.y)) + (((d_3.w + d_3.z) - (d_3.x + d_3.y)) * p.z));
    return ((float3(x, y, z) + blend_1.translation) / (blend_1.weight).xxx);
}

float trace(Symmetric a_1)
{
    return ((a_1.diagonal.x + a_1.diagonal.y) + (a_1.diagonal.z + a_1.diagonal.w));
}

Symmetric scaled(Symmetric a_2, float factor)
{
    const Symmetric symmetric = ConstructSymmetric((a_2.diagonal * factor), (a_2.between * factor), (a_2.beside_w * factor));
    return symmetric;
}

float4 applied(Symmetric a_3, float4 v_2)
{
    float3 b_3 = a_3.between;
    float3 w = a_3.beside_w;
    return ((a_3.diagonal * v_2) + float4((((b_3.x * v_2.y) + (b_3.y * v_2.z)) + (w.x * v_2.w)), (((b_3.x * v_2.x) + (b_3.z * v_2.z)) + (w.y * v_2.w)), (((b_3.y * v_2.x) + (b_3.z * v_2.y)) + (w.z * v_2.w)), (((w.x * v_2.x) + (w.y * v_2.y)) + (w.z * v_2.z))));
}

Symmetric squared(Symmetric a_4)
{
    float4 d_4 = a_4.diagonal;
    float3 b_4 = a_4.between;
    float3 w_1 = a_4.beside_w;
    float3 bb = (b_4 * b_4);
    float3 ww = (w_1 * w_1);
    const Symmetric symmetric_1 = ConstructSymmetric(((d_4 * d_4) + float4(((bb.x + bb.y) + ww.x), ((bb.x + bb.z) + ww.y), ((bb.y + bb.z) + ww.z), ((ww.x + ww.y) + ww.z))), ((b_4 * (d_4.xxy + d_4.yzz)) + float3(((b_4.y * b_4.z) + (w_1.x * w_1.y)), ((b_4.x * b_4.z) + (w_1.x * w_1.z)), ((b_4.x * b_4.y) + (w_1.y * w_1.z)))), ((w_1 * (d_4.xyz + d_4.www)) + float3(((b_4.x * w_1.y) + (b_4.y * w_1.z)), ((b_4.x * w_1.x) + (b_4.z * w_1.z)), ((b_4.y * w_1.x) + (b_4.z * w_1.y)))));
    return symmetric_1;
}

float4 largest_column(Symmetric a_5)
{
    float4 column = (float4)0;
    float best = (float)0;

    float3 b_5 = a_5.between;
    float3 w_2 = a_5.beside_w;
    column = float4(a_5.diagonal.x, b_5.x, b_5.y, w_2.x);
    best = a_5.diagonal.x;
    float _e15 = best;
    if ((a_5.diagonal.y > _e15)) {
        column = float4(b_5.x, a_5.diagonal.y, b_5.z, w_2.y);
        best = a_5.diagonal.y;
    }
    float _e27 = best;
    if ((a_5.diagonal.z > _e27)) {
        column = float4(b_5.y, b_5.z, a_5.diagonal.z, w_2.z);
        best = a_5.diagonal.z;
    }
    float _e39 = best;
    if ((a_5.diagonal.w > _e39)) {
        column = float4(w_2.x, w_2.y, w_2.z, a_5.diagonal.w);
    }
    float4 _e47 = column;
    return _e47;
}

float4 average_of_two(float4 p_1, float u, float4 q_4, float v_3)
{
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
    const float4 _e43 = normalized_or((((even_1 + odd_1) * p_1) + (of_q * q_4)), p_1);
    return _e43;
}

float4 beside(Symmetric plane, float4 u_1)
{
    float4 best_1 = (float4)0;

    float3 b_6 = plane.between;
    float3 w_3 = plane.beside_w;
    float4 x_1 = float4(plane.diagonal.x, b_6.x, b_6.y, w_3.x);
    float4 y_1 = float4(b_6.x, plane.diagonal.y, b_6.z, w_3.y);
    float4 z_1 = float4(b_6.y, b_6.z, plane.diagonal.z, w_3.z);
    float4 last = float4(w_3.x, w_3.y, w_3.z, plane.diagonal.w);
    float4 off_y = (y_1 - (dot(y_1, u_1) * u_1));
    float4 off_z = (z_1 - (dot(z_1, u_1) * u_1));
    float4 off_w = (last - (dot(last, u_1) * u_1));
    best_1 = (x_1 - (dot(x_1, u_1) * u_1));
    float4 _e42 = best_1;
    float4 _e43 = best_1;
    if ((dot(off_y, off_y) > dot(_e42, _e43))) {
        best_1 = off_y;
    }
    float4 _e47 = best_1;
    float4 _e48 = best_1;
    if ((dot(off_z, off_z) > dot(_e47, _e48))) {
        best_1 = off_z;
    }
    float4 _e52 = best_1;
    float4 _e53 = best_1;
    if ((dot(off_w, off_w) > dot(_e52, _e53))) {
        best_1 = off_w;
    }
    float4 _e56 = best_1;
    const float4 _e59 = normalized_or(_e56, (0.0).xxxx);
    const float4 _e65 = normalized_or((_e59 - (dot(_e59, u_1) * u_1)), (0.0).xxxx);
    return _e65;
}

float4 leading_in_plane(Symmetric a_6, Symmetric plane_1, float4 heaviest)
{
    const float4 _e3 = applied(plane_1, heaviest);
    const float4 _e4 = normalized_or(_e3, heaviest);
    const float4 _e5 = beside(plane_1, _e4);
    const float4 _e6 = applied(a_6, _e5);
    const float4 _e7 = applied(a_6, _e4);
    float uu = dot(_e4, _e7);
    float vv = dot(_e5, _e6);
    float half_ = (0.5 * (uu - vv));
    float across = dot(_e4, _e6);
    float rho_1 = sqrt(((half_ * half_) + (across * across)));
    if (!(((2.0 * rho_1) > (1.9073486e-6 * ((0.5 * (uu + vv)) + rho_1))))) {
        return _e4;
    }
    if ((half_ >= 0.0)) {
        const float4 _e34 = normalized_or((((rho_1 + half_) * _e4) + (across * _e5)), _e4);
        return _e34;
    }
    const float4 _e39 = normalized_or(((across * _e4) + ((rho_1 - half_) * _e5)), _e4);
    return _e39;
}

float4 average_of_many(Symmetric outer, float4 heaviest_1)
{
    Symmetric power = (Symmetric)0;
    uint k = 0u;

    const float _e2 = trace(outer);
    const Symmetric _e5 = scaled(outer, (1.0 / _e2));
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
            const Symmetric _e13 = squared(_e12);
            const float _e14 = trace(_e13);
            const Symmetric _e17 = scaled(_e13, (1.0 / _e14));
            power = _e17;
            if ((abs((1.0 - _e14)) <= RANK_ONE)) {
                Symmetric _e23 = power;
                const float4 _e24 = largest_column(_e23);
                const float4 _e25 = normalized_or(_e24, heaviest_1);
                return _e25;
            }
        }
    }
    Symmetric _e29 = power;
    const float4 _e30 = leading_in_plane(_e5, _e29, heaviest_1);
    return _e30;
}

float4 closed_form_of_two(Blend blend_2)
{
    if ((blend_2.bones < 2u)) {
        return blend_2.heaviest;
    }
    const float4 _e9 = average_of_two(blend_2.earlier, blend_2.earlier_weight, blend_2.latest, blend_2.latest_weight);
    return _e9;
}

float4 closed_form(Blend blend_3)
{
    if ((blend_3.bones <= 2u)) {
        const float4 _e4 = closed_form_of_two(blend_3);
        return _e4;
    }
    const float4 _e7 = average_of_many(blend_3.outer, blend_3.heaviest);
    return _e7;
}

float4 power_steps(Blend blend_4, uint steps)
{
    float4 v_4 = (float4)0;
    uint k_1 = 0u;

    if ((blend_4.bones < 2u)) {
        return blend_4.heaviest;
    }
    const Symmetric _e10 = scaled(blend_4.outer, (1.0 / blend_4.weight));
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
            float4 _e17 = v_4;
            const float4 _e18 = applied(_e10, _e17);
            v_4 = (_e18 / (sqrt(dot(_e18, _e18))).xxxx);
        }
    }
    float4 _e26 = v_4;
    return _e26;
}

void take_aligned(inout Sum sum, float4 rotation_1, float3 translation_1, float weight_1, float4 reference_1)
{
    if (!((weight_1 > 0.0))) {
        return;
    }
    const bool _e9 = is_opposite(rotation_1, reference_1);
    float signed_ = (_e9 ? -(weight_1) : weight_1);
    float4 _e12 = sum.real;
    sum.real = (_e12 + (signed_ * rotation_1));
    float4 _e16 = sum.dual;
    const float4 _e19 = multiply(float4(translation_1, 0.0), rotation_1);
    sum.dual = (_e16 + (signed_ * _e19));
    return;
}

float4 aligned_sum(Blend blend_5, Sum sum_1)
{
    if ((blend_5.bones < 2u)) {
        return blend_5.heaviest;
    }
    const float4 _e8 = normalized_or(sum_1.real, blend_5.heaviest);
    return _e8;
}

Motion ConstructMotion(float4 arg0, float3 arg1) {
    Motion ret = (Motion)0;
    ret.rotation = arg0;
    ret.translation = arg1;
    return ret;
}

Motion dual_quaternion(Blend blend_6, Sum sum_2)
{
    if ((blend_6.bones == 0u)) {
        const Motion motion = ConstructMotion(float4(0.0, 0.0, 0.0, 1.0), (0.0).xxx);
        return motion;
    }
    const float4 _e15 = conjugate(sum_2.real);
    const float4 _e16 = multiply(sum_2.dual, _e15);
    float3 translation_2 = (_e16.xyz / (dot(sum_2.real, sum_2.real)).xxx);
    const float4 _e25 = normalized_or(sum_2.real, blend_6.heaviest);
    const Motion motion_1 = ConstructMotion(_e25, translation_2);
    return motion_1;
}

Covariance ConstructCovariance(float3 arg0, float3 arg1) {
    Covariance ret = (Covariance)0;
    ret.first = arg0;
    ret.second = arg1;
    return ret;
}

Covariance covariance_of(float4 q_5, float3 s)
{
    const float3 _e6 = rotate(q_5, float3(s.x, 0.0, 0.0));
    const float3 _e11 = rotate(q_5, float3(0.0, s.y, 0.0));
    const float3 _e16 = rotate(q_5, float3(0.0, 0.0, s.z));
    float2 second = float2((((_e6.y * _e6.y) + (_e11.y * _e11.y)) + (_e16.y * _e16.y)), (((_e6.y * _e6.z) + (_e11.y * _e11.z)) + (_e16.y * _e16.z)));
    const Covariance covariance = ConstructCovariance((((_e6.x * _e6) + (_e11.x * _e11)) + (_e16.x * _e16)), float3(second, (((_e6.z * _e6.z) + (_e11.z * _e11.z)) + (_e16.z * _e16.z))));
    return covariance;
}

float3 sh_degree_1_(float3 d, float3 a_7, float3 b_1, float3 c)
{
    return (C1_ * (((d.z * b_1) - (d.y * a_7)) - (d.x * c)));
}

typedef float ret_Constructarray5_float_[5];
ret_Constructarray5_float_ Constructarray5_float_(float arg0, float arg1, float arg2, float arg3, float arg4) {
    float ret[5] = { arg0, arg1, arg2, arg3, arg4 };
    return ret;
}

typedef float ret_basis_2_[5];
ret_basis_2_ basis_2_(float3 d_1)
{
    return Constructarray5_float_(((1.0925485 * d_1.x) * d_1.y), ((-1.0925485 * d_1.y) * d_1.z), (0.31539157 * ((((2.0 * d_1.z) * d_1.z) - (d_1.x * d_1.x)) - (d_1.y * d_1.y))), ((-1.0925485 * d_1.x) * d_1.z), (0.54627424 * ((d_1.x * d_1.x) - (d_1.y * d_1.y))));
}

typedef float ret_Constructarray7_float_[7];
ret_Constructarray7_float_ Constructarray7_float_(float arg0, float arg1, float arg2, float arg3, float arg4, float arg5, float arg6) {
    float ret[7] = { arg0, arg1, arg2, arg3, arg4, arg5, arg6 };
    return ret;
}

typedef float ret_basis_3_[7];
ret_basis_3_ basis_3_(float3 d_2)
{
    float xx = (d_2.x * d_2.x);
    float yy = (d_2.y * d_2.y);
    float zz = (d_2.z * d_2.z);
    return Constructarray7_float_(((-0.5900436 * d_2.y) * ((3.0 * xx) - yy)), (((2.8906114 * d_2.x) * d_2.y) * d_2.z), ((-0.4570458 * d_2.y) * (((4.0 * zz) - xx) - yy)), ((0.37317634 * d_2.z) * (((2.0 * zz) - (3.0 * xx)) - (3.0 * yy))), ((-0.4570458 * d_2.x) * (((4.0 * zz) - xx) - yy)), ((1.4453057 * d_2.z) * (xx - yy)), ((-0.5900436 * d_2.x) * (xx - (3.0 * yy))));
}

float2 compose(float2 a_8, float2 b_2)
{
    return float2(((a_8.x * b_2.x) - (a_8.y * b_2.y)), ((a_8.y * b_2.x) + (a_8.x * b_2.y)));
}

Turn ConstructTurn(float2 arg0, float2 arg1, float2 arg2) {
    Turn ret = (Turn)0;
    ret.one = arg0;
    ret.two = arg1;
    ret.three = arg2;
    return ret;
}

Turn multiples(float2 angle)
{
    const float2 _e1 = compose(angle, angle);
    const float2 _e2 = compose(_e1, angle);
    const Turn turn_2 = ConstructTurn(angle, _e1, _e2);
    return turn_2;
}

float2 direction_of(float2 v_5)
{
    float square = dot(v_5, v_5);
    if ((square < 2e-28)) {
        return float2(1.0, 0.0);
    }
    return (v_5 / (sqrt(square)).xx);
}

ShRotation ConstructShRotation(Turn arg0, Turn arg1, Turn arg2) {
    ShRotation ret = (ShRotation)0;
    ret.gamma = arg0;
    ret.beta = arg1;
    ret.alpha = arg2;
    return ret;
}

ShRotation sh_rotation(float4 q_6)
{
    const float2 _e2 = direction_of(q_6.wz);
    const float2 _e7 = direction_of(float2(q_6.y, -(q_6.x)));
    float cos2_ = dot(q_6.wz, q_6.wz);
    float sin2_ = dot(q_6.xy, q_6.xy);
    float2 beta = float2((cos2_ - sin2_), (-2.0 * sqrt((cos2_ * sin2_))));
    const float2 _e24 = compose(_e2, float2(_e7.x, -(_e7.y)));
    const Turn _e25 = multiples(_e24);
    const Turn _e26 = multiples(beta);
    const float2 _e27 = compose(_e2, _e7);
    const Turn _e28 = multiples(_e27);
    const ShRotation shrotation = ConstructShRotation(_e25, _e26, _e28);
    return shrotation;
}

float3 plus_turned(float3 minus, float3 plus, float2 turn)
{
    return ((plus * turn.x) - (minus * turn.y));
}

float3 minus_turned(float3 minus_1, float3 plus_1, float2 turn_1)
{
    return ((plus_1 * turn_1.y) + (minus_1 * turn_1.x));
}

typedef float3 ret_Constructarray3_float3_[3];
ret_Constructarray3_float3_ Constructarray3_float3_(float3 arg0, float3 arg1, float3 arg2) {
    float3 ret[3] = { arg0, arg1, arg2 };
    return ret;
}

typedef float3 ret_about_z_1_[3];
ret_about_z_1_ about_z_1_(float3 c_1[3], Turn t)
{
    const float3 _e5 = minus_turned(c_1[0], c_1[2], t.one);
    const float3 _e10 = plus_turned(c_1[0], c_1[2], t.one);
    return Constructarray3_float3_(_e5, c_1[1], _e10);
}

typedef float3 ret_Constructarray5_float3_[5];
ret_Constructarray5_float3_ Constructarray5_float3_(float3 arg0, float3 arg1, float3 arg2, float3 arg3, float3 arg4) {
    float3 ret[5] = { arg0, arg1, arg2, arg3, arg4 };
    return ret;
}

typedef float3 ret_about_z_2_[5];
ret_about_z_2_ about_z_2_(float3 c_2[5], Turn t_1)
{
    const float3 _e5 = minus_turned(c_2[0], c_2[4], t_1.two);
    const float3 _e9 = minus_turned(c_2[1], c_2[3], t_1.one);
    const float3 _e14 = plus_turned(c_2[1], c_2[3], t_1.one);
    const float3 _e18 = plus_turned(c_2[0], c_2[4], t_1.two);
    return Constructarray5_float3_(_e5, _e9, c_2[2], _e14, _e18);
}

typedef float3 ret_Constructarray7_float3_[7];
ret_Constructarray7_float3_ Constructarray7_float3_(float3 arg0, float3 arg1, float3 arg2, float3 arg3, float3 arg4, float3 arg5, float3 arg6) {
    float3 ret[7] = { arg0, arg1, arg2, arg3, arg4, arg5, arg6 };
    return ret;
}

typedef float3 ret_about_z_3_[7];
ret_about_z_3_ about_z_3_(float3 c_3[7], Turn t_2)
{
    const float3 _e5 = minus_turned(c_3[0], c_3[6], t_2.three);
    const float3 _e9 = minus_turned(c_3[1], c_3[5], t_2.two);
    const float3 _e13 = minus_turned(c_3[2], c_3[4], t_2.one);
    const float3 _e18 = plus_turned(c_3[2], c_3[4], t_2.one);
    const float3 _e22 = plus_turned(c_3[1], c_3[5], t_2.two);
    const float3 _e26 = plus_turned(c_3[0], c_3[6], t_2.three);
    return Constructarray7_float3_(_e5, _e9, _e13, c_3[3], _e18, _e22, _e26);
}

typedef float3 ret_exchanged_1_[3];
ret_exchanged_1_ exchanged_1_(float3 c_4[3])
{
    return Constructarray3_float3_(-(c_4[1]), -(c_4[0]), c_4[2]);
}

typedef float3 ret_exchanged_2_[5];
ret_exchanged_2_ exchanged_2_(float3 c_5[5])
{
    return Constructarray5_float3_(-(c_5[3]), c_5[1], -(((c_5[2] * 0.5) + (c_5[4] * 0.8660254))), -(c_5[0]), ((c_5[4] * 0.5) - (c_5[2] * 0.8660254)));
}

typedef float3 ret_exchanged_3_[7];
ret_exchanged_3_ exchanged_3_(float3 c_6[7])
{
    return Constructarray7_float3_(((c_6[3] * 0.7905694) - (c_6[5] * 0.61237246)), c_6[1], ((c_6[3] * 0.61237246) + (c_6[5] * 0.7905694)), ((c_6[0] * 0.7905694) + (c_6[2] * 0.61237246)), -(((c_6[4] * 0.25) + (c_6[6] * 0.96824586))), ((c_6[2] * 0.7905694) - (c_6[0] * 0.61237246)), ((c_6[6] * 0.25) - (c_6[4] * 0.96824586)));
}

typedef float3 ret_sh_turned_1_[3];
ret_sh_turned_1_ sh_turned_1_(float3 c_7[3], ShRotation r)
{
    const float3 _e3[3] = about_z_1_(c_7, r.gamma);
    const float3 _e4[3] = exchanged_1_(_e3);
    const float3 _e6[3] = about_z_1_(_e4, r.beta);
    const float3 _e7[3] = exchanged_1_(_e6);
    const float3 _e9[3] = about_z_1_(_e7, r.alpha);
    return _e9;
}

typedef float3 ret_sh_turned_2_[5];
ret_sh_turned_2_ sh_turned_2_(float3 c_8[5], ShRotation r_1)
{
    const float3 _e3[5] = about_z_2_(c_8, r_1.gamma);
    const float3 _e4[5] = exchanged_2_(_e3);
    const float3 _e6[5] = about_z_2_(_e4, r_1.beta);
    const float3 _e7[5] = exchanged_2_(_e6);
    const float3 _e9[5] = about_z_2_(_e7, r_1.alpha);
    return _e9;
}

typedef float3 ret_sh_turned_3_[7];
ret_sh_turned_3_ sh_turned_3_(float3 c_9[7], ShRotation r_2)
{
    const float3 _e3[7] = about_z_3_(c_9, r_2.gamma);
    const float3 _e4[7] = exchanged_3_(_e3);
    const float3 _e6[7] = about_z_3_(_e4, r_2.beta);
    const float3 _e7[7] = exchanged_3_(_e6);
    const float3 _e9[7] = about_z_3_(_e7, r_2.alpha);
    return _e9;
}

Blend gathered(uint i)
{
    Blend blend_7 = (Blend)0;
    uint k_2 = 0u;

    const Blend _e1 = empty_blend();
    blend_7 = _e1;
    bool loop_init_2 = true;
    while(true) {
        if (!loop_init_2) {
            uint _e72 = k_2;
            k_2 = (_e72 + 1u);
        }
        loop_init_2 = false;
        uint _e5 = k_2;
        uint _e8 = params.influence_sets;
        if ((_e5 < _e8)) {
        } else {
            break;
        }
        {
            uint _e13 = params.influence_sets;
            uint _e15 = k_2;
            uint4 joint = asuint(indices_.Load4(((i * _e13) + _e15)*16));
            uint _e22 = params.influence_sets;
            uint _e24 = k_2;
            float4 weight_2 = asfloat(weights.Load4(((i * _e22) + _e24)*16));
            float4 _e32 = asfloat(joints.Load4(0+joint.x*32));
            float3 _e37 = asfloat(joints.Load3(16+joint.x*32));
            take(blend_7, _e32, _e37, weight_2.x);
            float4 _e43 = asfloat(joints.Load4(0+joint.y*32));
            float3 _e48 = asfloat(joints.Load3(16+joint.y*32));
            take(blend_7, _e43, _e48, weight_2.y);
            float4 _e54 = asfloat(joints.Load4(0+joint.z*32));
            float3 _e59 = asfloat(joints.Load3(16+joint.z*32));
            take(blend_7, _e54, _e59, weight_2.z);
            float4 _e65 = asfloat(joints.Load4(0+joint.w*32));
            float3 _e70 = asfloat(joints.Load3(16+joint.w*32));
            take(blend_7, _e65, _e70, weight_2.w);
        }
    }
    Blend _e75 = blend_7;
    const Blend blend_11 = _e75;
    return blend_11;
}

Blend gathered_two(uint i_1)
{
    Blend blend_8 = (Blend)0;

    const Blend _e1 = empty_blend();
    blend_8 = _e1;
    uint _e6 = params.influence_sets;
    uint4 _e9 = asuint(indices_.Load4((i_1 * _e6)*16));
    uint2 joint_1 = _e9.xy;
    uint _e14 = params.influence_sets;
    float4 _e17 = asfloat(weights.Load4((i_1 * _e14)*16));
    float2 weight_3 = _e17.xy;
    float4 _e23 = asfloat(joints.Load4(0+joint_1.x*32));
    float3 _e28 = asfloat(joints.Load3(16+joint_1.x*32));
    take(blend_8, _e23, _e28, weight_3.x);
    float4 _e34 = asfloat(joints.Load4(0+joint_1.y*32));
    float3 _e39 = asfloat(joints.Load3(16+joint_1.y*32));
    take(blend_8, _e34, _e39, weight_3.y);
    Blend _e41 = blend_8;
    const Blend blend_12 = _e41;
    return blend_12;
}

Sum ConstructSum(float4 arg0, float4 arg1) {
    Sum ret = (Sum)0;
    ret.real = arg0;
    ret.dual = arg1;
    return ret;
}

Sum summed(uint i_2, Blend blend_9)
{
    Sum sum_3 = ConstructSum((0.0).xxxx, (0.0).xxxx);
    uint k_3 = 0u;

    bool loop_init_3 = true;
    while(true) {
        if (!loop_init_3) {
            uint _e81 = k_3;
            k_3 = (_e81 + 1u);
        }
        loop_init_3 = false;
        uint _e10 = k_3;
        uint _e13 = params.influence_sets;
        if ((_e10 < _e13)) {
        } else {
            break;
        }
        {
            uint _e18 = params.influence_sets;
            uint _e20 = k_3;
            uint4 joint_2 = asuint(indices_.Load4(((i_2 * _e18) + _e20)*16));
            uint _e27 = params.influence_sets;
            uint _e29 = k_3;
            float4 weight_4 = asfloat(weights.Load4(((i_2 * _e27) + _e29)*16));
            float4 _e37 = asfloat(joints.Load4(0+joint_2.x*32));
            float3 _e42 = asfloat(joints.Load3(16+joint_2.x*32));
            take_aligned(sum_3, _e37, _e42, weight_4.x, blend_9.heaviest);
            float4 _e49 = asfloat(joints.Load4(0+joint_2.y*32));
            float3 _e54 = asfloat(joints.Load3(16+joint_2.y*32));
            take_aligned(sum_3, _e49, _e54, weight_4.y, blend_9.heaviest);
            float4 _e61 = asfloat(joints.Load4(0+joint_2.z*32));
            float3 _e66 = asfloat(joints.Load3(16+joint_2.z*32));
            take_aligned(sum_3, _e61, _e66, weight_4.z, blend_9.heaviest);
            float4 _e73 = asfloat(joints.Load4(0+joint_2.w*32));
            float3 _e78 = asfloat(joints.Load3(16+joint_2.w*32));
            take_aligned(sum_3, _e73, _e78, weight_4.w, blend_9.heaviest);
        }
    }
    Sum _e84 = sum_3;
    const Sum sum_4 = _e84;
    return sum_4;
}

void write_motion(uint i_3, float3 mean, float4 relative)
{
    means.Store4(i_3*16, asuint(float4(mean, 1.0)));
    relatives.Store4(i_3*16, asuint(relative));
    float3 _e11 = params.camera;
    float3 view = (mean - _e11);
    float distance_ = length(view);
    float3 unit = ((distance_ == 0.0) ? float3(0.0, 0.0, 1.0) : (view / (distance_).xxx));
    const float4 _e25 = conjugate(relative);
    const float3 _e26 = rotate(_e25, unit);
    views.Store4(i_3*16, asuint(float4(_e26, 0.0)));
    return;
}

void write_covariance(uint i_4, float3 mean_1, float4 relative_1)
{
    write_motion(i_4, mean_1, relative_1);
    float4 _e6 = asfloat(gaussians.Load4(16+i_4*48));
    const float4 _e7 = multiply(relative_1, _e6);
    float3 _e11 = asfloat(gaussians.Load3(32+i_4*48));
    const Covariance _e12 = covariance_of(_e7, _e11);
    covariances.Store((6u * i_4)*4, asuint(_e12.first.x));
    covariances.Store(((6u * i_4) + 1u)*4, asuint(_e12.first.y));
    covariances.Store(((6u * i_4) + 2u)*4, asuint(_e12.first.z));
    covariances.Store(((6u * i_4) + 3u)*4, asuint(_e12.second.x));
    covariances.Store(((6u * i_4) + 4u)*4, asuint(_e12.second.y));
    covariances.Store(((6u * i_4) + 5u)*4, asuint(_e12.second.z));
    return;
}

void write_quaternion(uint i_5, float3 mean_2, float4 relative_2)
{
    write_motion(i_5, mean_2, relative_2);
    float4 _e8 = asfloat(gaussians.Load4(16+i_5*48));
    const float4 _e9 = multiply(relative_2, _e8);
    quaternions.Store4(i_5*16, asuint(_e9));
    return;
}

float3 coefficient(uint i_6, uint k_4)
{
    uint _e4 = params.sh_stride;
    uint _e8 = params.sh_coefficient_stride;
    uint at = ((i_6 * _e4) + (k_4 * _e8));
    float _e13 = asfloat(sh.Load(at*4));
    float _e18 = asfloat(sh.Load((at + 1u)*4));
    float _e23 = asfloat(sh.Load((at + 2u)*4));
    return float3(_e13, _e18, _e23);
}

void write_coefficient(uint i_7, uint k_5, float3 c_10)
{
    uint _e5 = params.sh_stride;
    uint _e9 = params.sh_coefficient_stride;
    uint at_1 = ((i_7 * _e5) + (k_5 * _e9));
    turned_sh.Store(at_1*4, asuint(c_10.x));
    turned_sh.Store((at_1 + 1u)*4, asuint(c_10.y));
    turned_sh.Store((at_1 + 2u)*4, asuint(c_10.z));
    return;
}

typedef float3 ret_band_1_[3];
ret_band_1_ band_1_(uint i_8)
{
    const float3 _e2 = coefficient(i_8, 1u);
    const float3 _e4 = coefficient(i_8, 2u);
    const float3 _e6 = coefficient(i_8, 3u);
    return Constructarray3_float3_(_e2, _e4, _e6);
}

typedef float3 ret_band_2_[5];
ret_band_2_ band_2_(uint i_9)
{
    const float3 _e2 = coefficient(i_9, 4u);
    const float3 _e4 = coefficient(i_9, 5u);
    const float3 _e6 = coefficient(i_9, 6u);
    const float3 _e8 = coefficient(i_9, 7u);
    const float3 _e10 = coefficient(i_9, 8u);
    return Constructarray5_float3_(_e2, _e4, _e6, _e8, _e10);
}

typedef float3 ret_band_3_[7];
ret_band_3_ band_3_(uint i_10)
{
    const float3 _e2 = coefficient(i_10, 9u);
    const float3 _e4 = coefficient(i_10, 10u);
    const float3 _e6 = coefficient(i_10, 11u);
    const float3 _e8 = coefficient(i_10, 12u);
    const float3 _e10 = coefficient(i_10, 13u);
    const float3 _e12 = coefficient(i_10, 14u);
    const float3 _e14 = coefficient(i_10, 15u);
    return Constructarray7_float3_(_e2, _e4, _e6, _e8, _e10, _e12, _e14);
}

[numthreads(64, 1, 1)]
void two_bones_covariance(uint3 id : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id.x < _e4)) {
        uint _e8 = params.first;
        uint i_11 = (_e8 + id.x);
        const Blend _e11 = gathered_two(i_11);
        float3 _e15 = asfloat(gaussians.Load3(0+i_11*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const float4 _e17 = closed_form_of_two(_e11);
        write_covariance(i_11, _e16, _e17);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void two_bones_quaternion(uint3 id_1 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_1.x < _e4)) {
        uint _e8 = params.first;
        uint i_12 = (_e8 + id_1.x);
        const Blend _e11 = gathered_two(i_12);
        float3 _e15 = asfloat(gaussians.Load3(0+i_12*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const float4 _e17 = closed_form_of_two(_e11);
        write_quaternion(i_12, _e16, _e17);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void closed_form_covariance(uint3 id_2 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_2.x < _e4)) {
        uint _e8 = params.first;
        uint i_13 = (_e8 + id_2.x);
        const Blend _e11 = gathered(i_13);
        float3 _e15 = asfloat(gaussians.Load3(0+i_13*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const float4 _e17 = closed_form(_e11);
        write_covariance(i_13, _e16, _e17);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void closed_form_quaternion(uint3 id_3 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_3.x < _e4)) {
        uint _e8 = params.first;
        uint i_14 = (_e8 + id_3.x);
        const Blend _e11 = gathered(i_14);
        float3 _e15 = asfloat(gaussians.Load3(0+i_14*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const float4 _e17 = closed_form(_e11);
        write_quaternion(i_14, _e16, _e17);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void power_covariance(uint3 id_4 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_4.x < _e4)) {
        uint _e8 = params.first;
        uint i_15 = (_e8 + id_4.x);
        const Blend _e11 = gathered(i_15);
        float3 _e15 = asfloat(gaussians.Load3(0+i_15*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        uint _e19 = params.power_steps;
        const float4 _e20 = power_steps(_e11, _e19);
        write_covariance(i_15, _e16, _e20);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void power_quaternion(uint3 id_5 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_5.x < _e4)) {
        uint _e8 = params.first;
        uint i_16 = (_e8 + id_5.x);
        const Blend _e11 = gathered(i_16);
        float3 _e15 = asfloat(gaussians.Load3(0+i_16*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        uint _e19 = params.power_steps;
        const float4 _e20 = power_steps(_e11, _e19);
        write_quaternion(i_16, _e16, _e20);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void aligned_sum_covariance(uint3 id_6 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_6.x < _e4)) {
        uint _e8 = params.first;
        uint i_17 = (_e8 + id_6.x);
        const Blend _e11 = gathered(i_17);
        float3 _e15 = asfloat(gaussians.Load3(0+i_17*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const Sum _e17 = summed(i_17, _e11);
        const float4 _e18 = aligned_sum(_e11, _e17);
        write_covariance(i_17, _e16, _e18);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void aligned_sum_quaternion(uint3 id_7 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_7.x < _e4)) {
        uint _e8 = params.first;
        uint i_18 = (_e8 + id_7.x);
        const Blend _e11 = gathered(i_18);
        float3 _e15 = asfloat(gaussians.Load3(0+i_18*48));
        const float3 _e16 = blended_mean(_e11, _e15);
        const Sum _e17 = summed(i_18, _e11);
        const float4 _e18 = aligned_sum(_e11, _e17);
        write_quaternion(i_18, _e16, _e18);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void dual_quaternion_covariance(uint3 id_8 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_8.x < _e4)) {
        uint _e8 = params.first;
        uint i_19 = (_e8 + id_8.x);
        const Blend _e11 = gathered(i_19);
        const Sum _e12 = summed(i_19, _e11);
        const Motion _e13 = dual_quaternion(_e11, _e12);
        float3 _e18 = asfloat(gaussians.Load3(0+i_19*48));
        const float3 _e19 = rotate(_e13.rotation, _e18);
        write_covariance(i_19, (_e19 + _e13.translation), _e13.rotation);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void dual_quaternion_quaternion(uint3 id_9 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_9.x < _e4)) {
        uint _e8 = params.first;
        uint i_20 = (_e8 + id_9.x);
        const Blend _e11 = gathered(i_20);
        const Sum _e12 = summed(i_20, _e11);
        const Motion _e13 = dual_quaternion(_e11, _e12);
        float3 _e18 = asfloat(gaussians.Load3(0+i_20*48));
        const float3 _e19 = rotate(_e13.rotation, _e18);
        write_quaternion(i_20, (_e19 + _e13.translation), _e13.rotation);
        return;
    } else {
        return;
    }
}

[numthreads(64, 1, 1)]
void colour(uint3 id_10 : SV_DispatchThreadID)
{
    float3 rgb = (float3)0;

    uint _e4 = params.count;
    if ((id_10.x >= _e4)) {
        return;
    }
    uint _e8 = params.first;
    uint i_21 = (_e8 + id_10.x);
    float4 _e13 = asfloat(views.Load4(i_21*16));
    float3 d_5 = _e13.xyz;
    const float3 _e19 = coefficient(i_21, 0u);
    rgb = ((0.5).xxx + (C0_ * _e19));
    uint _e25 = params.sh_degree;
    if ((_e25 >= 1u)) {
        const float3 _e28[3] = band_1_(i_21);
        float3 _e29 = rgb;
        const float3 _e33 = sh_degree_1_(d_5, _e28[0], _e28[1], _e28[2]);
        rgb = (_e29 + _e33);
    }
    uint _e37 = params.sh_degree;
    if ((_e37 >= 2u)) {
        const float3 _e40[5] = band_2_(i_21);
        const float _e41[5] = basis_2_(d_5);
        float3 _e42 = rgb;
        rgb = (_e42 + (((((_e41[0] * _e40[0]) + (_e41[1] * _e40[1])) + (_e41[2] * _e40[2])) + (_e41[3] * _e40[3])) + (_e41[4] * _e40[4])));
    }
    uint _e65 = params.sh_degree;
    if ((_e65 >= 3u)) {
        const float3 _e68[7] = band_3_(i_21);
        const float _e69[7] = basis_3_(d_5);
        float3 _e70 = rgb;
        rgb = (_e70 + (((((((_e69[0] * _e68[0]) + (_e69[1] * _e68[1])) + (_e69[2] * _e68[2])) + (_e69[3] * _e68[3])) + (_e69[4] * _e68[4])) + (_e69[5] * _e68[5])) + (_e69[6] * _e68[6])));
    }
    float3 _e101 = rgb;
    colours.Store4(i_21*16, asuint(float4(max(_e101, (0.0).xxx), 1.0)));
    return;
}

[numthreads(64, 1, 1)]
void turn_sh(uint3 id_11 : SV_DispatchThreadID)
{
    uint _e4 = params.count;
    if ((id_11.x >= _e4)) {
        return;
    }
    uint _e8 = params.first;
    uint i_22 = (_e8 + id_11.x);
    float4 _e13 = asfloat(relatives.Load4(i_22*16));
    const ShRotation _e14 = sh_rotation(_e13);
    const float3 _e17 = coefficient(i_22, 0u);
    write_coefficient(i_22, 0u, _e17);
    uint _e20 = params.sh_degree;
    if ((_e20 >= 1u)) {
        const float3 _e23[3] = band_1_(i_22);
        const float3 _e24[3] = sh_turned_1_(_e23, _e14);
        write_coefficient(i_22, 1u, _e24[0]);
        write_coefficient(i_22, 2u, _e24[1]);
        write_coefficient(i_22, 3u, _e24[2]);
    }
    uint _e33 = params.sh_degree;
    if ((_e33 >= 2u)) {
        const float3 _e36[5] = band_2_(i_22);
        const float3 _e37[5] = sh_turned_2_(_e36, _e14);
        write_coefficient(i_22, 4u, _e37[0]);
        write_coefficient(i_22, 5u, _e37[1]);
        write_coefficient(i_22, 6u, _e37[2]);
        write_coefficient(i_22, 7u, _e37[3]);
        write_coefficient(i_22, 8u, _e37[4]);
    }
    uint _e50 = params.sh_degree;
    if ((_e50 >= 3u)) {
        const float3 _e53[7] = band_3_(i_22);
        const float3 _e54[7] = sh_turned_3_(_e53, _e14);
        write_coefficient(i_22, 9u, _e54[0]);
        write_coefficient(i_22, 10u, _e54[1]);
        write_coefficient(i_22, 11u, _e54[2]);
        write_coefficient(i_22, 12u, _e54[3]);
        write_coefficient(i_22, 13u, _e54[4]);
        write_coefficient(i_22, 14u, _e54[5]);
        write_coefficient(i_22, 15u, _e54[6]);
        return;
    } else {
        return;
    }
}
