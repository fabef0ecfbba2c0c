//! A body of constant density bounded by triangles (Werner & Scheeres, *Exterior gravitation of a polyhedron*, 1997).
//!
//! `U = ½Gσ (Σ_e r_e·E_e r_e L_e − Σ_f r_f·F_f r_f ω_f)`, `g = −Gσ (Σ E r_e L − Σ F r_f ω)`, `Γ = Gσ (Σ E L − Σ F ω)`, and
//! `∇²U = −Gσ Σ ω`, which is `−4πGσ` inside and zero outside. Per edge `L = ln((a + b + e)/(a + b − e))` of the distances to its
//! ends and its length, `E` of the normals of its two faces; per face `F = n nᵀ` and the solid angle `ω` it fills.
//!
//! Exact for the shape, at its surface too; what it leaves out is that density is not constant (Eros: 2 % of the degree-2
//! field) and the shape is known to so many metres. On an edge or a corner the field is finite, its gradient is not. Far
//! away large terms cancel, two digits for each factor of ten: 1e-12 at ten radii, 1e-9 at 500.
use super::Gravity;
use crate::math::logarithm::log_ratio;
use crate::math::real::{Real, Work};
use crate::math::trig::atan2;
use crate::math::vec3::{Mat3, Vec3, cross, dot, scale, splat, sub};

/// A triangle, corners counterclockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    corners: Mat3<f64>,
    /// Outward, of the length of twice the area, and the same of length one.
    normal: [Vec3<f64>; 2],
}

impl Face {
    /// Of its corners, m.
    #[must_use]
    pub fn new(corners: Mat3<f64>) -> Self {
        let [a, b, c] = corners;
        let normal = cross(sub(b, a), sub(c, a));
        Self { corners, normal: [normal, scale(dot(normal, normal).rsqrt(), normal)] }
    }

    /// What it adds to six times the volume.
    #[must_use]
    pub fn sextuple_volume(&self) -> f64 {
        dot(self.normal[0], self.corners[0])
    }
}

/// Where two faces meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    ends: [Vec3<f64>; 2],
    length: f64,
    /// `E`, symmetric: xx, xy, xz, yy, yz, zz.
    dyad: [f64; 6],
}

impl Edge {
    /// From `a` to `b`, counterclockwise about the first of its faces and clockwise about the second.
    #[must_use]
    pub fn new(a: Vec3<f64>, b: Vec3<f64>, faces: [&Face; 2]) -> Self {
        let along = sub(b, a);
        let length = dot(along, along).sqrt();
        let mut dyad = [0.0; 6];
        for (face, sense) in [(faces[0], 1.0), (faces[1], -1.0)] {
            let normal = face.normal[1];
            // In the plane of the face, away from it.
            let out = cross(scale(sense / length, along), normal);
            for (k, (i, j)) in UPPER.into_iter().enumerate() {
                dyad[k] += 0.5 * (normal[i] * out[j] + normal[j] * out[i]);
            }
        }
        Self { ends: [a, b], length, dyad }
    }
}

/// Rows and columns of the upper triangle.
const UPPER: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polyhedron<E, F> {
    /// `Gσ`, 1/s².
    pub density: f64,
    /// Each edge once.
    pub edges: E,
    /// The faces.
    pub faces: F,
}

/// Everything the field is at one place.
#[derive(Clone, Copy, Debug)]
struct Whole<T> {
    potential: T,
    pull: Vec3<T>,
    bend: [T; 6],
    solid_angle: T,
}

/// A quadratic form and its derivatives, one term of the sums: `w M`.
#[inline(always)]
fn add_form<T: Real>(sums: &mut Whole<T>, weight: T, matrix: [T; 6], r: Vec3<T>) {
    let [xx, xy, xz, yy, yz, zz] = matrix;
    let bent = [dot([xx, xy, xz], r), dot([xy, yy, yz], r), dot([xz, yz, zz], r)];
    sums.potential = weight.mul_add(dot(bent, r), sums.potential);
    for i in 0..3 {
        sums.pull[i] = weight.mul_add(bent[i], sums.pull[i]);
    }
    for k in 0..6 {
        sums.bend[k] = weight.mul_add(matrix[k], sums.bend[k]);
    }
}

/// One sweep over edges and faces.
struct Sweep<'a, T> {
    edges: &'a [Edge],
    faces: &'a [Face],
    place: Vec3<T>,
}

impl<T: Real> Work for Sweep<'_, T> {
    type Output = Whole<T>;

    #[inline(always)]
    fn run(self) -> Whole<T> {
        let zero = T::zero();
        let mut sums = Whole { potential: zero, pull: [zero; 3], bend: [zero; 6], solid_angle: zero };
        for edge in self.edges {
            let [a, b] = edge.ends.map(|end| sub(splat(end), self.place));
            let ways = dot(a, a).sqrt() + dot(b, b).sqrt();
            let length = T::splat(edge.length);
            // On the edge the two ways are its length, or less by rounding.
            let weight = log_ratio(ways.max(length), length);
            add_form(&mut sums, weight, edge.dyad.map(T::splat), a);
        }
        for face in self.faces {
            let [a, b, c] = face.corners.map(|corner| sub(splat(corner), self.place));
            let lengths = [dot(a, a).sqrt(), dot(b, b).sqrt(), dot(c, c).sqrt()];
            let height = dot(splat(face.normal[0]), a);
            let across = (lengths[0] * lengths[1]).mul_add(lengths[2], lengths[0] * dot(b, c))
                + lengths[1].mul_add(dot(c, a), lengths[2] * dot(a, b));
            // Both are zero at a corner, where the face counts for nothing.
            let nowhere = (height.abs() + across.abs()).le(zero);
            let half = atan2(height, T::select(nowhere, T::one(), across));
            let angle = half + half;
            sums.solid_angle += angle;
            let n: Vec3<T> = splat(face.normal[1]);
            let level = dot(n, a);
            let weight = -(angle * level);
            // F r = n (n·r).
            sums.potential = weight.mul_add(level, sums.potential);
            for i in 0..3 {
                sums.pull[i] = weight.mul_add(n[i], sums.pull[i]);
            }
            for k in 0..6 {
                let (i, j) = UPPER[k];
                sums.bend[k] -= angle * (n[i] * n[j]);
            }
        }
        sums
    }
}

impl<E: AsRef<[Edge]>, F: AsRef<[Face]>> Polyhedron<E, F> {
    #[inline(always)]
    fn sweep<T: Real>(&self, place: Vec3<T>) -> Whole<T> {
        T::apart(Sweep { edges: self.edges.as_ref(), faces: self.faces.as_ref(), place })
    }

    /// Volume, m³; negative if the faces are seen from inside.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let mut sum = 0.0;
        for face in self.faces.as_ref() {
            sum += face.sextuple_volume();
        }
        sum / 6.0
    }

    /// `∇²U`, 1/s²: `−4πGσ` inside, zero outside.
    #[inline(always)]
    pub fn laplacian<T: Real>(&self, r: Vec3<T>) -> T {
        T::splat(-self.density) * self.sweep(r).solid_angle
    }
}

impl<E: AsRef<[Edge]>, F: AsRef<[Face]>> Gravity for Polyhedron<E, F> {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        T::splat(0.5 * self.density) * self.sweep(r).potential
    }

    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        scale(T::splat(-self.density), self.sweep(r).pull)
    }

    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        let sums = self.sweep(r);
        let k = T::splat(self.density);
        let [xx, xy, xz, yy, yz, zz] = sums.bend.map(|x| k * x);
        (scale(-k, sums.pull), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    }
}
