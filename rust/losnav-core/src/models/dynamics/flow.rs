//! The equation of motion itself, and the path it leads along as a power series in time.
use super::strapdown::{ImuSample, Strapdown};
use super::{DynamicsModel, TwoBody};
use crate::math::jets::Jet;
use crate::math::real::Real;
use crate::math::so3::{dcm_from_quaternion, quaternion_product};
use crate::math::vec3::{Vec3, add, rotate_transposed, scale, splat, sub};
use crate::models::gravity::Gravity;
use crate::models::nav_state::NavState;
use crate::models::state::State;

/// Highest order of a series.
pub const MAX_ORDER: usize = 15;

/// What moves, written so that any number may flow through it: series in time, numbers that carry derivatives, both.
pub trait Flow<T: Real, const N: usize>: DynamicsModel<T, N> {
    /// Are numbers 3 to 5 the rates of numbers 0 to 2? They are of everything that has a position and a velocity.
    const MECHANICAL: bool = true;

    /// Rates of the numbers the state is kept in, at `time`, which may be a series but is the same in all lanes.
    fn rates(&self, time: T, state: &Self::State, control: Self::Control) -> Self::State;
}

/// The state along the flow through `start` at `time` under a constant control, as series: the positions known to `order`
/// at least, everything else too if `all`.
///
/// 1. Of the start only the values are known; of mechanical models so are the rates of the positions.
/// 2. Rates of series known to order `k` are known to order `k`; their integrals to order `k + 1`.
/// 3. Again, until there is enough. Where the acceleration depends on the position alone a round gains two orders.
#[inline(always)]
pub fn expand<T, M, const N: usize, const C: usize>(
    model: &M,
    time: f64,
    start: &M::State,
    control: M::Control,
    order: usize,
    all: bool,
) -> M::State
where
    T: Real,
    M: Flow<Jet<T, C>, N>,
{
    let numbers = <M::State as State<Jet<T, C>, N>>::NUMBERS;
    let now = Jet::time(T::splat(time));
    let mut path = *start;
    for i in 0..numbers {
        path.set_number(i, Jet::start(start.number(i).value()));
    }
    let order = order.min(C - 1);
    for _ in 0..=order {
        if M::MECHANICAL {
            for i in 0..3 {
                path.set_number(i, path.number(3 + i).integral(start.number(i).value()));
            }
        }
        let mut least = order;
        for i in 0..numbers {
            if all || i < 3 {
                least = least.min(path.number(i).order());
            }
        }
        if least == order {
            break;
        }
        let rates = model.rates(now, &path, control);
        for i in 0..numbers {
            if !M::MECHANICAL || i >= 3 {
                path.set_number(i, rates.number(i).integral(start.number(i).value()));
            }
        }
    }
    for i in 0..numbers {
        path.set_number(i, path.number(i).truncated(order));
    }
    path
}

/// `[r v]` at `time`, which may be a series, on the free orbit that goes through `now(t)` at every plain time `t`.
#[inline(always)]
pub fn known_orbit<T: Real>(planet: &TwoBody, now: impl Fn(f64) -> [f64; 6], time: T) -> [T; 6] {
    let start = time.lane(0);
    let fixed = now(start).map(Jet::constant);
    let none = [Jet::constant(0.0); 3];
    let path = expand::<f64, TwoBody, 6, { MAX_ORDER + 1 }>(planet, start, &fixed, none, MAX_ORDER, true);
    let since = time - T::splat(start);
    let mut there = [T::zero(); 6];
    for i in 0..6 {
        there[i] = T::splat(path[i].coefficient(MAX_ORDER));
        for k in (0..MAX_ORDER).rev() {
            there[i] = there[i].mul_add(since, T::splat(path[i].coefficient(k)));
        }
    }
    there
}

impl<T: Real, G: Gravity, const N: usize> Flow<T, N> for Strapdown<G> {
    #[inline(always)]
    fn rates(&self, _time: T, x: &NavState<T>, sample: ImuSample<T>) -> NavState<T> {
        let force = sub(sample.specific_force, x.accelerometer_bias);
        let rate = sub(sample.angular_rate, x.gyroscope_bias);
        let push = add(rotate_transposed(&dcm_from_quaternion(x.attitude), force), x.acceleration);
        // ½ q⊗[ω_b, 0] − ½ [ω, 0]⊗q.
        let pure = |v: Vec3<T>| [v[0], v[1], v[2], T::zero()];
        let own = quaternion_product(x.attitude, pure(rate));
        let frame = quaternion_product(pure(splat(self.site.angular_velocity)), x.attitude);
        let mut rates = NavState::origin();
        rates.position = x.velocity;
        rates.velocity = self.acceleration(x.position, x.velocity, push);
        for i in 0..4 {
            rates.attitude[i] = T::splat(0.5) * (own[i] - frame[i]);
        }
        rates.acceleration = scale(T::splat(-1.0 / self.noise.time_constant), x.acceleration);
        rates
    }
}
