//! Rotations: quaternion, direction cosine matrix, modified Rodrigues parameters (MRP), small rotations.
//!
//! `dcm` = `[BN]` takes reference components to body components; a quaternion `[x, y, z, w]` is the orientation
//! of the body in the reference frame, `rotation_matrix(q) = dcm`ᵀ; `mrp = q_v/(1 + q_w)`. A small rotation `δα`
//! in body axes acts from the right: `q ⊗ δq`, that is `dcm ← (I − [δα×]) dcm`.
use super::real::{Mask, Real};
use super::trig::{atan2, sin_cos};
use super::vec3::{Mat3, Vec3, dot};

/// Unit quaternion `[x, y, z, w]`, scalar last.
pub type Quaternion<T> = [T; 4];

/// `[BN]` of a unit quaternion: `dcm = (w² − v·v) I + 2 v vᵀ − 2 w [v×]`.
#[inline(always)]
pub fn dcm_from_quaternion<T: Real>(q: Quaternion<T>) -> Mat3<T> {
    let two = T::splat(2.0);
    let (x2, y2, z2) = (two * q[0], two * q[1], two * q[2]);
    let (xx, yy, zz) = (x2 * q[0], y2 * q[1], z2 * q[2]);
    let (xy, xz, yz) = (x2 * q[1], x2 * q[2], y2 * q[2]);
    let (wx, wy, wz) = (x2 * q[3], y2 * q[3], z2 * q[3]);
    let one = T::one();
    [
        [one - (yy + zz), xy + wz, xz - wy],
        [xy - wz, one - (xx + zz), yz + wx],
        [xz + wy, yz - wx, one - (xx + yy)],
    ]
}

/// Unit quaternion of an MRP vector, either shadow set: `q = [2σ, 1 − σ²]/(1 + σ²)`.
#[inline(always)]
pub fn quaternion_from_mrp<T: Real>(mrp: Vec3<T>) -> Quaternion<T> {
    let s2 = dot(mrp, mrp);
    let inverse = T::one() / (T::one() + s2);
    let k = inverse + inverse;
    [k * mrp[0], k * mrp[1], k * mrp[2], (T::one() - s2) * inverse]
}

/// MRP of a unit quaternion, inside the unit ball whichever sign the quaternion has.
#[inline(always)]
pub fn mrp_from_quaternion<T: Real>(q: Quaternion<T>) -> Vec3<T> {
    let sign = T::select(q[3].lt(T::zero()), -T::one(), T::one());
    let k = sign / (T::one() + sign * q[3]);
    [k * q[0], k * q[1], k * q[2]]
}

/// Hamilton product `p ⊗ q`: `rotation_matrix(p ⊗ q) = rotation_matrix(p) rotation_matrix(q)`.
#[inline(always)]
pub fn quaternion_product<T: Real>(p: Quaternion<T>, q: Quaternion<T>) -> Quaternion<T> {
    [
        p[3].mul_add(q[0], p[0].mul_add(q[3], p[1].mul_add(q[2], -(p[2] * q[1])))),
        p[3].mul_add(q[1], p[1].mul_add(q[3], p[2].mul_add(q[0], -(p[0] * q[2])))),
        p[3].mul_add(q[2], p[2].mul_add(q[3], p[0].mul_add(q[1], -(p[1] * q[0])))),
        p[3].mul_add(q[3], -p[0].mul_add(q[0], p[1].mul_add(q[1], p[2] * q[2]))),
    ]
}

/// Orientation after a rotation step `δα` in body axes: `q ⊗ [δα/2, 1]/√(1 + |δα|²/4)`.
///
/// The Cayley map: equal to `q ⊗ Exp(δα)` up to `|δα|³/12`, without trigonometry, defined for every `δα`. As a
/// step of an iteration that is all that is asked of it; the fixed point does not depend on it.
#[inline(always)]
pub fn step<T: Real>(q: Quaternion<T>, delta: Vec3<T>) -> Quaternion<T> {
    let half = T::splat(0.5);
    let moved = quaternion_product(q, [half * delta[0], half * delta[1], half * delta[2], T::one()]);
    normalized(moved)
}

/// `Exp`: the orientation after the rotation vector `φ`, `q = [sin(|φ|/2) φ/|φ|, cos(|φ|/2)]`.
///
/// For `|φ|² < 0.04` by series whose first terms left out are below 3e-18; most rotations of a time step are, and then no
/// sine is computed.
#[inline(always)]
pub fn exp<T: Real>(rotation: Vec3<T>) -> Quaternion<T> {
    let theta2 = dot(rotation, rotation);
    // sin(x)/x and cos(x), x = |φ|/2.
    let y = T::splat(0.25) * theta2;
    let mut k =
        polynomial(y, [-1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0]);
    let mut w = polynomial(y, [-1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5, 1.0]);
    let small = theta2.lt(T::splat(0.04));
    if small.not().any() {
        let theta = theta2.sqrt();
        let (sine, cosine) = sin_cos(T::splat(0.5) * theta);
        k = T::select(small, k, (sine + sine) / theta);
        w = T::select(small, w, cosine);
    }
    k = T::splat(0.5) * k;
    [k * rotation[0], k * rotation[1], k * rotation[2], w]
}

/// The highest coefficient first.
#[inline(always)]
fn polynomial<T: Real>(x: T, coefficients: [f64; 6]) -> T {
    let mut sum = T::zero();
    for c in coefficients {
        sum = sum.mul_add(x, T::splat(c));
    }
    sum
}

/// `Log`: the rotation vector of a unit quaternion of either sign, `|φ| ≤ π`.
#[inline(always)]
pub fn log<T: Real>(q: Quaternion<T>) -> Vec3<T> {
    let v2 = dot([q[0], q[1], q[2]], [q[0], q[1], q[2]]);
    let (w, two) = (q[3].abs(), T::splat(2.0));
    let small = v2.lt(T::splat(1e-8));
    // 2/w (1 − |v|²/3w²): the first term left out is below 2e-17.
    let inverse = w.recip();
    let near = two * inverse * (T::one() - v2 * inverse * inverse * T::splat(1.0 / 3.0));
    let length = T::select(small, T::one(), v2).sqrt();
    let k = T::select(small, near, two * atan2(length, w) / length);
    let k = T::select(q[3].lt(T::zero()), -k, k);
    [k * q[0], k * q[1], k * q[2]]
}

/// The opposite rotation.
#[inline(always)]
pub fn conjugate<T: Real>(q: Quaternion<T>) -> Quaternion<T> {
    [-q[0], -q[1], -q[2], q[3]]
}

/// The quaternion divided by its norm.
#[inline(always)]
pub fn normalized<T: Real>(q: Quaternion<T>) -> Quaternion<T> {
    let n2 = q[0].mul_add(q[0], q[1].mul_add(q[1], q[2].mul_add(q[2], q[3] * q[3])));
    let k = n2.rsqrt();
    [k * q[0], k * q[1], k * q[2], k * q[3]]
}

/// `M(σ) = 4/(1+σ²)² ((1 − σ²) I − 2 [σ×] + 2 σσᵀ)`: `δα = M dσ`, the chain factor of eq. (12).
#[inline(always)]
pub fn rotation_from_mrp_rate<T: Real>(mrp: Vec3<T>) -> Mat3<T> {
    let s2 = dot(mrp, mrp);
    let inverse = T::one() / (T::one() + s2);
    let k = T::splat(4.0) * inverse * inverse;
    mrp_kinematic_matrix(mrp, s2, -k, k)
}

/// `B(σ)/4 = ((1 − σ²) I + 2 [σ×] + 2 σσᵀ)/4`: `dσ = B/4 δα`, the inverse of [`rotation_from_mrp_rate`].
#[inline(always)]
pub fn mrp_rate_from_rotation<T: Real>(mrp: Vec3<T>) -> Mat3<T> {
    let quarter = T::splat(0.25);
    mrp_kinematic_matrix(mrp, dot(mrp, mrp), quarter, quarter)
}

/// `k (1 − σ²) I + 2 k_skew [σ×] + 2 k σσᵀ`.
#[inline(always)]
fn mrp_kinematic_matrix<T: Real>(mrp: Vec3<T>, s2: T, k_skew: T, k: T) -> Mat3<T> {
    let (two, diagonal) = (T::splat(2.0), k * (T::one() - s2));
    let (a, b) = (two * k, two * k_skew);
    let [x, y, z] = mrp;
    [
        [(a * x).mul_add(x, diagonal), (a * x).mul_add(y, -(b * z)), (a * x).mul_add(z, b * y)],
        [(a * y).mul_add(x, b * z), (a * y).mul_add(y, diagonal), (a * y).mul_add(z, -(b * x))],
        [(a * z).mul_add(x, -(b * y)), (a * z).mul_add(y, b * x), (a * z).mul_add(z, diagonal)],
    ]
}
