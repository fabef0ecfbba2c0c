//! One wheel, fast everywhere: the widest instruction set the CPU has, chosen once at run time.
//!
//! A job is written once over lane types and entered through a function compiled for the chosen set. Results differ
//! between sets by rounding; the environment variable `LOSNAV_ISA` (`baseline`, `avx2`, `avx512`) fixes one.
use std::sync::OnceLock;

use losnav_core::math::real::Real;

/// Lanes that can be loaded from one number per problem.
pub trait Lanes: Real {
    /// `pick(i)` in lane `i`.
    fn gather(pick: impl Fn(usize) -> f64) -> Self;
    /// Lane after lane from the front of `data`, NaN beyond its end.
    fn read(data: &[f64]) -> Self;
    /// Lane after lane into `out`.
    fn write(self, out: &mut [f64]);
}

impl Lanes for f64 {
    #[inline(always)]
    fn gather(pick: impl Fn(usize) -> f64) -> Self {
        pick(0)
    }
    #[inline(always)]
    fn read(data: &[f64]) -> Self {
        data.first().copied().unwrap_or(f64::NAN)
    }
    #[inline(always)]
    fn write(self, out: &mut [f64]) {
        if let [out] = out {
            *out = self;
        }
    }
}

/// What the CPU can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// The baseline of the target.
    Baseline,
    /// AVX2 and FMA.
    Avx2,
    /// AVX-512 F, DQ, VL on top.
    Avx512,
}

impl Isa {
    /// The set in use.
    pub fn current() -> Self {
        static CURRENT: OnceLock<Isa> = OnceLock::new();
        *CURRENT.get_or_init(|| {
            let wanted = match std::env::var("LOSNAV_ISA").as_deref() {
                Ok("baseline") => Self::Baseline,
                Ok("avx2") => Self::Avx2,
                _ => Self::Avx512,
            };
            wanted.min(Self::available())
        })
    }

    #[cfg(target_arch = "x86_64")]
    fn available() -> Self {
        use std::arch::is_x86_feature_detected as has;
        if !(has!("avx2") && has!("fma")) {
            Self::Baseline
        } else if has!("avx512f") && has!("avx512dq") && has!("avx512vl") {
            Self::Avx512
        } else {
            Self::Avx2
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn available() -> Self {
        Self::Baseline
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// Work in one kind of lanes: less code than a [`Job`], which is compiled for two kinds each time.
pub trait LaneJob {
    /// What it returns.
    type Output;
    /// Does the work; must be `#[inline(always)]`.
    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs several problems side by side, [`lanes`] of them.
pub fn many<J: LaneJob>(job: J) -> J::Output {
    match Isa::current() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the CPU has the features, `Isa::available` asked.
        Isa::Avx512 => unsafe { x86::avx512_many(job) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Isa::Avx2 => unsafe { x86::avx2_many(job) },
        _ => baseline(job),
    }
}

/// Runs one problem after another.
pub fn one<J: LaneJob>(job: J) -> J::Output {
    match Isa::current() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the CPU has the features, `Isa::available` asked.
        Isa::Avx512 | Isa::Avx2 => unsafe { x86::avx2_one(job) },
        _ => baseline(job),
    }
}

/// Is there a faster set than the baseline for one problem after another?  Where there is but the baseline, it is that.
pub fn has_fused() -> bool {
    !cfg!(target_arch = "x86_64") || Isa::current() > Isa::Baseline
}

/// As [`one`] where [`has_fused`], nothing elsewhere: work that is compiled for one set only.
pub fn fused<J: LaneJob>(job: J) -> Option<J::Output> {
    #[cfg(target_arch = "x86_64")]
    match Isa::current() {
        // SAFETY: the CPU has the features, `Isa::available` asked.
        Isa::Avx512 | Isa::Avx2 => Some(unsafe { x86::avx2_one(job) }),
        Isa::Baseline => None,
    }
    #[cfg(not(target_arch = "x86_64"))]
    Some(baseline(job))
}

/// One problem after another by the baseline's instructions, whatever the CPU has.
#[inline(never)]
pub fn baseline<J: LaneJob>(job: J) -> J::Output {
    job.run::<f64>()
}

/// Problems side by side in [`many`].
pub fn lanes() -> usize {
    match Isa::current() {
        Isa::Avx512 => 8,
        Isa::Avx2 => 4,
        Isa::Baseline => 1,
    }
}

/// Work written once: `V` the lanes, `S` one number. `run` must be `#[inline(always)]`.
pub trait Job {
    /// What it returns.
    type Output;
    /// Does the work.
    fn run<V: Lanes, S: Lanes>(self) -> Self::Output;
}

/// Runs with as many lanes as there are: for throughput.
pub fn wide<J: Job>(job: J) -> J::Output {
    match Isa::current() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the CPU has the features, `Isa::available` asked.
        Isa::Avx512 => unsafe { x86::avx512_wide(job) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Isa::Avx2 => unsafe { x86::avx2(job) },
        _ => job.run::<f64, f64>(),
    }
}

/// Runs with four lanes at most: for the latency of one small problem.
pub fn narrow<J: Job>(job: J) -> J::Output {
    match Isa::current() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the CPU has the features, `Isa::available` asked.
        Isa::Avx512 | Isa::Avx2 => unsafe { x86::avx2(job) },
        _ => job.run::<f64, f64>(),
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Job, LaneJob};
    use crate::lanes::{F64x4, F64x8, Fused};

    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    pub fn avx512_many<J: LaneJob>(job: J) -> J::Output {
        job.run::<F64x8>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2_many<J: LaneJob>(job: J) -> J::Output {
        job.run::<F64x4>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2_one<J: LaneJob>(job: J) -> J::Output {
        job.run::<Fused>()
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2<J: Job>(job: J) -> J::Output {
        job.run::<F64x4, Fused>()
    }

    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    pub fn avx512_wide<J: Job>(job: J) -> J::Output {
        job.run::<F64x8, Fused>()
    }
}
