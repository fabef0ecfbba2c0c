//! The orbital frame over any scalar: z to nadir, y along the negative orbit normal, x = y × z.
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, add, cross, dot, rotate, rotate_transposed, scale, sub};

/// The frame of a spacecraft and its angular rate.
#[derive(Clone, Copy, Debug)]
pub struct Frame<T> {
    /// LVLH from inertial.
    pub dcm: Mat3<T>,
    /// Angular rate, LVLH axes, rad/s: `(0, −h/r², −r a_h/h)`, exact.
    pub rate: Vec3<T>,
}

impl<T: Real> Frame<T> {
    /// Of position, velocity and acceleration in inertial axes; of the last only the part across the plane matters.
    #[inline(always)]
    pub fn new(r: Vec3<T>, v: Vec3<T>, acceleration: Vec3<T>) -> Self {
        let h = cross(r, v);
        let (h2, r2) = (dot(h, h), dot(r, r));
        let (inverse_h, inverse_r) = (h2.sqrt().recip(), r2.sqrt().recip());
        let (y, z) = (scale(-inverse_h, h), scale(-inverse_r, r));
        let pitch = -(h2 * inverse_h * inverse_r * inverse_r);
        let roll = -(r2 * inverse_r * dot(acceleration, h) * inverse_h * inverse_h);
        Self { dcm: [cross(y, z), y, z], rate: [T::zero(), pitch, roll] }
    }

    /// `[r v]` in the frame, velocity as seen in it, of a separation and its rate in inertial axes.
    #[inline(always)]
    pub fn relative(&self, apart: Vec3<T>, rate: Vec3<T>) -> [T; 6] {
        let r = rotate(&self.dcm, apart);
        let v = sub(rotate(&self.dcm, rate), cross(self.rate, r));
        [r[0], r[1], r[2], v[0], v[1], v[2]]
    }

    /// The inverse of [`relative`](Self::relative).
    #[inline(always)]
    pub fn apart(&self, relative: &[T; 6]) -> (Vec3<T>, Vec3<T>) {
        let [x, y, z, u, v, w] = *relative;
        let moving = add([u, v, w], cross(self.rate, [x, y, z]));
        (rotate_transposed(&self.dcm, [x, y, z]), rotate_transposed(&self.dcm, moving))
    }
}
