//! Losses `½ ρ(s)` of a squared whitened residual `s`, and their first two derivatives.
//!
//! `ρ(s) ≈ s` for small `s`; the scale `k` is in units of the noise standard deviation. Sources: Huber 1964;
//! Triggs et al. 2000 (the use of `ρ'`, `ρ''` in least squares); Black & Rangarajan 1996 (Geman–McClure).
use crate::math::real::Real;

/// `ρ`, `ρ'`, `ρ''` at one residual.
#[derive(Clone, Copy, Debug)]
pub struct LossValue<T> {
    /// `ρ(s)`.
    pub rho: T,
    /// `ρ'(s)`: the weight of the residual.
    pub weight: T,
    /// `ρ''(s)`.
    pub curvature: T,
}

/// A loss. Static dispatch: plain least squares costs nothing.
pub trait Loss: Copy + Send + Sync {
    /// Is `ρ''` anywhere different from zero?
    const CURVED: bool;
    /// `ρ(s)` and its derivatives.
    fn at<T: Real>(&self, s: T) -> LossValue<T>;
}

/// Plain least squares, `ρ(s) = s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Squared;

impl Loss for Squared {
    const CURVED: bool = false;

    #[inline(always)]
    fn at<T: Real>(&self, s: T) -> LossValue<T> {
        LossValue { rho: s, weight: T::one(), curvature: T::zero() }
    }
}

/// Which robust loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobustKind {
    /// `s` up to `k²`, then `2k√s − k²`.
    Huber,
    /// `k² ln(1 + s/k²)`.
    Cauchy,
    /// `k²/3 (1 − (1 − s/k²)³)` up to `k²`, then constant.
    Tukey,
    /// `k² s/(k² + s)`.
    GemanMcClure,
}

/// A robust loss with its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robust {
    /// Which loss.
    pub kind: RobustKind,
    /// `k`, in standard deviations.
    pub scale: f64,
}

impl Loss for Robust {
    const CURVED: bool = true;

    #[inline(always)]
    fn at<T: Real>(&self, s: T) -> LossValue<T> {
        let (o, one) = (T::zero(), T::one());
        let k2 = T::splat(self.scale * self.scale);
        match self.kind {
            RobustKind::Huber => {
                let k = T::splat(self.scale);
                let root = T::select(k2.lt(s), s, k2).sqrt();
                let inside = s.le(k2);
                let weight = k / root;
                LossValue {
                    rho: T::select(inside, s, (k + k).mul_add(root, -k2)),
                    weight: T::select(inside, one, weight),
                    curvature: T::select(inside, o, -(T::splat(0.5) * weight / (root * root))),
                }
            }
            RobustKind::Cauchy => {
                let u = one + s / k2;
                LossValue { rho: k2 * u.ln(), weight: one / u, curvature: -(one / (k2 * u * u)) }
            }
            RobustKind::Tukey => {
                let u = (one - s / k2).max(o);
                let third = T::splat(1.0 / 3.0);
                LossValue {
                    rho: third * k2 * (one - u * u * u),
                    weight: u * u,
                    curvature: -(T::splat(2.0) * u / k2),
                }
            }
            RobustKind::GemanMcClure => {
                let u = k2 / (k2 + s);
                LossValue { rho: s * u, weight: u * u, curvature: -(T::splat(2.0) * u * u * u / k2) }
            }
        }
    }
}
