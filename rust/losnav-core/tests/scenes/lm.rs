//! Reference optimiser: Levenberg-Marquardt on the attitude and the landmark centroid seen from the observer.
use losnav_core::estimators::minimal::Pose;
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

pub struct Cloud {
    pub centroid: Vector3<f64>,
    pub points: Vec<Vector3<f64>>,
    pub los: Vec<Vector3<f64>>,
}

impl Cloud {
    pub fn new(landmarks: &[[f64; 3]], los: &[[f64; 3]]) -> Self {
        let x: Vec<_> = landmarks.iter().map(|l| Vector3::from(*l)).collect();
        let centroid = x.iter().sum::<Vector3<f64>>() / x.len() as f64;
        Self {
            centroid,
            points: x.iter().map(|l| l - centroid).collect(),
            los: los.iter().map(|b| Vector3::from(*b)).collect(),
        }
    }

    pub fn cost(&self, r: &Matrix3<f64>, t: &Vector3<f64>) -> f64 {
        let mut c = 0.0;
        for (m, b) in self.points.iter().zip(&self.los) {
            c += 0.5 * ((r * m + t).normalize() - b).norm_squared();
        }
        c
    }

    pub fn start(&self, pose: &Pose) -> (Matrix3<f64>, Vector3<f64>) {
        (pose.dcm, pose.dcm * (self.centroid - pose.position))
    }

    /// Cost at the minimum reached, attitude, centroid, iterations, converged.
    pub fn polish(
        &self,
        mut r: Matrix3<f64>,
        mut t: Vector3<f64>,
        max: usize,
    ) -> (f64, Matrix3<f64>, Vector3<f64>, usize, bool) {
        let mut cost = self.cost(&r, &t);
        let mut damping = 1e-3;
        let mut up = 2.0;
        for it in 0..max {
            let mut h = Matrix6::zeros();
            let mut g = Vector6::zeros();
            for (m, b) in self.points.iter().zip(&self.los) {
                let rm = r * m;
                let v = rm + t;
                let n = v.norm();
                let u = v / n;
                let p = (Matrix3::identity() - u * u.transpose()) / n;
                let mut j = Matrix3x6::zeros();
                j.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-p * rm.cross_matrix()));
                j.fixed_view_mut::<3, 3>(0, 3).copy_from(&p);
                h += j.tr_mul(&j);
                g += j.tr_mul(&(u - b));
            }
            let mut a = h;
            for k in 0..6 {
                a[(k, k)] += damping * h[(k, k)] + 1e-300;
            }
            let Some(factor) = a.cholesky() else {
                damping = (damping * up).max(1e-12);
                up *= 2.0;
                continue;
            };
            let step = -factor.solve(&g);
            let w = step.fixed_rows::<3>(0).into_owned();
            let r2 = nalgebra::Rotation3::new(w).into_inner() * r;
            let t2 = t + step.fixed_rows::<3>(3);
            let c2 = self.cost(&r2, &t2);
            let predicted = -(g.dot(&step) + 0.5 * step.dot(&(h * step)));
            let small = w.norm() < 1e-9 && (t2 - t).norm() < 1e-9 * t.norm();
            if c2 < cost {
                let ratio = (cost - c2) / predicted;
                (r, t, cost) = (r2, t2, c2);
                damping = (damping * (1.0 - (2.0 * ratio - 1.0f64).powi(3)).max(0.1)).max(1e-15);
                up = 2.0;
            } else {
                damping *= up;
                up *= 2.0;
            }
            if small || damping > 1e12 || cost < 1e-30 {
                return (cost, r, t, it + 1, true);
            }
        }
        (cost, r, t, max, false)
    }

    pub fn nearest(&self, r: &Matrix3<f64>, t: &Vector3<f64>) -> f64 {
        self.points.iter().map(|m| (r * m + t).norm()).fold(f64::INFINITY, f64::min)
    }

    pub fn in_front(&self, r: &Matrix3<f64>, t: &Vector3<f64>) -> bool {
        self.points.iter().zip(&self.los).all(|(m, b)| (r * m + t).dot(b) > 0.0)
    }
}
