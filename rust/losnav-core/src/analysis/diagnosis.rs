//! Which singular geometry is this? Section 7 of the model, by name.
//!
//! The information is singular iff a twist `(w, u)` moves no line of sight: `w × d + u = μ d` for every `d = L − p`.
//! With `w` of unit length, `u = a w + b`, `b ⟂ w`, the landmarks then lie on the curve
//!
//! `d(μ) = (a/μ) w + (μ b + w × b)/(1 + μ²)`:
//!
//! a twisted cubic through the camera on a circular cylinder of diameter `|b|` (the horopter curve). Without pitch,
//! `a = 0`, it falls apart into a circle through the camera and the line `d = w × b + s w` opposite to it. Every row
//! of the table is one of these: a line (all on it), a circle with the camera, a line and a circle, the curve itself.
use super::danger_cylinder::Circle;
use crate::math::real::Real;
use crate::math::vec3::{Vec3, add, cross, dot, scale, sub};

/// How closely a figure must fit to lend its name, in units of the range. The rank has been decided before: this only
/// names, so it may be generous.
const FIT: f64 = 1e-5;
/// Sine below which points lie on a line.
const STRAIGHT: f64 = 1e-6;
/// Angular radius, rad, below which the landmarks are one point to the eye: straight above them the weakest singular
/// value falls with its square, and this is ten times what
/// [`RANK_TOLERANCE`](crate::math::triangular6::RANK_TOLERANCE) allows.
const ONE_POINT: f64 = 1e-3;

/// A velocity field that may leave every direction unchanged: the camera moves by `velocity`, the body turns by
/// `rotation`, both in reference axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// rad.
    pub rotation: Vec3<f64>,
    /// Of the camera, m.
    pub velocity: Vec3<f64>,
}

/// What the geometry is, with the numbers that belong to it; axes are unit vectors in the reference frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Diagnosis {
    /// Full rank.
    Generic,
    /// One landmark: only its direction is seen.
    OneLandmark,
    /// Two landmarks. Two observables stand alone: the attitude about `axis`, and the position along `centreward`,
    /// towards the centre of the circle through the camera and both.
    TwoLandmarks {
        /// `n × d`: `n` the normal of the plane of camera and landmarks, `d` the line from one to the other.
        axis: Vec3<f64>,
        /// Towards the centre of the circle.
        centreward: Vec3<f64>,
    },
    /// All landmarks on one line, the camera on it too: all directions are one.
    CameraOnLandmarkLine {
        /// Direction of the line.
        axis: Vec3<f64>,
    },
    /// All landmarks on one line: the rotation about it is free.
    CollinearLandmarks {
        /// Direction of the line.
        axis: Vec3<f64>,
    },
    /// Three landmarks, the camera on the cylinder through their circle.
    DangerCylinder {
        /// Axis of the cylinder.
        axis: Vec3<f64>,
        /// Radius, m.
        radius: f64,
    },
    /// Camera and landmarks on one circle.
    ConcyclicCamera {
        /// Normal of its plane.
        axis: Vec3<f64>,
        /// Radius, m.
        radius: f64,
    },
    /// Some landmarks on a line, the others and the camera on a circle perpendicular to it and touching it opposite
    /// to the camera.
    LineAndCircle {
        /// Direction of the line, normal of the circle.
        axis: Vec3<f64>,
        /// Radius of the circle, m.
        radius: f64,
        /// Landmarks on the line.
        on_line: usize,
    },
    /// Four landmarks, the camera where their four danger cylinders meet.
    DangerCylindersMeet {
        /// Axis of the twist.
        axis: Vec3<f64>,
        /// Radius of the cylinder the twisted cubic lies on, m.
        radius: f64,
    },
    /// Camera and five or more landmarks on one twisted cubic (horopter curve).
    TwistedCubic {
        /// Axis of the cylinder it lies on.
        axis: Vec3<f64>,
        /// Radius of that cylinder, m.
        radius: f64,
    },
    /// The landmarks are so far away that they are one point.
    DistantLandmarks {
        /// Angular radius, rad.
        angle: f64,
    },
    /// Rank is lost, but to no figure with a name (weights many decades apart).
    Unnamed,
}

impl Diagnosis {
    /// `(code, axis, second axis, number)`; the code is the order of the enumeration, absent numbers are NaN.
    #[must_use]
    pub fn encode(&self) -> (u8, Vec3<f64>, Vec3<f64>, f64) {
        const NONE: Vec3<f64> = [f64::NAN; 3];
        match *self {
            Self::Generic => (0, NONE, NONE, f64::NAN),
            Self::OneLandmark => (1, NONE, NONE, f64::NAN),
            Self::TwoLandmarks { axis, centreward } => (2, axis, centreward, f64::NAN),
            Self::CameraOnLandmarkLine { axis } => (3, axis, NONE, f64::NAN),
            Self::CollinearLandmarks { axis } => (4, axis, NONE, f64::NAN),
            Self::DangerCylinder { axis, radius } => (5, axis, NONE, radius),
            Self::ConcyclicCamera { axis, radius } => (6, axis, NONE, radius),
            Self::LineAndCircle { axis, radius, on_line } => (7, axis, [on_line as f64; 3], radius),
            Self::DangerCylindersMeet { axis, radius } => (8, axis, NONE, radius),
            Self::TwistedCubic { axis, radius } => (9, axis, NONE, radius),
            Self::DistantLandmarks { angle } => (10, NONE, NONE, angle),
            Self::Unnamed => (11, NONE, NONE, f64::NAN),
        }
    }
}

/// Names the geometry of a problem of this rank whose least observable motion is `twist`.
#[must_use]
pub fn diagnose(landmarks: &[Vec3<f64>], position: Vec3<f64>, rank: usize, twist: &Twist) -> Diagnosis {
    if let [_] | [] = landmarks {
        return Diagnosis::OneLandmark;
    }
    let line = common_line(landmarks);
    if let Some(axis) = line
        && on_line(axis, landmarks, position)
    {
        return Diagnosis::CameraOnLandmarkLine { axis };
    }
    if let [a, b] = landmarks {
        return two_landmarks(sub(*a, position), sub(*b, position));
    }
    if rank >= 6 {
        return Diagnosis::Generic;
    }
    if let Some(axis) = line {
        return Diagnosis::CollinearLandmarks { axis };
    }
    let angle = angular_radius(landmarks, position);
    if angle < ONE_POINT {
        return Diagnosis::DistantLandmarks { angle };
    }
    if rank == 5 { name_curve(landmarks, position, twist) } else { Diagnosis::Unnamed }
}

fn norm(v: Vec3<f64>) -> f64 {
    Real::sqrt(dot(v, v))
}

fn unit(v: Vec3<f64>) -> Vec3<f64> {
    scale(1.0 / norm(v), v)
}

/// Direction of the line all landmarks lie on, if they do.
fn common_line(landmarks: &[Vec3<f64>]) -> Option<Vec3<f64>> {
    let first = *landmarks.first()?;
    let mut longest = [0.0; 3];
    for landmark in landmarks {
        let e = sub(*landmark, first);
        if norm(e) > norm(longest) {
            longest = e;
        }
    }
    let length = norm(longest);
    let axis = scale(1.0 / length, longest);
    let straight = landmarks.iter().all(|l| norm(cross(axis, sub(*l, first))) <= STRAIGHT * length);
    straight.then_some(axis)
}

fn on_line(axis: Vec3<f64>, landmarks: &[Vec3<f64>], position: Vec3<f64>) -> bool {
    landmarks.iter().all(|l| {
        let d = sub(*l, position);
        norm(cross(axis, d)) <= STRAIGHT * norm(d)
    })
}

fn two_landmarks(a: Vec3<f64>, b: Vec3<f64>) -> Diagnosis {
    let normal = cross(a, b);
    let baseline = sub(b, a);
    // Centre of the circle through 0, a and b, times 2(a × b)²: b²(a² − a·b) a + a²(b² − a·b) b.
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    let toward = add(scale(bb * (aa - ab), a), scale(aa * (bb - ab), b));
    Diagnosis::TwoLandmarks { axis: unit(cross(normal, baseline)), centreward: unit(toward) }
}

/// Largest angle of a direction with their mean.
fn angular_radius(landmarks: &[Vec3<f64>], position: Vec3<f64>) -> f64 {
    let directions = landmarks.iter().map(|l| unit(sub(*l, position)));
    let mean = unit(directions.clone().fold([0.0; 3], add));
    // The chord: as good as the angle where it matters, and good to rounding.
    directions.map(|r| norm(sub(r, mean))).fold(0.0, Real::max)
}

/// Rank 5: the one twist tells the curve.
fn name_curve(landmarks: &[Vec3<f64>], position: Vec3<f64>, twist: &Twist) -> Diagnosis {
    let turn = norm(twist.rotation);
    let range = landmarks.iter().map(|l| norm(sub(*l, position))).sum::<f64>() / landmarks.len() as f64;
    if turn * range <= FIT * norm(twist.velocity) {
        return Diagnosis::Unnamed;
    }
    let axis = scale(1.0 / turn, twist.rotation);
    let velocity = scale(1.0 / turn, twist.velocity);
    let b = sub(velocity, scale(dot(velocity, axis), axis));
    let (opposite, radius) = (cross(axis, b), 0.5 * norm(b));
    let small = FIT * range;
    let stands_still = |l: &Vec3<f64>| {
        let d = sub(*l, position);
        norm(cross(unit(d), add(cross(axis, d), velocity))) <= small
    };
    if !landmarks.iter().all(stands_still) {
        return Diagnosis::Unnamed;
    }
    let level = |l: &Vec3<f64>| Real::abs(dot(sub(*l, position), axis)) <= small;
    let lined = |l: &Vec3<f64>| norm(cross(axis, sub(sub(*l, position), opposite))) <= small;
    if landmarks.iter().all(level) {
        return Diagnosis::ConcyclicCamera { axis, radius };
    }
    if let [a, b, c] = *landmarks {
        return match Circle::through(a, b, c) {
            Some(circle) => Diagnosis::DangerCylinder { axis: circle.axis, radius: circle.radius },
            None => Diagnosis::Unnamed,
        };
    }
    let count = landmarks.iter().filter(|l| lined(l)).count();
    if count >= 3 && landmarks.iter().all(|l| lined(l) || level(l)) {
        return Diagnosis::LineAndCircle { axis, radius, on_line: count };
    }
    match landmarks.len() {
        4 => Diagnosis::DangerCylindersMeet { axis, radius },
        _ => Diagnosis::TwistedCubic { axis, radius },
    }
}
