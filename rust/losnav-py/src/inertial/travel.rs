//! Flights: whole arcs of inertial navigation, or a single step as the shortest of them.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::BLOCK;
use losnav_core::math::vec3::Vec3;
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown, StrapdownStep};

use super::belief::{Belief, Craft, NUMBERS};
use super::form::InertialForm;
use super::literal;
use super::look::{Answer, MapPrior, Sight};
use crate::dispatch::{LaneJob, Lanes};
use crate::filter::{Runs, Series, Settings, Source};
use crate::gravity::AnyGravity;

/// One sensor's measurements along the arc, each at the epoch it was exposed.
pub struct Channel<'a> {
    pub source: &'a Source,
    pub slot: usize,
    pub map: Option<&'a MapPrior>,
    pub measurements: Series<'a>,
    pub bounds: Option<[f64; BLOCK]>,
    /// Straight rejections so far.
    pub rejected: f64,
    /// The epoch each exposure is known at; none: the epoch of its exposure, always.
    pub known: Option<Vec<Option<usize>>>,
    /// Remembered pose that measured, of a single step.
    pub key: Option<u64>,
}

/// The stage that estimates the model's error before every update.
#[derive(Clone, Copy, Debug)]
pub struct Predictive {
    /// Inverse variance of that error, s⁴/m².
    pub weight: f64,
    /// Is its uncertainty added to the covariance?
    pub accounted: bool,
    /// Is the series in time expected, as published, and not what the prediction leads to?
    pub literal: bool,
}

/// Process noise that follows the innovations.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    /// Bounds of the factor on the spectral density.
    pub least: f64,
    pub most: f64,
    /// Epochs over which the innovations are averaged.
    pub memory: f64,
}

/// What is asked for.
pub struct Flightplan<'a> {
    /// Time from epoch to epoch, s; zero: none.
    pub steps: Vec<f64>,
    /// Equal steps each of them is made of.
    pub substeps: usize,
    /// Specific force and rate of every substep.
    pub controls: Series<'a>,
    pub channels: Vec<Channel<'a>>,
    pub relock_after: f64,
    pub settings: &'a Settings,
    pub predictive: Option<Predictive>,
    pub adaptive: Option<Adaptive>,
    /// Is the first measurement that cannot be taken an error?
    pub strict: bool,
}

/// Where one run is written down.
pub struct Tape<'a> {
    pub state: &'a mut [f64],
    pub covariance: &'a mut [f64],
    pub model_error: &'a mut [f64],
    /// By epoch and sensor.
    pub nis: &'a mut [f64],
    pub dof: &'a mut [f64],
    pub accepted: &'a mut [bool],
    /// By epoch and number of the measurements.
    pub innovation: &'a mut [f64],
    pub used: &'a mut [bool],
    /// State and covariance that each measurement met, of a single step.
    pub prior: Option<&'a mut Vec<f64>>,
}

impl Tape<'_> {
    /// The same for a shorter time.
    pub fn reborrow(&mut self) -> Tape<'_> {
        Tape {
            state: self.state,
            covariance: self.covariance,
            model_error: self.model_error,
            nis: self.nis,
            dof: self.dof,
            accepted: self.accepted,
            innovation: self.innovation,
            used: self.used,
            prior: None,
        }
    }
}

/// Why a flight ended early.
#[derive(Clone, Copy, Debug)]
pub enum Mishap {
    Undefined(ModelError),
    Prediction,
    Update,
}

/// One run.
pub struct Flight<'a, F: InertialForm, const N: usize> {
    pub model: &'a Strapdown<AnyGravity>,
    pub plan: &'a Flightplan<'a>,
    /// Of the size that flies.
    pub settings: &'a Settings,
    pub run: usize,
    pub belief: &'a mut Belief,
    pub tape: Tape<'a>,
    /// Straight rejections at the end, by sensor.
    pub rejected: &'a mut [f64],
    pub form: core::marker::PhantomData<F>,
}

impl<F: InertialForm, const N: usize> LaneJob for Flight<'_, F, N> {
    type Output = Result<(), Mishap>;

    #[inline(always)]
    fn run<V: Lanes>(mut self) -> Self::Output {
        let mut craft = Craft::<V, F, N>::load(self.belief);
        let mut model = self.model.clone();
        let mut prepared: Option<(f64, StrapdownStep)> = None;
        for epoch in 0..self.plan.steps.len() {
            let dt = self.plan.steps[epoch] / self.plan.substeps as f64;
            if dt != 0.0 {
                let step = match prepared {
                    Some((length, step)) if length == dt => step,
                    _ => DynamicsModel::<V, N>::prepare(&model, 0.0, dt),
                };
                prepared = Some((dt, step));
                model.noise.acceleration = self.model.noise.acceleration * craft.adapted[0];
                for substep in 0..self.plan.substeps {
                    let sample = self.sample(epoch * self.plan.substeps + substep);
                    if self.plan.predictive.is_some_and(|stage| stage.literal) {
                        literal::note::<V, N>(&mut craft.start, &craft.state, &sample);
                    }
                    craft.predict(&model, &step, sample);
                }
                if !craft.is_sound() && self.plan.strict {
                    return Err(Mishap::Prediction);
                }
            }
            self.measure(&mut craft, epoch)?;
            // Of a single step the estimate itself is what is left.
            if !self.plan.strict {
                self.write(&craft, epoch);
            }
        }
        craft.store(self.belief);
        Ok(())
    }
}

/// Key of a pose remembered for the exposure of one sensor at one epoch.
fn key(channel: usize, epoch: usize) -> u64 {
    (1 << 63) | ((channel as u64) << 40) | epoch as u64
}

impl<'a, F: InertialForm, const N: usize> Flight<'a, F, N> {
    /// What the unit showed over a substep.
    #[inline(always)]
    fn sample<V: Lanes>(&self, substep: usize) -> ImuSample<V> {
        let mut six = [V::zero(); 6];
        self.plan.controls.read(Runs { first: self.run, last: self.run }, substep, &mut six);
        let [a, b, c, d, e, f] = six;
        let (specific_force, angular_rate): (Vec3<V>, Vec3<V>) = ([a, b, c], [d, e, f]);
        ImuSample { specific_force, angular_rate }
    }

    #[inline(always)]
    fn numbers<V: Lanes>(&self, channel: &Channel<'_>, epoch: usize) -> Vec<V> {
        let mut z = vec![V::zero(); channel.source.rows];
        channel.measurements.read(Runs { first: self.run, last: self.run }, epoch, &mut z);
        z
    }

    /// Everything that happens at an epoch.
    #[inline(always)]
    fn measure<V: Lanes>(&mut self, craft: &mut Craft<V, F, N>, epoch: usize) -> Result<(), Mishap> {
        let plan = self.plan;
        for (index, channel) in plan.channels.iter().enumerate() {
            let later = channel.known.as_ref().and_then(|known| known.get(epoch)).copied().flatten();
            if later.is_some_and(|later| later > epoch) {
                let z: Vec<V> = self.numbers(channel, epoch);
                if z.iter().any(|value| !value.lane(0).is_nan()) {
                    craft.remember(key(index, epoch));
                }
            }
        }
        if let Some(stage) = plan.predictive {
            let now = plan.channels.iter().filter(|channel| channel.known.is_none() && channel.key.is_none());
            let looks = now.map(|channel| (self.sight(channel), self.numbers(channel, epoch)));
            // Where a sensor is undefined the update says so.
            let _ = craft.correct_model(looks, &stage, self.model);
        }
        let (mut nis, mut dof) = (0.0, 0);
        // One place where measurements are taken, whenever they were exposed: the kernel is there once.
        for (index, exposure) in self.due(epoch) {
            let channel = &plan.channels[index];
            let late = (exposure < epoch).then(|| key(index, exposure));
            if late.is_some_and(|key| craft.poses.iter().all(|pose| pose.key != key)) {
                continue;
            }
            self.take(craft, (index, channel), exposure, late.or(channel.key))?;
            if let Some(key) = late {
                craft.forget(key);
            }
            let at = exposure * plan.channels.len() + index;
            if late.is_none() && self.tape.accepted[at] {
                nis += self.tape.nis[at];
                dof += self.tape.dof[at] as usize;
            }
        }
        if let Some(adaptive) = plan.adaptive
            && dof > 0
        {
            let mean = craft.adapted[1] + (nis / dof as f64 - craft.adapted[1]) / adaptive.memory;
            let factor = craft.adapted[0] * mean.powf(1.0 / adaptive.memory);
            craft.adapted = [factor.clamp(adaptive.least, adaptive.most), mean];
        }
        Ok(())
    }

    /// Sensors and exposures that are known at an epoch.
    fn due(&self, epoch: usize) -> Vec<(usize, usize)> {
        let mut due = Vec::with_capacity(self.plan.channels.len());
        for (index, channel) in self.plan.channels.iter().enumerate() {
            match &channel.known {
                None => due.push((index, epoch)),
                Some(known) => {
                    // What was exposed earlier is known earlier: those of this epoch are the last that are.
                    let from = due.len();
                    let back = (0..=epoch).rev().map(|k| (k, known.get(k).copied().flatten()));
                    let last = back.take_while(|(_, at)| at.is_none_or(|at| at >= epoch));
                    due.extend(last.filter(|(_, at)| *at == Some(epoch)).map(|(k, _)| (index, k)));
                    due[from..].reverse();
                }
            }
        }
        due
    }

    fn sight<'b>(&self, channel: &'b Channel<'b>) -> Sight<'b>
    where
        'a: 'b,
    {
        let (bounds, settings) = (channel.bounds.as_ref(), self.settings);
        Sight { source: channel.source, slot: channel.slot, map: channel.map, bounds, settings }
    }

    /// One measurement of one sensor, written down at the epoch of its exposure.
    #[inline(always)]
    fn take<V: Lanes>(
        &mut self,
        craft: &mut Craft<V, F, N>,
        (index, channel): (usize, &Channel<'_>),
        exposure: usize,
        pose: Option<u64>,
    ) -> Result<(), Mishap> {
        let plan = self.plan;
        let z: Vec<V> = self.numbers(channel, exposure);
        let (sensors, rows) = (plan.channels.len(), channel.source.rows);
        let before: usize = plan.channels.iter().take(index).map(|channel| channel.source.rows).sum();
        let all: usize = plan.channels.iter().map(|channel| channel.source.rows).sum();
        let (at, from) = (exposure * sensors + index, exposure * all + before);
        let mut sight = self.sight(channel);
        if self.rejected[index] >= plan.relock_after {
            sight.bounds = None;
        }
        if let Some(prior) = &mut self.tape.prior {
            craft.write_prior(prior);
        }
        let mut answer = Answer {
            nis: f64::NAN,
            dof: 0,
            accepted: false,
            seen: false,
            innovation: &mut self.tape.innovation[from..from + rows],
            used: &mut self.tape.used[from..from + rows],
        };
        let outcome = craft.look(&sight, &z, pose, &mut answer);
        self.tape.nis[at] = answer.nis;
        self.tape.dof[at] = answer.dof as f64;
        self.tape.accepted[at] = answer.accepted;
        if let Err(error) = outcome {
            answer.innovation.fill(f64::NAN);
            if plan.strict {
                return Err(Mishap::Undefined(error));
            }
        } else if answer.accepted {
            self.rejected[index] = 0.0;
        } else if answer.seen {
            self.rejected[index] += 1.0;
        }
        let whole = z.iter().all(|value| value.lane(0).is_finite());
        if plan.strict && whole && outcome.is_ok() && !(answer.seen && answer.nis.is_finite()) {
            return Err(Mishap::Update);
        }
        Ok(())
    }

    #[inline(always)]
    fn write<V: Lanes>(&mut self, craft: &Craft<V, F, N>, epoch: usize) {
        craft.write_state(&mut self.tape.state[epoch * NUMBERS..(epoch + 1) * NUMBERS]);
        craft.write_covariance(&mut self.tape.covariance[epoch * N * N..(epoch + 1) * N * N]);
        self.tape.model_error[3 * epoch..3 * epoch + 3].copy_from_slice(&craft.model_error);
    }
}
