//! Normal equations of a pose: the sink least squares and Fisher information share.
//!
//! Tangent `[δp', δα]`, both in **body** axes (`p' = dcm p`): there the attitude drops out of every term and, with
//! `P = I − hhᵀ`, a direction of scalar weight `w` adds (about 95 flops instead of the 250 of three dense rows)
//!
//! `H_pp += w P/ρ²`,  `H_αα += w P`,  `H_pα −= w [h×]/ρ`,  `g_p −= w P e/ρ`,  `g_α += w e×h`.
//!
//! The true Hessian of the cost adds, for every `v = W e`, `e = b − h`,
//!
//! `H_αα += (v·h) I − sym(v hᵀ)`,  `H_pp += ((v·h)(I − 3hhᵀ) + v hᵀ + h vᵀ)/ρ²`,  `H_pα −= P [v×]/ρ`.
use crate::estimators::loss::Loss;
use crate::math::real::Real;
use crate::math::sym6::{Sym6, index};
use crate::math::vec3::{Mat3, Vec3, cross, dot, rotate, rotate_transposed, scale, sub};
use crate::models::linearization::{Direction, Linearization, Sink, Weight};

/// Cost, gradient and Gauss–Newton matrix at one pose.
#[derive(Clone, Copy, Debug)]
pub struct NormalEquations<T> {
    /// `½ Σ ρ(eᵀ W e)`.
    pub cost: T,
    /// `Hᵀ W y`, minus the gradient of the cost.
    pub gradient: [T; 6],
    /// `Hᵀ W H`.
    pub hessian: Sym6<T>,
}

/// Accumulates [`NormalEquations`] at one attitude and loss.
#[derive(Clone, Copy, Debug)]
pub struct NormalEquationsSink<'a, T, L> {
    dcm: &'a Mat3<T>,
    loss: L,
    cost2: T,
    g_position: Vec3<T>,
    g_attitude: Vec3<T>,
    /// Upper triangles `[00 01 02 11 12 22]`.
    pp: [T; 6],
    aa: [T; 6],
    /// `Σ w h/ρ`: the skew matrix that is all of `H_pα` for scalar weights.
    skew: Vec3<T>,
    /// What is not skew in `H_pα` (full weights, second-order terms).
    pa: Mat3<T>,
}

impl<'a, T: Real, L: Loss> NormalEquationsSink<'a, T, L> {
    /// Nothing added yet.
    #[inline(always)]
    pub fn new(dcm: &'a Mat3<T>, loss: L) -> Self {
        let o = T::zero();
        Self {
            dcm,
            loss,
            cost2: o,
            g_position: [o; 3],
            g_attitude: [o; 3],
            pp: [o; 6],
            aa: [o; 6],
            skew: [o; 3],
            pa: [[o; 3]; 3],
        }
    }

    /// The sums as one system.
    #[inline(always)]
    pub fn finish(self) -> NormalEquations<T> {
        let (p, a, s, m) = (&self.pp, &self.aa, &self.skew, &self.pa);
        let (gp, ga) = (&self.g_position, &self.g_attitude);
        #[rustfmt::skip]
        let hessian = Sym6([
            p[0], p[1], p[2], m[0][0],        m[0][1] + s[2], m[0][2] - s[1],
                  p[3], p[4], m[1][0] - s[2], m[1][1],        m[1][2] + s[0],
                        p[5], m[2][0] + s[1], m[2][1] - s[0], m[2][2],
                              a[0],           a[1],           a[2],
                                              a[3],           a[4],
                                                              a[5],
        ]);
        NormalEquations {
            cost: T::splat(0.5) * self.cost2,
            gradient: [gp[0], gp[1], gp[2], ga[0], ga[1], ga[2]],
            hessian,
        }
    }

    /// A direction of scalar weight, straight from `(h, 1/ρ, e)`.
    #[inline(always)]
    fn add_scalar(&mut self, d: &Direction<T>, weight: T) {
        let (h, e, k) = (d.predicted, d.innovation, d.inverse_range);
        let loss = self.loss.at(weight * dot(e, e));
        self.cost2 += loss.rho;
        let w = weight * loss.weight;
        let wk = w * k;
        let wh = scale(w, h);
        let projector = [
            (-wh[0]).mul_add(h[0], w),
            -(wh[0] * h[1]),
            -(wh[0] * h[2]),
            (-wh[1]).mul_add(h[1], w),
            -(wh[1] * h[2]),
            (-wh[2]).mul_add(h[2], w),
        ];
        let kk = k * k;
        for i in 0..6 {
            self.aa[i] += projector[i];
            self.pp[i] = kk.mul_add(projector[i], self.pp[i]);
        }
        let he = dot(h, e);
        let moment = cross(e, h);
        for i in 0..3 {
            self.skew[i] = wk.mul_add(h[i], self.skew[i]);
            self.g_position[i] = (-wk).mul_add((-he).mul_add(h[i], e[i]), self.g_position[i]);
            self.g_attitude[i] = w.mul_add(moment[i], self.g_attitude[i]);
        }
    }

    /// What the true Hessian of the cost has beyond Gauss–Newton's matrix: the curvature of the model, `−v·∂²h` with
    /// `v = ρ' W e`, and that of the loss, `2 ρ'' (Hᵀ W e)(Hᵀ W e)ᵀ`.
    #[inline(always)]
    pub fn add_second_order(&mut self, d: &Direction<T>) {
        let (h, k) = (d.predicted, d.inverse_range);
        let we = match d.weight {
            Weight::Scalar(w) => scale(w, d.innovation),
            Weight::Full(s) => rotate_transposed(&s, rotate(&s, d.innovation)),
        };
        let loss = self.loss.at(dot(d.innovation, we));
        let along = dot(we, h);
        if L::CURVED {
            let slope = scale(-k, sub(we, scale(along, h)));
            self.add_outer(slope, cross(we, h), T::splat(2.0) * loss.curvature);
        }

        let (v, vh, kk) = (scale(loss.weight, we), loss.weight * along, k * k);
        let (half, three_vh) = (T::splat(0.5), T::splat(3.0) * vh);
        let hv = cross(h, v);
        let mut at = 0;
        for i in 0..3 {
            for j in i..3 {
                let sym = v[i].mul_add(h[j], h[i] * v[j]);
                let identity = if i == j { vh } else { T::zero() };
                self.aa[at] += identity - half * sym;
                self.pp[at] = kk.mul_add((-(three_vh * h[i])).mul_add(h[j], identity + sym), self.pp[at]);
                at += 1;
            }
            // −P [v×]/ρ = −([v×] − h (h×v)ᵀ)/ρ
            self.skew[i] = k.mul_add(v[i], self.skew[i]);
            for j in 0..3 {
                self.pa[i][j] = (k * h[i]).mul_add(hv[j], self.pa[i][j]);
            }
        }
    }

    /// `factor · j jᵀ` with `j = [a, b]`.
    #[inline(always)]
    fn add_outer(&mut self, a: Vec3<T>, b: Vec3<T>, factor: T) {
        let mut at = 0;
        for i in 0..3 {
            for j in i..3 {
                self.pp[at] = (factor * a[i]).mul_add(a[j], self.pp[at]);
                self.aa[at] = (factor * b[i]).mul_add(b[j], self.aa[at]);
                at += 1;
            }
            for j in 0..3 {
                self.pa[i][j] = (factor * a[i]).mul_add(b[j], self.pa[i][j]);
            }
        }
    }
}

impl<T: Real, L: Loss> Sink<T> for NormalEquationsSink<'_, T, L> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        // Whitened rows: S y, S H.
        let mut squared = T::zero();
        let mut whitened = [([T::zero(); 3], [T::zero(); 3], T::zero()); M];
        for (index, out) in whitened.iter_mut().enumerate() {
            let row = rows.whitened(index);
            let y = row.innovation;
            squared = y.mul_add(y, squared);
            *out = (rotate(self.dcm, row.d_position), row.d_attitude, y);
        }
        let loss = self.loss.at(squared);
        self.cost2 += loss.rho;
        let (mut ga, mut gb) = ([T::zero(); 3], [T::zero(); 3]);
        for (a, b, y) in whitened {
            for i in 0..3 {
                ga[i] = a[i].mul_add(y, ga[i]);
                gb[i] = b[i].mul_add(y, gb[i]);
            }
            self.add_outer(a, b, loss.weight);
        }
        for i in 0..3 {
            self.g_position[i] = loss.weight.mul_add(ga[i], self.g_position[i]);
            self.g_attitude[i] = loss.weight.mul_add(gb[i], self.g_attitude[i]);
        }
    }

    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, dcm: &Mat3<T>) {
        match direction.weight {
            Weight::Scalar(w) => self.add_scalar(direction, w),
            Weight::Full(_) => self.add(&direction.expand(dcm)),
        }
    }
}

impl<T: Real> NormalEquations<T> {
    /// The same system in the shift of a pivot and the rotation about it: `δp' = η + t × δα`, `t` the pivot seen from
    /// the observer, body axes.
    #[inline(always)]
    #[must_use]
    pub fn about(&self, t: Vec3<T>) -> Self {
        let h = &self.hessian;
        let g = &self.gradient;
        let mut out = *self;
        // Column j of [t×] is t × e_j; products X [t×] have rows x × t.
        let row = |i: usize| [h.at(i, 0), h.at(i, 1), h.at(i, 2)];
        let (p0, p1, p2) = (cross(row(0), t), cross(row(1), t), cross(row(2), t));
        let p = [p0, p1, p2];
        // H_pa' = H_pa + H_pp [t×]
        for i in 0..3 {
            for j in 0..3 {
                out.hessian.0[index(i, 3 + j)] = h.at(i, 3 + j) + p[i][j];
            }
        }
        // H_aa' = H_aa + [t×]' H_pa' + (H_pa)' [t×]
        for i in 0..3 {
            let pa = [h.at(0, 3 + i), h.at(1, 3 + i), h.at(2, 3 + i)];
            let right = cross(pa, t);
            for j in i..3 {
                let column = [out.hessian.at(0, 3 + j), out.hessian.at(1, 3 + j), out.hessian.at(2, 3 + j)];
                let left = cross(column, t);
                out.hessian.0[index(3 + i, 3 + j)] = h.at(3 + i, 3 + j) + right[j] + left[i];
            }
        }
        let lever = cross([g[0], g[1], g[2]], t);
        for i in 0..3 {
            out.gradient[3 + i] = g[3 + i] + lever[i];
        }
        out
    }

    /// The sum over the lanes, in every lane of `S`.
    #[inline(always)]
    pub fn sum_lanes<S: Real>(&self) -> NormalEquations<S> {
        let mut gradient = [S::zero(); 6];
        for i in 0..6 {
            gradient[i] = S::splat(self.gradient[i].sum_lanes());
        }
        NormalEquations { cost: S::splat(self.cost.sum_lanes()), gradient, hessian: self.hessian.sum_lanes() }
    }

    /// The same system for position in reference axes and attitude in another parametrisation:
    /// `δ_old = diag(dcm, M) δ_new`, so `H_new = diag(dcm, M)ᵀ H diag(dcm, M)`.
    #[inline(always)]
    #[must_use]
    pub fn change_of_variables(&self, dcm: &Mat3<T>, m: &Mat3<T>) -> Self {
        let h = |i: usize, j: usize| self.hessian.at(i, j);
        let g = &self.gradient;
        let gp = rotate_transposed(dcm, [g[0], g[1], g[2]]);
        let ga = rotate_transposed(m, [g[3], g[4], g[5]]);
        let mut packed = Sym6::zero();
        let blocks: [&Mat3<T>; 2] = [dcm, m];
        for bi in 0..2 {
            for bj in bi..2 {
                for i in 0..3 {
                    for j in 0..3 {
                        let (r, c) = (3 * bi + i, 3 * bj + j);
                        if r > c {
                            continue;
                        }
                        let mut sum = T::zero();
                        for k in 0..3 {
                            for l in 0..3 {
                                let hkl = h(3 * bi + k, 3 * bj + l);
                                sum = (blocks[bi][k][i] * hkl).mul_add(blocks[bj][l][j], sum);
                            }
                        }
                        packed.0[index(r, c)] = sum;
                    }
                }
            }
        }
        Self { cost: self.cost, gradient: [gp[0], gp[1], gp[2], ga[0], ga[1], ga[2]], hessian: packed }
    }
}
