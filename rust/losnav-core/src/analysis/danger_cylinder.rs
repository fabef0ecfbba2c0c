//! The danger cylinder of three landmarks: their circumscribed circle, drawn out along its axis.
//!
//! A camera on it cannot fix its pose from these three to first order; near it sigma grows as 1/distance. More
//! landmarks are endangered only if every triple is, which makes the largest distance over the triples the one that
//! counts (necessary for a loss of rank, not sufficient: the rank decides).
use crate::math::real::Real;
use crate::math::vec3::{Vec3, cross, dot, scale, sub};

/// Landmarks of which all triples are looked at; of more, this many spread evenly over the list.
pub const SUBSET: usize = 12;
/// Sine of the smallest angle of three landmarks below which they lie on a line: beyond, the centre is rounding.
const COLLINEAR: f64 = 1e-9;

/// Circumscribed circle of three landmarks.
#[derive(Clone, Copy, Debug)]
pub struct Circle {
    /// A point on it.
    start: Vec3<f64>,
    /// From that point to the centre.
    to_centre: Vec3<f64>,
    /// Unit normal of its plane: the axis of the cylinder.
    pub axis: Vec3<f64>,
    /// Radius, m.
    pub radius: f64,
}

impl Circle {
    /// None if the three lie on a line.
    #[must_use]
    pub fn through(a: Vec3<f64>, b: Vec3<f64>, c: Vec3<f64>) -> Option<Self> {
        let (u, v) = (sub(b, a), sub(c, a));
        let (uu, vv) = (dot(u, u), dot(v, v));
        let normal = cross(u, v);
        let area = Real::sqrt(dot(normal, normal));
        let w = sub(c, b);
        let longest = Real::max(Real::max(uu, vv), dot(w, w));
        if area <= COLLINEAR * longest || area.is_nan() {
            return None;
        }
        let axis = scale(1.0 / area, normal);
        let toward = sub(scale(vv, cross(axis, u)), scale(uu, cross(axis, v)));
        let to_centre = scale(0.5 / area, toward);
        Some(Self { start: a, to_centre, axis, radius: Real::sqrt(dot(to_centre, to_centre)) })
    }

    /// Its centre.
    #[must_use]
    pub fn centre(&self) -> Vec3<f64> {
        crate::math::vec3::add(self.start, self.to_centre)
    }

    /// |distance to the axis − radius|, m. Written as a difference of squares, which survives a huge radius.
    #[must_use]
    pub fn distance(&self, position: Vec3<f64>) -> f64 {
        let e = sub(position, self.start);
        let flat = sub(e, scale(dot(e, self.axis), self.axis));
        let from_axis = sub(flat, self.to_centre);
        let difference = dot(flat, sub(from_axis, self.to_centre));
        Real::abs(difference) / (Real::sqrt(dot(from_axis, from_axis)) + self.radius)
    }
}

/// Largest distance over the triples of landmarks, m; none without a triple off a line.
#[must_use]
pub fn distance(landmarks: &[Vec3<f64>], position: Vec3<f64>) -> Option<f64> {
    let count = landmarks.len().min(SUBSET);
    let pick = |k: usize| landmarks.get(k * landmarks.len() / count.max(1)).copied().unwrap_or([0.0; 3]);
    let mut largest: Option<f64> = None;
    for i in 0..count {
        for j in i + 1..count {
            for k in j + 1..count {
                let Some(circle) = Circle::through(pick(i), pick(j), pick(k)) else { continue };
                let d = circle.distance(position);
                largest = Some(largest.map_or(d, |l| Real::max(l, d)));
            }
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Vec3<f64> = [32.5, 0.0, 0.0];
    const B: Vec3<f64> = [0.0, 30.0, 0.0];
    const C: Vec3<f64> = [-31.5, 0.0, 0.0];

    #[test]
    fn landmarks_lie_on_their_own_cylinder() {
        let circle = Circle::through(A, B, C).unwrap();
        for p in [A, B, C] {
            assert!(circle.distance(p) < 1e-14);
            assert!(circle.distance([p[0], p[1], 400.0]) < 1e-12);
        }
        let centre = circle.centre();
        assert!((circle.distance(centre) - circle.radius).abs() < 1e-13);
        let out = circle.radius + 7.0;
        assert!((circle.distance([centre[0] + out, centre[1], -3.0]) - 7.0).abs() < 1e-13);
    }

    #[test]
    fn a_line_has_none_and_a_flat_triangle_a_wide_one() {
        assert!(distance(&[[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], [5.0; 3]).is_none());
        assert!(distance(&[A, B], C).is_none());
        // Radius 1.25e7 m: the distance is still good to nine digits.
        let flat = Circle::through([-5.0, 0.0, 0.0], [0.0, 1e-6, 0.0], [5.0, 0.0, 0.0]).unwrap();
        assert!((flat.radius / 1.25e7 - 1.0).abs() < 1e-6);
        assert!((flat.distance([0.0, 3.0 + 1e-6, 9.0]) - 3.0).abs() < 1e-8);
    }

    #[test]
    fn four_landmarks_take_the_largest_of_four() {
        let four = [A, B, C, [0.0, -30.5, 0.0]];
        let p = [10.0, 20.0, 100.0];
        let largest = (0..4)
            .map(|skip| {
                let t: [usize; 3] = core::array::from_fn(|k| if k < skip { k } else { k + 1 });
                Circle::through(four[t[0]], four[t[1]], four[t[2]]).unwrap().distance(p)
            })
            .fold(0.0, f64::max);
        assert_eq!(distance(&four, p), Some(largest));
    }
}
