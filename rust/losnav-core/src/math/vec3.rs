//! Three-vectors and 3×3 matrices as plain arrays, for kernels over any [`Real`].
use super::real::Real;

/// Components of a vector.
pub type Vec3<T> = [T; 3];
/// Rows of a matrix.
pub type Mat3<T> = [[T; 3]; 3];

/// The same vector in every lane.
#[inline(always)]
pub fn splat<T: Real>(v: [f64; 3]) -> Vec3<T> {
    [T::splat(v[0]), T::splat(v[1]), T::splat(v[2])]
}

/// `a · b`.
#[inline(always)]
pub fn dot<T: Real>(a: Vec3<T>, b: Vec3<T>) -> T {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// `a × b`.
#[inline(always)]
pub fn cross<T: Real>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [
        a[1].mul_add(b[2], -(a[2] * b[1])),
        a[2].mul_add(b[0], -(a[0] * b[2])),
        a[0].mul_add(b[1], -(a[1] * b[0])),
    ]
}

/// `a + b`.
#[inline(always)]
pub fn add<T: Real>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a − b`.
#[inline(always)]
pub fn sub<T: Real>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `s a`.
#[inline(always)]
pub fn scale<T: Real>(s: T, a: Vec3<T>) -> Vec3<T> {
    [s * a[0], s * a[1], s * a[2]]
}

/// `s a + b`.
#[inline(always)]
pub fn scale_add<T: Real>(s: T, a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [s.mul_add(a[0], b[0]), s.mul_add(a[1], b[1]), s.mul_add(a[2], b[2])]
}

/// `m v`.
#[inline(always)]
pub fn rotate<T: Real>(m: &Mat3<T>, v: Vec3<T>) -> Vec3<T> {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// `mᵀ v`.
#[inline(always)]
pub fn rotate_transposed<T: Real>(m: &Mat3<T>, v: Vec3<T>) -> Vec3<T> {
    scale_add(v[0], m[0], scale_add(v[1], m[1], scale(v[2], m[2])))
}

/// `a b`.
#[inline(always)]
pub fn mul<T: Real>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [rotate_transposed(b, a[0]), rotate_transposed(b, a[1]), rotate_transposed(b, a[2])]
}

/// `aᵀ`.
#[inline(always)]
pub fn transpose<T: Real>(a: &Mat3<T>) -> Mat3<T> {
    [[a[0][0], a[1][0], a[2][0]], [a[0][1], a[1][1], a[2][1]], [a[0][2], a[1][2], a[2][2]]]
}

/// `k m`.
#[inline(always)]
pub fn scaled<T: Real>(k: T, m: &Mat3<T>) -> Mat3<T> {
    [scale(k, m[0]), scale(k, m[1]), scale(k, m[2])]
}

/// `a + b`.
#[inline(always)]
pub fn sum<T: Real>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])]
}

/// `k I + m`.
#[inline(always)]
pub fn plus_diagonal<T: Real>(k: T, m: &Mat3<T>) -> Mat3<T> {
    let mut sum = *m;
    for i in 0..3 {
        sum[i][i] += k;
    }
    sum
}

/// `[v×]`, the matrix with `[v×] u = v × u`.
#[inline(always)]
pub fn skew<T: Real>(v: Vec3<T>) -> Mat3<T> {
    let o = T::zero();
    [[o, -v[2], v[1]], [v[2], o, -v[0]], [-v[1], v[0], o]]
}

/// Two unit vectors across a unit vector and each other (Duff et al., *Building an Orthonormal Basis, Revisited*, 2017).
#[inline(always)]
pub fn across<T: Real>(n: Vec3<T>) -> [Vec3<T>; 2] {
    let sign = T::select(n[2].lt(T::zero()), -T::one(), T::one());
    let a = -(sign + n[2]).recip();
    let b = n[0] * n[1] * a;
    [
        [(sign * n[0]).mul_add(n[0] * a, T::one()), sign * b, -(sign * n[0])],
        [b, n[1].mul_add(n[1] * a, sign), -n[1]],
    ]
}

/// Lane-wise choice between two vectors.
#[inline(always)]
pub fn select<T: Real>(mask: T::Mask, yes: Vec3<T>, no: Vec3<T>) -> Vec3<T> {
    [T::select(mask, yes[0], no[0]), T::select(mask, yes[1], no[1]), T::select(mask, yes[2], no[2])]
}
