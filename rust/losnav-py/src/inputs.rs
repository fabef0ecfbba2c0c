//! The arguments of a pose solve: shapes, broadcasting, problems one by one. Slices that threads may share.
use losnav_core::math::rotation::mrp_inside;
use losnav_core::math::so3::quaternion_from_mrp;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::LineOfSight;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::convert::{Floats, ScalarOrArray};
use crate::errors::{BadValue, InvalidInputError, shape_error};
use crate::values::{check_coordinates, check_distinct, check_guess, check_unit, full_weight, scalar_weight};

/// Problems one thread takes at a time in [`Problems::map`]: each costs about a microsecond.
const CHUNK: usize = 32;

/// Noise as the caller gave it.
pub enum NoiseArgument<'py> {
    /// `sigma`.
    Sigma(ScalarOrArray<'py>),
    /// `covariance`.
    Covariance(Floats<'py>),
}

/// The arguments, arrays kept alive.
pub struct Arguments<'py> {
    landmarks: Floats<'py>,
    los: Floats<'py>,
    noise: NoiseArgument<'py>,
    guess: Option<Floats<'py>>,
}

impl<'py> Arguments<'py> {
    /// Reads the arrays.
    pub fn new(
        landmarks: &Bound<'py, PyAny>,
        los: &Bound<'py, PyAny>,
        sigma: &Bound<'py, PyAny>,
        covariance: Option<&Bound<'py, PyAny>>,
        guess: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let noise = match covariance {
            Some(value) => NoiseArgument::Covariance(Floats::new(value, "covariance")?),
            None => NoiseArgument::Sigma(ScalarOrArray::new(sigma, "sigma")?),
        };
        Ok(Self {
            landmarks: Floats::new(landmarks, "landmarks")?,
            los: Floats::new(los, "los")?,
            noise,
            guess: guess.map(|value| Floats::new(value, "guess")).transpose()?,
        })
    }

    /// Checks the shapes and lays the problems out.
    pub fn problems(&self, minimum: usize, repeats: Repeats) -> PyResult<Problems<'_>> {
        let landmarks = Part::new("landmarks", "(N, 3) or (..., N, 3)", &self.landmarks, &[None, Some(3)])?;
        let n = landmarks.core[0];
        let los = Part::new("los", "(..., N, 3)", &self.los, &[None, Some(3)])?;
        if los.core[0] != n {
            return Err(InvalidInputError::new_err(format!(
                "los: expected one direction for each of the {n} landmarks, got {}",
                los.core[0]
            )));
        }
        if n < minimum {
            return Err(InvalidInputError::new_err(format!(
                "landmarks: expected at least {minimum} landmarks, got {n}"
            )));
        }
        let noise = noise_part(&self.noise, n)?;
        let guess = match &self.guess {
            Some(a) => Some(Part::new("guess", "(..., 6)", a, &[Some(6)])?),
            None => None,
        };
        let mut shape = Vec::new();
        for part in [Some(&landmarks), Some(&los), noise.as_ref().ok(), guess.as_ref()].into_iter().flatten()
        {
            broadcast_into(&mut shape, part.lead, part.name)?;
        }
        let single = shape.is_empty();
        let count = shape.iter().product();
        let full = matches!(self.noise, NoiseArgument::Covariance(_));
        Ok(Problems {
            n,
            count,
            single,
            landmarks: landmarks.rows(&shape),
            los: los.rows(&shape),
            noise: match noise {
                Err(sigma) => Noise::Common(sigma),
                Ok(part) if full => Noise::Covariance(part.rows(&shape)),
                Ok(part) => Noise::Sigma(part.rows(&shape)),
            },
            guess: guess.map(|part| part.rows(&shape)),
            shape,
            repeats,
        })
    }
}

/// The noise argument with its dimensions, or the one number that it is.
pub fn noise_part<'a>(noise: &'a NoiseArgument<'_>, n: usize) -> PyResult<Result<Part<'a>, f64>> {
    match noise {
        NoiseArgument::Sigma(ScalarOrArray::Scalar(sigma)) => Ok(Err(*sigma)),
        NoiseArgument::Sigma(ScalarOrArray::Array(a)) => {
            // One number for each problem is as good as one for each direction.
            let width = if a.shape().last() == Some(&1) { 1 } else { n };
            let expected = format!("scalar, ({n},), (..., {n}) or (..., 1)");
            Part::new("sigma", &expected, a, &[Some(width)]).map(Ok)
        }
        NoiseArgument::Covariance(a) => {
            let expected = format!("(..., {n}, 3, 3)");
            Part::new("covariance", &expected, a, &[Some(n), Some(3), Some(3)]).map(Ok)
        }
    }
}

/// One argument: leading dimensions and core.
pub struct Part<'a> {
    /// Its name.
    pub name: &'static str,
    /// Leading dimensions.
    pub lead: &'a [usize],
    /// The others.
    pub core: &'a [usize],
    data: &'a [f64],
}

impl<'a> Part<'a> {
    /// Splits the dimensions; `None` in `core` takes any extent.
    pub fn new(
        name: &'static str,
        expected: &str,
        array: &'a Floats<'_>,
        core: &[Option<usize>],
    ) -> PyResult<Self> {
        let shape = array.shape();
        let error = || shape_error(name, expected, shape);
        let split = shape.len().checked_sub(core.len()).ok_or_else(error)?;
        let (lead, tail) = shape.split_at(split);
        if tail.iter().zip(core).any(|(got, want)| want.is_some_and(|want| want != *got)) {
            return Err(error());
        }
        Ok(Self { name, lead, core: tail, data: array.data() })
    }

    /// Its rows in a batch of this shape.
    pub fn rows(&self, shape: &[usize]) -> Rows<'a> {
        let size = self.core.iter().product();
        let offsets = if self.lead.iter().all(|d| *d == 1) {
            Offsets::Shared
        } else if self.lead == shape {
            Offsets::Each
        } else {
            Offsets::Table(broadcast_table(self.lead, shape))
        };
        Rows { data: self.data, size, offsets }
    }
}

/// Widens `shape` by the leading dimensions of one more argument.
pub fn broadcast_into(shape: &mut Vec<usize>, lead: &[usize], name: &str) -> PyResult<()> {
    while shape.len() < lead.len() {
        shape.insert(0, 1);
    }
    let skip = shape.len() - lead.len();
    for (have, want) in shape[skip..].iter_mut().zip(lead) {
        if *have == 1 {
            *have = *want;
        } else if *want != 1 && want != have {
            return Err(InvalidInputError::new_err(format!(
                "{name}: leading dimensions {lead:?} do not broadcast with those of the other arguments"
            )));
        }
    }
    Ok(())
}

/// Which row of an array of leading shape `lead` serves each problem of the batch.
fn broadcast_table(lead: &[usize], shape: &[usize]) -> Vec<usize> {
    let count = shape.iter().product();
    let skip = shape.len() - lead.len();
    let row = |problem: usize| {
        let (mut rest, mut stride, mut row) = (problem, 1, 0);
        for axis in (0..shape.len()).rev() {
            let index = rest % shape[axis];
            rest /= shape[axis];
            if axis >= skip {
                let extent = lead[axis - skip];
                row += if extent == 1 { 0 } else { index * stride };
                stride *= extent;
            }
        }
        row
    };
    (0..count).map(row).collect()
}

enum Offsets {
    Shared,
    Each,
    Table(Vec<usize>),
}

/// The rows of one argument, one for each problem.
pub struct Rows<'a> {
    data: &'a [f64],
    size: usize,
    offsets: Offsets,
}

impl<'a> Rows<'a> {
    /// Numbers of one problem.
    #[inline]
    pub fn of(&self, problem: usize) -> &'a [f64] {
        let row = match &self.offsets {
            Offsets::Shared => 0,
            Offsets::Each => problem,
            Offsets::Table(table) => table.get(problem).copied().unwrap_or(0),
        };
        self.data.get(row * self.size..(row + 1) * self.size).unwrap_or(&[])
    }

    /// Numbers of one row.
    pub fn width(&self) -> usize {
        self.size
    }

    /// A copy: the one row that serves every problem, or (then `true`) one row for each.
    pub fn distinct_rows(&self, problems: usize) -> (Vec<f64>, bool) {
        match &self.offsets {
            Offsets::Shared => (self.of(0).to_vec(), false),
            Offsets::Each => (self.data.to_vec(), true),
            Offsets::Table(_) => ((0..problems).flat_map(|k| self.of(k)).copied().collect(), true),
        }
    }

    /// Does one row serve every problem?
    pub fn shared(&self) -> bool {
        matches!(self.offsets, Offsets::Shared)
    }
}

/// Noise of the directions.
pub enum Noise<'a> {
    /// One standard deviation for all.
    Common(f64),
    /// One per landmark.
    Sigma(Rows<'a>),
    /// A 3×3 covariance per landmark.
    Covariance(Rows<'a>),
}

/// May two rows name one landmark?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repeats {
    /// No: a repeated landmark is a slip that would count twice.
    Refused,
    /// Yes: the same landmark matched twice is what a robust solve is for.
    Allowed,
}

/// Every problem of a call.
pub struct Problems<'a> {
    /// Landmarks in each.
    pub n: usize,
    /// How many problems.
    pub count: usize,
    /// No leading dimension at all.
    pub single: bool,
    /// Leading dimensions.
    pub shape: Vec<usize>,
    /// `(N, 3)` each.
    pub landmarks: Rows<'a>,
    /// `(N, 3)` each.
    pub los: Rows<'a>,
    /// Noise.
    pub noise: Noise<'a>,
    /// `(6,)` each.
    pub guess: Option<Rows<'a>>,
    /// May two rows name one landmark?
    repeats: Repeats,
}

/// One problem, values checked, directions normalised.
pub struct Problem<'a> {
    /// `(N, 3)`, reference frame.
    pub landmarks: &'a [[f64; 3]],
    /// `(N, 3)`, unit.
    pub los: &'a [[f64; 3]],
    /// One for each direction, or one for all.
    pub weights: &'a [Weight<f64>],
    /// `[p, mrp]`.
    pub guess: Option<[f64; 6]>,
}

impl<'a> Problem<'a> {
    /// The directions as a sensor.
    pub fn sensor(&self) -> LineOfSight<'a, f64> {
        LineOfSight { landmarks: self.landmarks, los: self.los, weights: self.weights }
    }

    /// The observer at the guess, at the origin without one.
    pub fn observer(&self) -> Kinematics<f64> {
        observer(&self.guess.unwrap_or_default())
    }

    /// One number for the weight of a direction: the mean over its three components.
    pub fn scalar_weight(&self, index: usize) -> f64 {
        match self.weights.get(index.min(self.weights.len().saturating_sub(1))) {
            Some(Weight::Scalar(w)) => *w,
            Some(Weight::Full(s)) => s.iter().flatten().map(|x| x * x).sum::<f64>() / 3.0,
            None => 1.0,
        }
    }
}

/// An observer at rest at `[p, mrp]`, either shadow set.
pub fn observer(pose: &[f64; 6]) -> Kinematics<f64> {
    let [x, y, z, a, b, c] = *pose;
    Kinematics::at_rest([x, y, z], quaternion_from_mrp(mrp_inside([a, b, c])))
}

/// Room for what a problem needs beyond the arguments' memory; reused from one problem to the next.
pub struct Scratch {
    los: Vec<[f64; 3]>,
    weights: Vec<Weight<f64>>,
    /// One weight for all directions: no heap for the commonest case.
    common: [Weight<f64>; 1],
    seen: Vec<u32>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { los: Vec::new(), weights: Vec::new(), common: [Weight::Scalar(1.0)], seen: Vec::new() }
    }
}

impl<'a> Problems<'a> {
    /// `each` of every problem, over the cores without the GIL (a few stay on this one); the first invalid one is the error.
    pub fn map<R: Send>(&self, py: Python<'_>, each: impl Fn(&Problem<'_>) -> R + Sync) -> PyResult<Vec<R>> {
        let one = |scratch: &mut Scratch, k| self.get(k, scratch).map(|problem| each(&problem));
        let all: Vec<Result<R, BadValue>> = py.detach(|| {
            if self.count <= CHUNK {
                let mut scratch = Scratch::default();
                return (0..self.count).map(|k| one(&mut scratch, k)).collect();
            }
            let problems = (0..self.count).into_par_iter().with_min_len(CHUNK);
            problems.map_init(Scratch::default, one).collect()
        });
        let numbered = all.into_iter().enumerate();
        numbered.map(|(k, found)| found.map_err(|bad| bad.into_py((!self.single).then_some(k)))).collect()
    }

    /// Checks problem `k` and gives it in the solver's form.
    pub fn get<'s>(&'s self, k: usize, scratch: &'s mut Scratch) -> Result<Problem<'s>, BadValue> {
        let landmarks = triples(self.landmarks.of(k));
        let los = triples(self.los.of(k));
        let Scratch { los: unit, weights, common, seen } = scratch;
        check_coordinates(landmarks)?;
        if self.repeats == Repeats::Refused {
            check_distinct(landmarks, seen)?;
        }
        let los = check_unit("los", los, unit)?;
        weights.clear();
        let mut weight_of_all = false;
        match &self.noise {
            Noise::Common(sigma) => {
                *common = [scalar_weight(*sigma, 0)?];
                weight_of_all = true;
            }
            Noise::Sigma(rows) => {
                for (row, sigma) in rows.of(k).iter().enumerate() {
                    weights.push(scalar_weight(*sigma, row)?);
                }
            }
            Noise::Covariance(rows) => {
                for (row, (entries, b)) in rows.of(k).as_chunks::<9>().0.iter().zip(los).enumerate() {
                    weights.push(full_weight(entries, b, row)?);
                }
            }
        }
        let guess = match &self.guess {
            None => None,
            Some(rows) => Some(check_guess(rows.of(k))?),
        };
        let weights = if weight_of_all { &common[..] } else { &weights[..] };
        Ok(Problem { landmarks, los, weights, guess })
    }
}

/// Rows of three.
#[inline]
pub fn triples(data: &[f64]) -> &[[f64; 3]] {
    data.as_chunks::<3>().0
}
