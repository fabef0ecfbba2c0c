//! One step in time, and one measurement of one sensor, of an estimate at work.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{
    Absorbed, BLOCK, Ray, Rays, View, absorb, compress, gate, model_error, underweight,
};
use losnav_core::math::real::{Mask, Real, Work};
use losnav_core::math::so3::{dcm_from_quaternion, exp, normalized, quaternion_product};
use losnav_core::math::vec3::{add, scale, scale_add, splat};
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown, StrapdownStep};
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::{Both, Innovations};
use losnav_core::models::sensors::{Law, SensorModel};
use losnav_core::models::state::State;

use super::belief::{Craft, LANDMARK, Mapped};
use super::form::InertialForm;
use super::literal;
use super::travel::Predictive;
use crate::dispatch::Lanes;
use crate::filter::{Settings, Source};
use crate::gravity::AnyGravity;

/// How the errors of a map are accounted for beside the state.
#[derive(Clone, Debug, PartialEq)]
pub struct MapPrior {
    /// Corrected, or only considered?
    pub estimated: bool,
    /// `(N, 3, 3)`, m².
    pub covariances: Vec<f64>,
}

/// A sensor as it is looked with.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    pub source: &'a Source,
    /// Its number among the sensors of the filter.
    pub slot: usize,
    pub map: Option<&'a MapPrior>,
    /// On the normalised innovation squared of a block of as many rows, less one; none: no gate.
    pub bounds: Option<&'a [f64; BLOCK]>,
    pub settings: &'a Settings,
}

/// What became of a measurement.
pub struct Answer<'a> {
    pub nis: f64,
    pub dof: usize,
    /// Was any of it taken?
    pub accepted: bool,
    /// Was any of it there?
    pub seen: bool,
    pub innovation: &'a mut [f64],
    /// Which of its numbers were taken.
    pub used: &'a mut [bool],
}

/// Has a sensor say all it has to say at one place.
pub struct Speak<'a, V> {
    pub source: &'a Source,
    pub z: &'a [V],
    pub at: Kinematics<V>,
    pub rays: &'a mut [Ray<V>],
    pub innovation: &'a mut [V],
}

/// The listener.
struct Listen<'a, V> {
    at: Kinematics<V>,
    rays: &'a mut [Ray<V>],
    innovation: &'a mut [V],
    outcome: Result<usize, ModelError>,
}

impl<V: Real> Law<V> for Listen<'_, V> {
    #[inline(always)]
    fn examine(&mut self, sensor: &impl SensorModel<V>) {
        let mut rays = Rays::new(self.rays);
        let mut innovation = Innovations::new(self.innovation);
        let done = sensor.linearize(&self.at, &mut Both(&mut rays, &mut innovation));
        self.outcome = done.map(|()| rays.count());
    }
}

impl<V: Real> Work for Speak<'_, V> {
    type Output = Result<usize, ModelError>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { source, z, at, rays, innovation } = self;
        let mut listen = Listen { at, rays, innovation, outcome: Ok(0) };
        source.show(&[], z, &mut listen);
        listen.outcome
    }
}

/// Drops blocks with a number that is none; how many rows are left.
fn present<V: Lanes>(rays: &mut [Ray<V>]) -> usize {
    let (mut from, mut kept) = (0, 0);
    while from < rays.len() {
        let block = rays[from].block;
        let end = from + rays[from..].iter().take_while(|ray| ray.block == block).count();
        if rays[from..end].iter().all(|ray| ray.innovation.is_finite().any()) {
            rays.copy_within(from..end, kept);
            kept += end - from;
        }
        from = end;
    }
    kept
}

impl<V: Lanes, F: InertialForm, const N: usize> Craft<V, F, N> {
    /// A step in time.
    #[inline(always)]
    pub fn predict(&mut self, model: &Strapdown<AnyGravity>, step: &StrapdownStep, sample: ImuSample<V>) {
        let (state, transition, noise) = DynamicsModel::<V, N>::predict(model, step, &self.state, sample);
        F::propagate(&mut self.core, &mut self.cross, model, step, &transition, &noise);
        self.state = state;
        self.since += step.dt;
    }

    /// Is everything finite?
    #[inline(always)]
    pub fn is_sound(&self) -> bool {
        State::<V, N>::is_finite(&self.state).and(F::is_finite(&self.core)).any()
    }

    /// Where a pose, or the state, stands after a correction.
    #[inline(always)]
    fn kinematics(&self, key: Option<u64>, delta: &[V; N], constants: &[V]) -> Kinematics<V> {
        let Some(pose) = key.and_then(|key| self.poses.iter().find(|pose| pose.key == key)) else {
            let moved = self.state.inject(delta);
            return State::<V, N>::kinematics(&moved, &[[V::zero(); 3]; 3]);
        };
        let [x, y, z, a, b, c, w] = pose.pose.map(V::splat);
        let part = |k: usize| constants.get(pose.at + k).copied().unwrap_or(V::zero());
        let turn = exp([part(3), part(4), part(5)]);
        let attitude = normalized(quaternion_product([a, b, c, w], turn));
        // Its velocity was not remembered.
        Kinematics {
            position: add([x, y, z], [part(0), part(1), part(2)]),
            velocity: splat([f64::NAN; 3]),
            dcm: dcm_from_quaternion(attitude),
        }
    }

    /// Rows of a sensor after a correction; `z ⊟ h(x)` goes to `innovation`.
    #[inline(always)]
    fn rays(
        &self,
        sight: &Sight<'_>,
        key: Option<u64>,
        z: &[V],
        correction: (&[V; N], &[V]),
        innovation: &mut [V],
    ) -> Result<Vec<Ray<V>>, ModelError> {
        let at = self.kinematics(key, correction.0, correction.1);
        let mut rays = vec![Ray::zero(); sight.source.rows];
        let source = self.with_map(sight, correction.1);
        let source = source.as_ref().unwrap_or(sight.source);
        let count = V::apart(Speak { source, z, at, rays: &mut rays, innovation })?;
        rays.truncate(count);
        let count = present(&mut rays);
        rays.truncate(count);
        Ok(rays)
    }

    /// The sensor with its landmarks where they are believed to be; nothing where that is where they were.
    fn with_map(&self, sight: &Sight<'_>, constants: &[V]) -> Option<Source> {
        if !sight.map?.estimated {
            return None;
        }
        let mut source = sight.source.clone();
        for known in self.map.iter().filter(|known| known.slot == sight.slot) {
            let change = |c: usize| constants.get(known.at + c).map_or(0.0, |v| v.lane(0));
            let by = [0, 1, 2].map(|c| known.correction[c] + change(c));
            source.shift(known.landmark, by);
        }
        Some(source)
    }

    /// First constant of every landmark of a sensor; those just seen for the first time join.
    fn places(&mut self, sight: &Sight<'_>, rays: &[Ray<V>]) -> Vec<usize> {
        let Some(prior) = sight.map else { return Vec::new() };
        for index in rays.iter().filter_map(|ray| ray.landmark) {
            let own = |known: &Mapped| known.slot == sight.slot && known.landmark == index;
            if self.map.iter().any(own) {
                continue;
            }
            let Some(flat) = prior.covariances.as_chunks::<9>().0.get(index) else { continue };
            let [a, b, c, d, e, f, g, h, i] = *flat;
            let at = self.append::<LANDMARK>(None, &[[a, b, c], [d, e, f], [g, h, i]]);
            let (slot, estimated) = (sight.slot, prior.estimated);
            self.map.push(Mapped { slot, landmark: index, at, estimated, correction: [0.0; 3] });
        }
        let mut places = vec![usize::MAX; sight.source.rows / sight.source.block()];
        for known in self.map.iter().filter(|known| known.slot == sight.slot) {
            if let Some(place) = places.get_mut(known.landmark) {
                *place = known.at;
            }
        }
        places
    }

    /// Takes what a sensor measured, now or at a remembered pose.
    ///
    /// 1. Linearise at the prior, write the rows down, bring landmarks that are new into the joint covariance.
    /// 2. Judge every block by itself.
    /// 3. Take the rows: once, or at the state each pass leads to.
    /// 4. Give what is only considered back what it had, correct everything, or nothing if the result is not finite.
    #[inline(always)]
    pub fn look(
        &mut self,
        sight: &Sight<'_>,
        z: &[V],
        key: Option<u64>,
        answer: &mut Answer<'_>,
    ) -> Result<(), ModelError> {
        let zero = [V::zero(); N];
        let mut innovation = vec![V::zero(); sight.source.rows];
        let mut rays = self.rays(sight, key, z, (&zero, &[]), &mut innovation)?;
        for (out, value) in answer.innovation.iter_mut().zip(&innovation) {
            *out = value.lane(0);
        }
        answer.seen = !rays.is_empty();
        let places = self.places(sight, &rays);
        let pose = key.and_then(|key| self.poses.iter().find(|pose| pose.key == key)).map(|pose| pose.at);
        let view = View { pose, landmarks: &places };
        let mut room = vec![V::zero(); self.cross.len()];
        answer.dof = rays.len();
        answer.nis = self.judge(sight, &view, &mut rays, &mut room, answer.used);
        if !rays.is_empty() {
            answer.dof = rays.len();
        }
        if rays.is_empty() {
            return Ok(());
        }
        let before = (self.core, self.cross.clone(), self.constants.clone());
        let settings = sight.settings;
        let underweighted = u32::from(settings.underweighting > 0.0);
        let plain = pose.is_none() && places.is_empty() && sight.source.block() < sight.source.rows;
        let (mut delta, mut constants) = (zero, vec![V::zero(); self.cross.len()]);
        for pass in 0..settings.iterations.max(1) + underweighted {
            let mut base = (zero, vec![V::zero(); self.cross.len()]);
            let mut taken = rays.clone();
            if pass > underweighted {
                base = (delta, constants.clone());
                taken = self.rays(sight, key, z, (&delta, &constants), &mut innovation)?;
                taken.retain(|ray| rays.iter().any(|kept| kept.block == ray.block));
            }
            if pass > 0 {
                (self.core, self.cross, self.constants) = (before.0, before.1.clone(), before.2.clone());
            }
            let mut open = F::open(&mut self.core, &mut self.cross, &mut self.constants);
            if pass > 0 && underweighted > 0 {
                underweight(&open, &mut taken, &view, settings.underweighting, &mut room);
            }
            let mut unexplained = V::zero();
            if plain && taken.len() > 6 && pass <= underweighted {
                let few;
                (few, unexplained) = compress(&mut taken);
                taken.truncate(few);
            }
            constants.fill(V::zero());
            let mut out = Absorbed { delta: zero, constants: &mut constants, nis: unexplained, dof: 0 };
            absorb(&mut open, &taken, &view, (&base.0, &base.1), &mut room, &mut out);
            delta = out.delta;
            if pass == 0 {
                answer.nis = out.nis.lane(0);
            }
        }
        self.put_back(settings, &before, &mut delta, &mut constants);
        let kept = (self.state, self.poses.clone(), self.map.clone());
        self.inject(&delta, &constants);
        answer.accepted = answer.nis.is_finite() && self.is_sound();
        if !answer.accepted {
            (self.core, self.cross, self.constants) = before;
            (self.state, self.poses, self.map) = kept;
            answer.used.fill(false);
        }
        Ok(())
    }

    /// Judges the blocks: which numbers of the measurement remain goes to `used`, the sum of their normalised innovations
    /// squared is returned, or NaN where nobody asked.
    #[inline(always)]
    fn judge(
        &mut self,
        sight: &Sight<'_>,
        view: &View<'_>,
        rays: &mut Vec<Ray<V>>,
        room: &mut [V],
        used: &mut [bool],
    ) -> f64 {
        let (size, mut total) = (sight.source.block(), f64::NAN);
        used.fill(false);
        if let Some(bounds) = sight.bounds {
            let open = F::open(&mut self.core, &mut self.cross, &mut self.constants);
            let (kept, sum) = gate(&open, rays, view, bounds, room);
            rays.truncate(kept);
            total = sum.lane(0);
        }
        for ray in rays.iter() {
            let from = if size == sight.source.rows { 0 } else { ray.block * size };
            if let Some(numbers) = used.get_mut(from..from + size) {
                numbers.fill(true);
            }
        }
        total
    }

    /// Schmidt: what is considered keeps its place and its covariance.
    #[inline(always)]
    fn put_back(
        &mut self,
        settings: &Settings,
        before: &(F::Core<V, N>, Vec<[V; N]>, Vec<V>),
        delta: &mut [V; N],
        constants: &mut [V],
    ) {
        let considered = settings.options::<N>().consider.unwrap_or([false; N]);
        if considered.contains(&true) {
            F::put_back(&mut self.core, &before.0, &considered);
        }
        let size = constants.len();
        let mut still = vec![false; size];
        for known in self.map.iter().filter(|known| !known.estimated) {
            still[known.at..known.at + LANDMARK].fill(true);
        }
        for i in 0..N {
            if considered[i] {
                delta[i] = V::zero();
            }
        }
        for i in (0..size).filter(|i| still[*i]) {
            constants[i] = V::zero();
            for j in (0..size).filter(|j| still[*j]) {
                self.constants[i * size + j] = before.2[i * size + j];
            }
            for j in (0..N).filter(|j| considered[*j]) {
                self.cross[i][j] = before.1[i][j];
            }
        }
    }

    /// Estimates the acceleration that the model lacks from what the sensors say of the state it led to, and moves the
    /// state to where that acceleration would have led; if no sensor speaks of velocity, nothing.
    #[inline(always)]
    pub fn correct_model<'a>(
        &mut self,
        looks: impl Iterator<Item = (Sight<'a>, Vec<V>)>,
        stage: &Predictive,
        model: &Strapdown<AnyGravity>,
    ) -> Result<(), ModelError> {
        let zero = [V::zero(); N];
        let mut all: Vec<Ray<V>> = Vec::new();
        let start = core::mem::take(&mut self.start);
        let path = if stage.literal { literal::path(model, &start) } else { None };
        for (sight, z) in looks {
            let mut innovation = vec![V::zero(); sight.source.rows];
            let mut rays = self.rays(&sight, None, &z, (&zero, &[]), &mut innovation)?;
            if let Some(path) = &path {
                literal::replace(sight.source, &z, path, self.since, &mut rays)?;
            }
            let places = self.places(&sight, &rays);
            let view = View { pose: None, landmarks: &places };
            let mut room = vec![V::zero(); self.cross.len()];
            let mut used = vec![false; sight.source.rows];
            self.judge(&sight, &view, &mut rays, &mut room, &mut used);
            all.extend(rays);
        }
        if all.is_empty() {
            self.start = start;
            return Ok(());
        }
        let speaks = |ray: &Ray<V>| ray.velocity().iter().any(|v| v.lane(0) != 0.0);
        let dt = core::mem::take(&mut self.since);
        if dt == 0.0 || !all.iter().any(speaks) {
            self.model_error = [0.0; 3];
            return Ok(());
        }
        let (error, covariance) = model_error(&all, dt, stage.weight);
        self.model_error = error.map(|v| v.lane(0));
        let (half, dt) = (V::splat(0.5 * dt * dt), V::splat(dt));
        self.state.position = scale_add(half, error, self.state.position);
        self.state.velocity = add(scale(dt, error), self.state.velocity);
        if stage.accounted {
            let full = covariance.full();
            let mut p = F::matrix(&self.core);
            for (i, a) in [(0, half), (3, dt)] {
                for (j, b) in [(0, half), (3, dt)] {
                    for m in 0..3 {
                        for n in 0..3 {
                            p[i + m][j + n] += a * b * full[m][n];
                        }
                    }
                }
            }
            self.core = F::read(&p, false);
        }
        Ok(())
    }
}
