//! Sizes and forms behind one door.
use core::marker::PhantomData;
use std::sync::Mutex;

use losnav_core::estimators::kalman::{Beside, JointCovariance};
use losnav_core::models::dynamics::strapdown::Strapdown;

use super::arcs::Record;
use super::belief::{Belief, Craft};
use super::form::{InertialForm, JosephInertial, UdInertial};
use super::travel::{Flight, Flightplan, Mishap};
use crate::dispatch;
use crate::filter::Settings;
use crate::gravity::AnyGravity;
use crate::threads::share_out;

/// A size and a form, known inside.
pub trait Engine: Send + Sync {
    /// Brings an estimate into the form it is kept in.
    fn rest(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        belief: &mut Belief,
    ) -> Result<(), Mishap>;
    /// May constants stand beside the state?
    fn holds_constants(&self) -> bool;
    /// The covariance behind stored numbers.
    fn matrix(&self, stored: &[f64]) -> Vec<f64>;
    /// With the pose remembered; only where constants may stand beside the state.
    fn remember(&self, belief: Belief, key: u64) -> Belief;
    /// Without that pose; nothing if there is none.
    fn forget(&self, belief: Belief, key: u64) -> Option<Belief>;
    /// One run; straight rejections at its end by sensor.
    fn fly_one(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        belief: &mut Belief,
        record: &mut Record,
    ) -> Result<Vec<f64>, Mishap>;
    /// Many runs, on all cores.
    fn fly(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        beliefs: &mut [Belief],
        record: &mut Record,
    ) -> Vec<f64>;
    /// The estimate after rows of unit noise, their NIS, and whether they were taken.
    fn take(
        &self,
        belief: Belief,
        innovation: &[f64],
        jacobian: &[f64],
        bound: f64,
        settings: &Settings,
    ) -> (Belief, f64, bool);
}

struct Of<F, const N: usize>(PhantomData<F>);

impl<F: InertialForm, const N: usize> Of<F, N> {
    fn run(
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        run: usize,
        belief: &mut Belief,
        tape: super::travel::Tape<'_>,
    ) -> Result<Vec<f64>, Mishap> {
        let mut rejected: Vec<f64> = plan.channels.iter().map(|channel| channel.rejected).collect();
        let form = PhantomData::<F>;
        let flight = Flight::<F, N> { model, plan, run, belief, tape, rejected: &mut rejected, form };
        // Factors are for hard problems, not for speed: one instruction set is enough.
        if F::CONSTANTS {
            dispatch::one(flight)?
        } else {
            dispatch::baseline(flight)?
        }
        Ok(rejected)
    }
}

impl<F: InertialForm, const N: usize> Engine for Of<F, N> {
    fn rest(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        belief: &mut Belief,
    ) -> Result<(), Mishap> {
        self.fly_one(model, plan, belief, &mut Record::new(plan, N, 1))?;
        Ok(())
    }

    fn holds_constants(&self) -> bool {
        F::CONSTANTS
    }

    fn matrix(&self, stored: &[f64]) -> Vec<f64> {
        let belief = Belief::new(&[], stored);
        let craft = Craft::<f64, F, N>::load(&belief, true);
        let mut out = vec![0.0; N * N];
        craft.write_covariance(&mut out);
        out
    }

    fn remember(&self, mut belief: Belief, key: u64) -> Belief {
        let mut craft = Craft::<f64, F, N>::load(&belief, true);
        craft.remember(key);
        craft.store(&mut belief);
        belief
    }

    fn forget(&self, mut belief: Belief, key: u64) -> Option<Belief> {
        let mut craft = Craft::<f64, F, N>::load(&belief, true);
        let known = craft.forget(key);
        craft.store(&mut belief);
        known.then_some(belief)
    }

    fn fly_one(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        belief: &mut Belief,
        record: &mut Record,
    ) -> Result<Vec<f64>, Mishap> {
        match record.tapes().next() {
            Some(tape) => Self::run(model, plan, 0, belief, tape),
            None => Ok(Vec::new()),
        }
    }

    fn fly(
        &self,
        model: &Strapdown<AnyGravity>,
        plan: &Flightplan<'_>,
        beliefs: &mut [Belief],
        record: &mut Record,
    ) -> Vec<f64> {
        let first = Mutex::new(Vec::new());
        let work = beliefs.iter_mut().zip(record.tapes()).enumerate();
        share_out(work, |(run, (belief, tape))| {
            // An arc goes on where a measurement cannot be taken: there is no mishap.
            let rejected = Self::run(model, plan, run, belief, tape).unwrap_or_default();
            if run == 0
                && let Ok(mut first) = first.lock()
            {
                *first = rejected;
            }
        });
        first.into_inner().unwrap_or_default()
    }

    fn take(
        &self,
        mut belief: Belief,
        innovation: &[f64],
        jacobian: &[f64],
        bound: f64,
        settings: &Settings,
    ) -> (Belief, f64, bool) {
        let mut craft = Craft::<f64, F, N>::load(&belief, true);
        let before = craft.core;
        let (mut delta, mut constants) = ([0.0; N], vec![0.0; craft.cross.len()]);
        let (mut room, mut nis) = (constants.clone(), 0.0);
        {
            let mut open = F::open(&mut craft.core, &mut craft.cross, &mut craft.constants);
            for (y, row) in innovation.iter().zip(jacobian.as_chunks::<N>().0) {
                let unexplained = y - (0..N).map(|j| row[j] * delta[j]).sum::<f64>();
                let (variance, gain) = open.absorb(row, &Beside::nothing(), &mut room);
                for i in 0..N {
                    delta[i] += gain[i] * unexplained;
                }
                for (constant, gain) in constants.iter_mut().zip(&room) {
                    *constant += gain * unexplained;
                }
                nis += unexplained * unexplained / variance;
            }
        }
        let considered = settings.options::<N>().consider.unwrap_or([false; N]);
        F::put_back(&mut craft.core, &before, &considered);
        for i in 0..N {
            if considered[i] {
                delta[i] = 0.0;
            }
        }
        craft.inject(&delta, &constants);
        let accepted = nis <= bound && craft.is_sound();
        craft.store(&mut belief);
        (belief, nis, accepted)
    }
}

/// The engine of a form and a size.
pub fn engine(form: &str, size: usize) -> Option<&'static dyn Engine> {
    macro_rules! sizes {
        ($form:ident: $($size:literal)*) => {
            match size {
                $($size => Some(&Of::<$form, $size>(PhantomData)),)*
                _ => None,
            }
        };
    }
    match form {
        "joseph" => sizes! { JosephInertial: 9 12 15 18 },
        "ud" => sizes! { UdInertial: 9 12 15 18 },
        _ => None,
    }
}
