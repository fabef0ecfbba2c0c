//! Pixels of known landmarks in a pinhole camera: with `c = C (dcm (L − p) − l)`, the landmark in camera axes (boresight
//! +z, x right, y down), `C` the mounting and `l` the lever arm in body axes,
//!
//! `[u v] = [f_u x/z, f_v y/z] + [c_u c_v] + n`.
//!
//! A landmark that is itself known to `Σ` only adds `H_L Σ H_Lᵀ` to the noise of its pixels, `H_L = −∂h/∂p`: right if
//! its error is a new one each time; a map errs the same way all the time, and a filter had better consider it.
//!
//! Size of the effect: 1 m across at 1 km is half a pixel at `f = 500`. Left out: distortion of the lens (undistort the
//! pixels), the rolling shutter, light time. Undefined: on and behind the plane of the camera.
use super::target::pull_back;
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Mat3, Vec3, dot, rotate, rotate_transposed, scale, splat, sub};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// The camera itself.
#[derive(Clone, Copy, Debug)]
pub struct Optics<T> {
    /// Focal length along u and v, px.
    pub focal_length: [T; 2],
    /// Where the boresight meets the image, px.
    pub principal_point: [T; 2],
    /// Mounting: body components to camera components.
    pub camera_from_body: Mat3<T>,
    /// From the body's origin to the camera, body axes, m.
    pub lever_arm: Vec3<T>,
}

impl<T: Real> Optics<T> {
    /// A landmark given in body axes, in camera axes.
    #[inline(always)]
    pub fn in_camera(&self, body: Vec3<T>) -> Vec3<T> {
        rotate(&self.camera_from_body, sub(body, self.lever_arm))
    }

    /// Pixel of a point in camera axes in front of the camera, `inverse_depth` being one over its `z`.
    #[inline(always)]
    pub fn pixel(&self, camera: Vec3<T>, inverse_depth: T) -> [T; 2] {
        let mut pixel = self.principal_point;
        for i in 0..2 {
            pixel[i] = (self.focal_length[i] * camera[i]).mul_add(inverse_depth, pixel[i]);
        }
        pixel
    }
}

/// What is known of the error of a landmark, reference axes, m².
#[derive(Clone, Copy, Debug)]
pub enum MapError<T> {
    /// Variance along every axis.
    Scalar(T),
    /// Covariance.
    Full(Mat3<T>),
}

/// Measured pixels with their landmarks, in reference axes.
#[derive(Clone, Copy, Debug)]
pub struct LandmarkCamera<'a, T> {
    /// Landmarks, reference frame, m.
    pub landmarks: &'a [Vec3<T>],
    /// Measured pixels; NaN where the landmark was not seen.
    pub pixels: &'a [[T; 2]],
    /// 1-sigma noise of either pixel, px; the last one serves all that follow.
    pub sigmas: &'a [T],
    /// Errors of landmarks taken as noise of the pixels, likewise; none if there are none to take so.
    pub map: &'a [MapError<T>],
    /// The camera.
    pub optics: Optics<T>,
}

impl<T: Real> LandmarkCamera<'_, T> {
    /// The rows of one landmark that was seen at `pixel`. A lane where it is not in front of the camera, or was not
    /// seen, gets NaN.
    ///
    /// # Errors
    /// If there is no such landmark in front of the camera, or it is too far for numbers, in every lane.
    #[inline(always)]
    pub fn linearize_landmark(
        &self,
        x: &Kinematics<T>,
        index: usize,
        pixel: [T; 2],
    ) -> Result<Linearization<T, 2>, ModelError> {
        let Some(landmark) = self.landmarks.get(index) else {
            return Err(ModelError::BehindCamera { index });
        };
        let body = rotate(&x.dcm, sub(*landmark, x.position));
        let camera = self.optics.in_camera(body);
        let front = T::zero().lt(camera[2]);
        if !front.any() {
            return Err(ModelError::BehindCamera { index });
        }
        let inverse_depth = T::select(front, camera[2].recip(), T::splat(f64::NAN));
        let predicted = self.optics.pixel(camera, inverse_depth);
        if !seen(predicted).any() {
            return Err(ModelError::RangeOverflow { index });
        }
        let is_seen = seen(pixel).and(front);
        let mut innovation = [T::splat(f64::NAN); 2];
        // ∂[u v]/∂(dcm (L − p)), body axes, and the same in reference axes: ∂h/∂L.
        let (mut d_body, mut d_landmark) = ([[T::zero(); 3]; 2], [[T::zero(); 3]; 2]);
        let (mut d_position, mut d_attitude) = (d_body, d_body);
        for i in 0..2 {
            innovation[i] = T::select(is_seen, pixel[i] - predicted[i], innovation[i]);
            let slope = self.optics.focal_length[i] * inverse_depth;
            let mut d_camera = [T::zero(), T::zero(), -(slope * camera[i] * inverse_depth)];
            d_camera[i] = slope;
            d_body[i] = rotate_transposed(&self.optics.camera_from_body, d_camera);
            (d_position[i], d_attitude[i]) = pull_back(d_body[i], body, &x.dcm);
            d_landmark[i] = scale(-T::one(), d_position[i]);
        }
        Ok(Linearization {
            innovation,
            d_position,
            d_velocity: None,
            d_attitude: Some(d_attitude),
            sqrt_information: self.sqrt_information(index, &d_landmark),
        })
    }

    /// `S` with `SᵀS = (σ² I + H_L Σ H_Lᵀ)⁻¹`: the inverse of the Cholesky factor.
    #[inline(always)]
    fn sqrt_information(&self, index: usize, d_landmark: &[Vec3<T>; 2]) -> RootWeight<T, 2> {
        let sigma = at(self.sigmas, index).unwrap_or(T::one());
        let Some(map) = at(self.map, index) else { return RootWeight::Diagonal([sigma.recip(); 2]) };
        let [u, v] = d_landmark;
        let (of_u, of_v) = match &map {
            MapError::Scalar(variance) => (scale(*variance, *u), scale(*variance, *v)),
            MapError::Full(covariance) => (rotate(covariance, *u), rotate(covariance, *v)),
        };
        let variance = sigma * sigma;
        let (uu, vv, uv) = (dot(*u, of_u) + variance, dot(*v, of_v) + variance, dot(*u, of_v));
        let first = uu.rsqrt();
        let low = uv * first;
        let second = (-low).mul_add(low, vv).rsqrt();
        RootWeight::Full([[first, T::zero()], [-(low * first * second), second]])
    }
}

/// Was a landmark seen here? Is this a pixel at all?
#[inline(always)]
pub fn seen<T: Real>(pixel: [T; 2]) -> T::Mask {
    pixel[0].is_finite().and(pixel[1].is_finite())
}

/// Entry `index` of a list whose last one serves all that follow.
#[inline(always)]
fn at<E: Copy>(list: &[E], index: usize) -> Option<E> {
    list.get(index).or(list.last()).copied()
}

impl<T: Real> SensorModel<T> for LandmarkCamera<'_, T> {
    const NAME: &'static str = "LandmarkCamera";

    #[inline(always)]
    fn rows(&self) -> usize {
        2 * self.landmarks.len().min(self.pixels.len())
    }

    /// A landmark that was not seen, in no lane, hands over nothing.
    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        for index in 0..self.landmarks.len().min(self.pixels.len()) {
            let pixel = self.pixels[index];
            if seen(pixel).any() {
                sink.add_landmark(index, &self.linearize_landmark(x, index, pixel)?);
            }
        }
        Ok(())
    }
}

impl<T: Real> Specimen<T> for LandmarkCamera<'_, T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        // Mounted a third of a turn off, and off the origin.
        let mounting = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        let lever_arm = [0.4, -0.2, 0.7];
        let exact = Optics {
            focal_length: [500.0, 520.0],
            principal_point: [12.0, -7.0],
            camera_from_body: mounting,
            lever_arm,
        };
        let seen_at = [[0.3, -0.2, 20.0], [-4.0, 3.0, 31.0], [6.0, 5.0, 12.0]];
        let noise = [[0.4, -0.7], [1.1, 0.2], [-0.5, 0.9]];
        let (mut landmarks, mut pixels) = ([[T::zero(); 3]; 3], [[T::zero(); 2]; 3]);
        for i in 0..3 {
            let body = rotate_transposed(&mounting, seen_at[i]);
            let body = [body[0] + lever_arm[0], body[1] + lever_arm[1], body[2] + lever_arm[2]];
            let away = rotate_transposed(&truth.dcm, body);
            landmarks[i] = splat(core::array::from_fn(|k| truth.position[k] + away[k]));
            let [u, v] = exact.pixel(seen_at[i], 1.0 / seen_at[i][2]);
            pixels[i] = [T::splat(u + noise[i][0]), T::splat(v + noise[i][1])];
        }
        let covariance = [[0.04, 0.01, 0.0], [0.01, 0.09, -0.02], [0.0, -0.02, 0.05]];
        law.examine(&LandmarkCamera {
            landmarks: &landmarks,
            pixels: &pixels,
            sigmas: &[T::splat(0.8), T::splat(1.2)],
            map: &[MapError::Scalar(T::splat(0.02)), MapError::Full(covariance.map(splat))],
            optics: Optics {
                focal_length: exact.focal_length.map(T::splat),
                principal_point: exact.principal_point.map(T::splat),
                camera_from_body: mounting.map(splat),
                lever_arm: splat(lever_arm),
            },
        });
    }
}
