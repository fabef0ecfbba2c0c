//! Where a body far away is seen from a moving observer: geometric direction, light time, stellar aberration.
//!
//! 1. The light that arrives left the body `τ` ago: `c τ = |b(t − τ) − p|`, with `b(t − τ) = b − τ w + ½ τ² a`.
//! 2. Geometric direction `u = (b(t − τ) − p)/ρ`, in the frame of the state.
//! 3. An observer that moves with `β = v/c` sees it at
//!
//!    `u' = [u/γ + (1 + γ/(1 + γ) u·β) β]/(1 + u·β)`,  `1/γ = √(1 − β²)`
//!
//!    (special relativity, exact; Klioner, *A practical relativistic model for microarcsecond astrometry in space*, AJ 125,
//!    2003, section 5): `u` turned towards the velocity by `v_⊥/c` to first order, `u'` again a unit vector.
//!
//! Size of the effect: `v/c` is 1e-4 rad (20″) in an orbit like the Earth's; a planet moves by as much in the time its light
//! takes. Velocities are those of the state's frame: heliocentric ones for a heliocentric state, whose Sun stands still.
//! That this frame moves about the barycentre (16 m/s, 5e-8 rad) cancels between 1 and 3 to second order, its acceleration
//! moves nothing by more than a metre. Left out: what the body's jerk does in `τ` (0.2 m for the Earth at 2 AU), the
//! bending of light by the Sun (1.75″ at its limb, 0.004″ across from it), the body's own extent and phase.
use super::linearization::{Linearization, RootWeight, Sink};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Mat3, Vec3, dot, mul, rotate, scale, scale_add, skew, sub};

/// Speed of light, m/s, exact.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;
/// Rounds for the light time: each gains a factor of the body's speed over that of light, 1e-4 or better.
const ROUNDS: usize = 6;

/// A body at the time of the measurement, in the frame of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body<T> {
    /// m.
    pub position: Vec3<T>,
    /// m/s.
    pub velocity: Vec3<T>,
    /// m/s².
    pub acceleration: Vec3<T>,
}

impl<T: Real> Body<T> {
    /// At rest at the origin: the Sun of a heliocentric state.
    #[inline(always)]
    #[must_use]
    pub fn origin() -> Self {
        let zero = [T::zero(); 3];
        Self { position: zero, velocity: zero, acceleration: zero }
    }
}

/// What is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corrections {
    /// The body is seen where it was when the light left it.
    pub light_time: bool,
    /// The observer's velocity turns the direction.
    pub aberration: bool,
}

/// A direction as seen, in reference axes, and how it changes with the observer.
#[derive(Clone, Copy, Debug)]
pub struct Seen<T> {
    /// Unit vector.
    pub direction: Vec3<T>,
    /// From the observer to where the body is seen from, m.
    pub range: T,
    /// `∂u'/∂p`, 1/m.
    pub d_position: Mat3<T>,
    /// `∂u'/∂v`, s/m; none without aberration.
    pub d_velocity: Option<Mat3<T>>,
}

/// The direction to `body` from an observer at `position` with `velocity`.
#[inline(always)]
pub fn seen<T: Real>(
    position: Vec3<T>,
    velocity: Vec3<T>,
    body: &Body<T>,
    corrections: Corrections,
) -> Seen<T> {
    let mut line = sub(body.position, position);
    let mut motion = [T::zero(); 3];
    if corrections.light_time {
        let start = line;
        let slowness = T::splat(1.0 / SPEED_OF_LIGHT);
        for _ in 0..ROUNDS {
            let delay = slowness * dot(line, line).sqrt();
            let half = scale(T::splat(-0.5) * delay, body.acceleration);
            line = scale_add(
                -delay,
                [body.velocity[0] + half[0], body.velocity[1] + half[1], body.velocity[2] + half[2]],
                start,
            );
        }
        motion = scale_add(-(slowness * dot(line, line).sqrt()), body.acceleration, body.velocity);
    }
    let range = dot(line, line).sqrt();
    let inverse = range.recip();
    let u = scale(inverse, line);
    // ∂u/∂p = (I − uuᵀ)/ρ ∂(line)/∂p, and ∂(line)/∂p = −I + w uᵀ/(c + u·w) since τ depends on p too.
    let mut d_position = [[T::zero(); 3]; 3];
    let along = dot(u, motion);
    let follow = scale((T::splat(SPEED_OF_LIGHT) + along).recip(), scale_add(-along, u, motion));
    for i in 0..3 {
        for j in 0..3 {
            let turned = (u[i] + follow[i]) * u[j];
            d_position[i][j] = inverse * if i == j { turned - T::one() } else { turned };
        }
    }
    if !corrections.aberration {
        return Seen { direction: u, range, d_position, d_velocity: None };
    }
    let (direction, d_direction, d_velocity) = aberrate(u, velocity);
    Seen { direction, range, d_position: mul(&d_direction, &d_position), d_velocity: Some(d_velocity) }
}

#[inline(always)]
fn visible<T: Real>(range: T) -> Result<(), ModelError> {
    if !T::zero().lt(range).any() {
        return Err(ModelError::AtTarget);
    }
    if !range.is_finite().any() {
        return Err(ModelError::TargetTooFar);
    }
    Ok(())
}

/// Hands a direction measured as `los` in body axes to a sink.
///
/// # Errors
/// Where the observer stands on the body, or the square of the range is beyond numbers, in every lane.
#[inline(always)]
pub fn hand_over<T: Real>(
    seen: &Seen<T>,
    dcm: &Mat3<T>,
    los: Vec3<T>,
    sigma: T,
    sink: &mut impl Sink<T>,
) -> Result<(), ModelError> {
    visible(seen.range)?;
    let predicted = rotate(dcm, seen.direction);
    let rows = Linearization {
        innovation: sub(los, predicted),
        d_position: mul(dcm, &seen.d_position),
        d_velocity: seen.d_velocity.map(|d| mul(dcm, &d)),
        d_attitude: Some(skew(predicted)),
        sqrt_information: RootWeight::Diagonal([sigma.recip(); 3]),
    };
    sink.add_unit_vector(&rows, predicted);
    Ok(())
}

/// Hands a direction over to a sink that does not look at its derivatives.
///
/// # Errors
/// As [`hand_over`].
#[inline(always)]
pub fn hand_over_alone<T: Real>(
    predicted: Vec3<T>,
    range: T,
    los: Vec3<T>,
    sink: &mut impl Sink<T>,
) -> Result<(), ModelError> {
    visible(range)?;
    let none = [[T::zero(); 3]; 3];
    sink.add(&Linearization {
        innovation: sub(los, predicted),
        d_position: none,
        d_velocity: None,
        d_attitude: None,
        sqrt_information: RootWeight::Diagonal([T::one(); 3]),
    });
    Ok(())
}

/// The direction a moving observer sees, and its derivatives along the direction at rest and along the velocity.
#[inline(always)]
pub fn aberrate<T: Real>(u: Vec3<T>, velocity: Vec3<T>) -> (Vec3<T>, Mat3<T>, Mat3<T>) {
    let one = T::one();
    let slowness = T::splat(1.0 / SPEED_OF_LIGHT);
    let beta = scale(slowness, velocity);
    let root = (one - dot(beta, beta)).sqrt();
    let (gamma, k) = (root.recip(), (one + root).recip());
    let s = dot(u, beta);
    let by = (one + s).recip();
    let lift = k.mul_add(s, one);
    let seen = scale(by, scale_add(root, u, scale(lift, beta)));
    let (mut d_direction, mut d_velocity) = ([[T::zero(); 3]; 3], [[T::zero(); 3]; 3]);
    for i in 0..3 {
        for j in 0..3 {
            d_direction[i][j] = (k * beta[i] - seen[i]) * beta[j];
            // of γ⁻¹ u, of β (k u·β), and of the denominator
            let rise = k.mul_add(u[j], s * k * k * gamma * beta[j]);
            d_velocity[i][j] = beta[i] * rise - gamma * u[i] * beta[j] - seen[i] * u[j];
        }
        d_direction[i][i] += root;
        d_velocity[i][i] += lift;
        d_direction[i] = scale(by, d_direction[i]);
        d_velocity[i] = scale(by * slowness, d_velocity[i]);
    }
    (seen, d_direction, d_velocity)
}
