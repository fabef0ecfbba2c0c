//! Random pose scenes with a fixed seed, for the long tests.
#![allow(dead_code)]
use losnav_core::estimators::minimal::Pose;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// SplitMix64.
pub struct Rng(pub u64);

impl Rng {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub fn normal(&mut self) -> f64 {
        let u = 1.0 - self.uniform();
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    pub fn rotation(&mut self) -> Matrix3<f64> {
        let q = Quaternion::new(self.normal(), self.normal(), self.normal(), self.normal());
        UnitQuaternion::from_quaternion(q).to_rotation_matrix().into_inner()
    }
}

#[derive(Clone, Debug)]
pub struct Scene {
    pub landmarks: Vec<[f64; 3]>,
    pub los: Vec<[f64; 3]>,
    pub truth: Pose,
    pub depth: f64,
}

/// Lines of sight of `truth` with isotropic tangent noise `sigma`.
pub fn observe(rng: &mut Rng, landmarks: Vec<Vector3<f64>>, truth: Pose, sigma: f64) -> Scene {
    let los = landmarks.iter().map(|l| (truth.los(l) + rng.vector() * sigma).normalize().into()).collect();
    Scene { landmarks: landmarks.into_iter().map(Into::into).collect(), los, truth, depth: 0.0 }
}

/// `n` landmarks in a ball of radius one (in a random plane through its centre when `planar`) seen from `depth` ball radii.
pub fn scene(rng: &mut Rng, n: usize, planar: bool, depth: f64, sigma: f64) -> Scene {
    let frame = rng.rotation();
    let landmarks: Vec<_> = (0..n)
        .map(|_| {
            let mut v = Vector3::new(rng.between(-1.0, 1.0), rng.between(-1.0, 1.0), rng.between(-1.0, 1.0));
            if planar {
                v[2] = 0.0;
            }
            frame * v
        })
        .collect();
    let truth = Pose { position: rng.vector().normalize() * depth, dcm: rng.rotation() };
    Scene { depth, ..observe(rng, landmarks, truth, sigma) }
}
