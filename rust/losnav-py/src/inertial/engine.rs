//! Sizes and forms behind one door: flights in the size they have where the processor is fast, everything else in the
//! largest.
use core::marker::PhantomData;
use std::sync::Mutex;

use losnav_core::estimators::kalman::{Beside, Covariance, JointCovariance, Ud};
use losnav_core::models::dynamics::strapdown::Strapdown;

use super::arcs::Record;
use super::belief::{Belief, Craft};
use super::form::{InertialForm, JosephInertial, UdInertial};
use super::travel::{Flight, Flightplan, Mishap, Tape};
use super::wide::{self, WIDE};
use crate::dispatch;
use crate::filter::Settings;
use crate::gravity::AnyGravity;
use crate::threads::share_out;

type Model = Strapdown<AnyGravity>;
type Run = fn(&Model, &Flightplan<'_>, usize, &mut Belief, Tape<'_>) -> Result<Vec<f64>, Mishap>;

/// A size and a form.
#[derive(Clone, Copy)]
pub struct Engine {
    size: usize,
    /// Is the covariance kept in factors?
    factors: bool,
    /// Flights in the very size; none: in the largest.
    run: Option<Run>,
}

/// A flight in the very size, by the widest instructions there are.
fn swift<const N: usize>(
    model: &Model,
    plan: &Flightplan<'_>,
    run: usize,
    belief: &mut Belief,
    tape: Tape<'_>,
) -> Result<Vec<f64>, Mishap> {
    let mut rejected: Vec<f64> = plan.channels.iter().map(|channel| channel.rejected).collect();
    let (settings, form) = (plan.settings, PhantomData::<JosephInertial>);
    let flight = Flight::<_, N> { model, plan, settings, run, belief, tape, rejected: &mut rejected, form };
    // Chosen only where there are such instructions.
    dispatch::fused(flight).unwrap_or(Err(Mishap::Prediction))?;
    Ok(rejected)
}

/// A flight in the largest size.
fn wide<F: InertialForm>(
    n: usize,
    (model, plan): (&Model, &Flightplan<'_>),
    run: usize,
    belief: &mut Belief,
    mut tape: Tape<'_>,
) -> Result<Vec<f64>, Mishap> {
    let mut rejected: Vec<f64> = plan.channels.iter().map(|channel| channel.rejected).collect();
    let (model, settings) = (&wide::model(model, n), &wide::settings(plan.settings, n));
    let mut all = wide::widened(belief, n);
    let mut covariance = vec![0.0; tape.covariance.len() / (n * n) * WIDE * WIDE];
    let mut prior = tape.prior.as_ref().map(|_| Vec::new());
    let flight = Flight::<F, WIDE> {
        model,
        plan,
        settings,
        run,
        belief: &mut all,
        tape: Tape { covariance: &mut covariance, prior: prior.as_mut(), ..tape.reborrow() },
        rejected: &mut rejected,
        form: PhantomData,
    };
    dispatch::baseline(flight)?;
    *belief = wide::narrowed(all, n);
    for (out, matrix) in tape.covariance.chunks_exact_mut(n * n).zip(covariance.chunks_exact(WIDE * WIDE)) {
        out.copy_from_slice(&wide::pick_square(matrix, n));
    }
    if let (Some(out), Some(prior)) = (tape.prior, prior) {
        out.extend(wide::pick_prior(&prior, n));
    }
    Ok(rejected)
}

impl Engine {
    /// The engine of a form and a size, if there are such.
    pub fn new(form: &str, size: usize) -> Option<Self> {
        let swift: Run = match size {
            9 => swift::<9>,
            12 => swift::<12>,
            15 => swift::<15>,
            18 => swift::<18>,
            _ => return None,
        };
        let factors = match form {
            "joseph" => false,
            "ud" => true,
            _ => return None,
        };
        let run = (!factors && dispatch::has_fused()).then_some(swift);
        Some(Self { size, factors, run })
    }

    /// May constants stand beside the state?
    pub fn holds_constants(self) -> bool {
        !self.factors
    }

    /// The numbers a covariance is kept in.
    pub fn stored(self, covariance: &[f64]) -> Vec<f64> {
        if !self.factors {
            return covariance.to_vec();
        }
        let factors = Ud::<f64, WIDE>::new(&square(&wide::spread_square(covariance, self.size)));
        wide::pick_square(Covariance::stored(&factors).as_flattened(), self.size)
    }

    /// The covariance behind stored numbers.
    pub fn matrix(self, stored: &[f64]) -> Vec<f64> {
        if !self.factors {
            return stored.to_vec();
        }
        let factors = Ud::<f64, WIDE>::from_stored(square(&wide::spread_square(stored, self.size)));
        wide::pick_square(Covariance::matrix(&factors).as_flattened(), self.size)
    }

    /// With the pose remembered; only where constants may stand beside the state.
    pub fn remember(self, belief: &Belief, key: u64) -> Belief {
        let mut all = wide::widened(belief, self.size);
        let mut craft = Craft::<f64, JosephInertial, WIDE>::load(&all);
        craft.remember(key);
        craft.store(&mut all);
        wide::narrowed(all, self.size)
    }

    /// Without that pose; nothing if there is none.
    pub fn forget(self, belief: &Belief, key: u64) -> Option<Belief> {
        let mut all = wide::widened(belief, self.size);
        let mut craft = Craft::<f64, JosephInertial, WIDE>::load(&all);
        let known = craft.forget(key);
        craft.store(&mut all);
        known.then(|| wide::narrowed(all, self.size))
    }

    fn run(
        self,
        (model, plan): (&Model, &Flightplan<'_>),
        run: usize,
        belief: &mut Belief,
        tape: Tape<'_>,
    ) -> Result<Vec<f64>, Mishap> {
        match self.run {
            Some(swift) => swift(model, plan, run, belief, tape),
            None if self.factors => wide::<UdInertial>(self.size, (model, plan), run, belief, tape),
            None => wide::<JosephInertial>(self.size, (model, plan), run, belief, tape),
        }
    }

    /// One run; straight rejections at its end by sensor.
    pub fn fly_one(
        self,
        model: &Model,
        plan: &Flightplan<'_>,
        belief: &mut Belief,
        record: &mut Record,
    ) -> Result<Vec<f64>, Mishap> {
        match record.tapes().next() {
            Some(tape) => self.run((model, plan), 0, belief, tape),
            None => Ok(Vec::new()),
        }
    }

    /// Many runs, on all cores; straight rejections at the end of the first.
    pub fn fly(
        self,
        model: &Model,
        plan: &Flightplan<'_>,
        beliefs: &mut [Belief],
        record: &mut Record,
    ) -> Vec<f64> {
        let first = Mutex::new(Vec::new());
        let work = beliefs.iter_mut().zip(record.tapes()).enumerate();
        share_out(work, |(run, (belief, tape))| {
            // An arc goes on where a measurement cannot be taken: there is no mishap.
            let rejected = self.run((model, plan), run, belief, tape).unwrap_or_default();
            if run == 0
                && let Ok(mut first) = first.lock()
            {
                *first = rejected;
            }
        });
        first.into_inner().unwrap_or_default()
    }

    /// The estimate after rows of unit noise `(M, n)`, their NIS, and whether they were taken.
    pub fn take(
        self,
        belief: &Belief,
        innovation: &[f64],
        jacobian: &[f64],
        bound: f64,
        settings: &Settings,
    ) -> (Belief, f64, bool) {
        let all = wide::widened(belief, self.size);
        let (jacobian, settings) = (wide::spread(jacobian, self.size), wide::settings(settings, self.size));
        let given = (innovation, jacobian.as_slice());
        let (all, nis, accepted) = if self.factors {
            take::<UdInertial>(all, given, bound, &settings)
        } else {
            take::<JosephInertial>(all, given, bound, &settings)
        };
        (wide::narrowed(all, self.size), nis, accepted)
    }
}

fn square(data: &[f64]) -> [[f64; WIDE]; WIDE] {
    core::array::from_fn(|i| core::array::from_fn(|j| data[i * WIDE + j]))
}

fn take<F: InertialForm>(
    mut belief: Belief,
    (innovation, jacobian): (&[f64], &[f64]),
    bound: f64,
    settings: &Settings,
) -> (Belief, f64, bool) {
    let mut craft = Craft::<f64, F, WIDE>::load(&belief);
    let before = craft.core;
    let (mut delta, mut constants) = ([0.0; WIDE], vec![0.0; craft.cross.len()]);
    let (mut room, mut nis) = (constants.clone(), 0.0);
    {
        let mut open = F::open(&mut craft.core, &mut craft.cross, &mut craft.constants);
        for (y, row) in innovation.iter().zip(jacobian.as_chunks::<WIDE>().0) {
            let unexplained = y - (0..WIDE).map(|j| row[j] * delta[j]).sum::<f64>();
            let (variance, gain) = open.absorb(row, &Beside::nothing(), &mut room);
            for i in 0..WIDE {
                delta[i] += gain[i] * unexplained;
            }
            for (constant, gain) in constants.iter_mut().zip(&room) {
                *constant += gain * unexplained;
            }
            nis += unexplained * unexplained / variance;
        }
    }
    let considered = settings.options::<WIDE>().consider.unwrap_or([false; WIDE]);
    if considered.contains(&true) {
        F::put_back(&mut craft.core, &before, &considered);
    }
    for i in 0..WIDE {
        if considered[i] {
            delta[i] = 0.0;
        }
    }
    craft.inject(&delta, &constants);
    let accepted = nis <= bound && craft.is_sound();
    craft.store(&mut belief);
    (belief, nis, accepted)
}
