//! What models that an integrator moves do alike: a step, and its derivative, each in a function of its own.
use crate::math::gradient::Gradient;
use crate::math::real::{Real, Work};
use crate::math::vec3::Vec3;

/// A model whose step any number can take.
pub trait Integrated {
    /// What a step needs whatever the state is.
    type Step;
    /// The state at the end of the step under a constant control.
    fn moved<T: Real>(&self, step: &Self::Step, state: &[T; 6], control: Vec3<T>) -> [T; 6];
}

/// [`DynamicsModel::propagate`](super::DynamicsModel::propagate).
pub struct Propagate<'a, T, M: Integrated> {
    pub model: &'a M,
    pub step: &'a M::Step,
    pub state: &'a [T; 6],
    pub control: Vec3<T>,
}

impl<T: Real, M: Integrated> Work for Propagate<'_, T, M> {
    type Output = [T; 6];

    #[inline(always)]
    fn run(self) -> [T; 6] {
        self.model.moved(self.step, self.state, self.control)
    }
}

/// [`DynamicsModel::transition`](super::DynamicsModel::transition): the derivative of that very step.
pub struct Transit<'a, T, M: Integrated> {
    pub model: &'a M,
    pub step: &'a M::Step,
    pub state: &'a [T; 6],
    pub control: Vec3<T>,
}

impl<T: Real, M: Integrated> Work for Transit<'_, T, M> {
    type Output = ([T; 6], [[T; 6]; 6]);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let [x, y, z] = self.control;
        let control = [x, y, z].map(Gradient::constant);
        Gradient::split(&self.model.moved(self.step, &Gradient::variables(self.state), control))
    }
}
