//! The one linearisation and the sinks that consume it.
//!
//! A sensor turns [`Kinematics`](super::kinematics::Kinematics) into `y = z ⊟ h(x)`, `H`, `W` once; least squares,
//! filters, Fisher information and the Jacobian laws are [`Sink`]s. A line of sight keeps its structure: with
//! `h` the predicted direction and `ρ` the range, all of `H` follows from `(h, 1/ρ)`,
//!
//! `∂h/∂p = −(I − hhᵀ) dcm/ρ`,  `∂h/∂α = [h×]`   (equations (11), and (12) with the chain factor taken out),
//!
//! so a sink may accumulate straight from them; one that does not care receives the expanded rows.
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, dot, rotate, rotate_transposed, scale_add, skew};

/// `M` measurement rows: `y ≈ H δ`, `δ = [δp, δv, δα]` true minus estimate, weight `SᵀS`.
#[derive(Clone, Copy, Debug)]
pub struct Linearization<T, const M: usize> {
    /// `y = z ⊟ h(x)`.
    pub innovation: [T; M],
    /// `∂h/∂p`, reference axes, 1/m.
    pub d_position: [Vec3<T>; M],
    /// `∂h/∂v`, reference axes, s/m; none where the measurement does not depend on it, and the zeros cost nothing.
    pub d_velocity: Option<[Vec3<T>; M]>,
    /// `∂h/∂α`, body axes, 1/rad; none as above.
    pub d_attitude: Option<[Vec3<T>; M]>,
    /// `S` with `SᵀS = R⁻¹`.
    pub sqrt_information: RootWeight<T, M>,
}

/// `S`, the square root of the weight of `M` rows.
#[derive(Clone, Copy, Debug)]
pub enum RootWeight<T, const M: usize> {
    /// Rows that err independently: `1/σ` of each.
    Diagonal([T; M]),
    /// Any other.
    Full([[T; M]; M]),
}

impl<T: Real, const M: usize> Linearization<T, M> {
    /// Row `m` of `S y` and `S H`.
    #[inline(always)]
    pub fn whitened(&self, m: usize) -> Row<T> {
        match &self.sqrt_information {
            RootWeight::Diagonal(s) => Row::zero().plus(s[m], self, m),
            RootWeight::Full(s) => {
                let mut row = Row::zero();
                for k in 0..M {
                    row = row.plus(s[m][k], self, k);
                }
                row
            }
        }
    }
}

/// How much a direction is trusted.
#[derive(Clone, Copy, Debug)]
pub enum Weight<T> {
    /// `w I`, `w = 1/σ²`.
    Scalar(T),
    /// `SᵀS`, the square root of a full information matrix.
    Full(Mat3<T>),
}

/// One line of sight, linearised, its structure kept. Body axes throughout.
#[derive(Clone, Copy, Debug)]
pub struct Direction<T> {
    /// Predicted unit vector `h`.
    pub predicted: Vec3<T>,
    /// `e = b − h`. Always the difference: `b` in its place in the sums loses three digits.
    pub innovation: Vec3<T>,
    /// `1/ρ`, 1/m.
    pub inverse_range: T,
    /// Weight of the three components.
    pub weight: Weight<T>,
}

impl<T: Real> Direction<T> {
    /// `∂h/∂p'`, `p' = dcm p` the position in body axes: `−(I − hhᵀ)/ρ`.
    #[inline(always)]
    pub fn d_body_position(&self) -> Mat3<T> {
        let (h, k) = (self.predicted, self.inverse_range);
        let g = [k * h[0], k * h[1], k * h[2]];
        [
            [g[0].mul_add(h[0], -k), g[0] * h[1], g[0] * h[2]],
            [g[1] * h[0], g[1].mul_add(h[1], -k), g[1] * h[2]],
            [g[2] * h[0], g[2] * h[1], g[2].mul_add(h[2], -k)],
        ]
    }

    /// `eᵀ W e`.
    #[inline(always)]
    pub fn squared_residual(&self) -> T {
        match self.weight {
            Weight::Scalar(w) => w * dot(self.innovation, self.innovation),
            Weight::Full(s) => {
                let y = rotate(&s, self.innovation);
                dot(y, y)
            }
        }
    }

    /// The same three rows without the structure.
    #[inline(always)]
    pub fn expand(&self, dcm: &Mat3<T>) -> Linearization<T, 3> {
        let body = self.d_body_position();
        let sqrt_information = match self.weight {
            Weight::Scalar(w) => RootWeight::Diagonal([w.sqrt(); 3]),
            Weight::Full(s) => RootWeight::Full(s),
        };
        Linearization {
            innovation: self.innovation,
            d_position: [
                rotate_transposed(dcm, body[0]),
                rotate_transposed(dcm, body[1]),
                rotate_transposed(dcm, body[2]),
            ],
            d_velocity: None,
            d_attitude: Some(skew(self.predicted)),
            sqrt_information,
        }
    }
}

/// Consumes linearisations.
pub trait Sink<T: Real> {
    /// Takes `M` rows.
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>);

    /// Does it look at more than innovations?  If not, a sensor may leave out derivatives that cost it something.
    #[inline(always)]
    fn wants_derivatives(&self) -> bool {
        true
    }

    /// Takes a direction; override it to use the structure.
    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, dcm: &Mat3<T>) {
        self.add(&direction.expand(dcm));
    }

    /// Takes the rows that see landmark `index` of the sensor's list; override it to gate each landmark by itself, or to
    /// account for the error of the map. What is measured depends on where the landmark is from the observer, so the
    /// derivative with respect to the landmark is minus that with respect to the position. Landmarks come in ascending
    /// order; those not seen do not come at all.
    #[inline(always)]
    fn add_landmark<const M: usize>(&mut self, index: usize, rows: &Linearization<T, M>) {
        let _ = index;
        self.add(rows);
    }

    /// Takes the three rows of a unit vector that err by as much in every direction; `direction` is the predicted one, in
    /// the axes of the rows. Along it nothing is measured: override it to take only the two rows across.
    #[inline(always)]
    fn add_unit_vector(&mut self, rows: &Linearization<T, 3>, direction: Vec3<T>) {
        let _ = direction;
        self.add(rows);
    }
}

/// Two sinks as one.
#[derive(Debug)]
pub struct Both<'a, A, B>(pub &'a mut A, pub &'a mut B);

impl<T: Real, A: Sink<T>, B: Sink<T>> Sink<T> for Both<'_, A, B> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        self.0.add(rows);
        self.1.add(rows);
    }

    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, dcm: &Mat3<T>) {
        self.0.add_direction(direction, dcm);
        self.1.add_direction(direction, dcm);
    }

    #[inline(always)]
    fn add_landmark<const M: usize>(&mut self, index: usize, rows: &Linearization<T, M>) {
        self.0.add_landmark(index, rows);
        self.1.add_landmark(index, rows);
    }

    #[inline(always)]
    fn add_unit_vector(&mut self, rows: &Linearization<T, 3>, direction: Vec3<T>) {
        self.0.add_unit_vector(rows, direction);
        self.1.add_unit_vector(rows, direction);
    }
}

/// Writes down innovations `z ⊟ h(x)` as far as there is room; what comes after is dropped, what does not come is NaN.
#[derive(Debug)]
pub struct Innovations<'a, T> {
    out: &'a mut [T],
    taken: usize,
}

impl<'a, T: Real> Innovations<'a, T> {
    /// Writes to `out` from the front.
    #[inline(always)]
    #[must_use]
    pub fn new(out: &'a mut [T]) -> Self {
        out.fill(T::splat(f64::NAN));
        Self { out, taken: 0 }
    }

    #[inline(always)]
    fn write<const M: usize>(&mut self, rows: &[T; M]) {
        if let Some(out) = self.out.get_mut(self.taken..self.taken + M) {
            out.copy_from_slice(rows);
        }
        self.taken += M;
    }
}

impl<T: Real> Sink<T> for Innovations<'_, T> {
    #[inline(always)]
    fn wants_derivatives(&self) -> bool {
        false
    }

    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        self.write(&rows.innovation);
    }

    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, _dcm: &Mat3<T>) {
        self.write(&direction.innovation);
    }

    /// In its place: a landmark that is not seen leaves its own empty.
    #[inline(always)]
    fn add_landmark<const M: usize>(&mut self, index: usize, rows: &Linearization<T, M>) {
        if index * M >= self.taken {
            self.taken = index * M;
            self.write(&rows.innovation);
        }
    }
}

/// One measurement row as a sensor gave it, unweighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<T> {
    /// `y`.
    pub innovation: T,
    /// `∂h/∂p`, reference axes, 1/m.
    pub d_position: Vec3<T>,
    /// `∂h/∂v`, reference axes, s/m.
    pub d_velocity: Vec3<T>,
    /// `∂h/∂α`, body axes, 1/rad.
    pub d_attitude: Vec3<T>,
}

impl<T: Real> Row<T> {
    /// All zero.
    #[inline(always)]
    #[must_use]
    pub fn zero() -> Self {
        let o = [T::zero(); 3];
        Self { innovation: T::zero(), d_position: o, d_velocity: o, d_attitude: o }
    }

    /// `Σ sₖ rowₖ`.
    #[inline(always)]
    pub(crate) fn sum<const M: usize>(s: [T; M], rows: &[Self; M]) -> Self {
        let mut sum = Self::zero();
        for k in 0..M {
            sum.innovation = s[k].mul_add(rows[k].innovation, sum.innovation);
            sum.d_position = scale_add(s[k], rows[k].d_position, sum.d_position);
            sum.d_velocity = scale_add(s[k], rows[k].d_velocity, sum.d_velocity);
            sum.d_attitude = scale_add(s[k], rows[k].d_attitude, sum.d_attitude);
        }
        sum
    }

    /// This row plus `s` times row `m` of a linearisation.
    #[inline(always)]
    fn plus<const M: usize>(self, s: T, rows: &Linearization<T, M>, m: usize) -> Self {
        let mut sum = self;
        sum.innovation = s.mul_add(rows.innovation[m], sum.innovation);
        sum.d_position = scale_add(s, rows.d_position[m], sum.d_position);
        if let Some(d) = &rows.d_velocity {
            sum.d_velocity = scale_add(s, d[m], sum.d_velocity);
        }
        if let Some(d) = &rows.d_attitude {
            sum.d_attitude = scale_add(s, d[m], sum.d_attitude);
        }
        sum
    }
}

/// The sink that only writes down: for tests, and for who wants to see a sensor's prediction and Jacobian.
#[derive(Debug)]
pub struct Recorder<'a, T> {
    rows: &'a mut [Row<T>],
    offered: usize,
}

impl<'a, T: Real> Recorder<'a, T> {
    /// Writes to `rows` from the front.
    #[must_use]
    pub fn new(rows: &'a mut [Row<T>]) -> Self {
        Self { rows, offered: 0 }
    }

    /// Rows offered so far; those beyond the room given were dropped.
    #[must_use]
    pub fn offered(&self) -> usize {
        self.offered
    }
}

impl<T: Real> Sink<T> for Recorder<'_, T> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        for m in 0..M {
            if let Some(row) = self.rows.get_mut(self.offered) {
                *row = Row::zero().plus(T::one(), rows, m);
            }
            self.offered += 1;
        }
    }
}
