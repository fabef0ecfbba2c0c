//! The sensors: one trait, one list. Laws, benches and bindings iterate the list.
//!
//! Adding a sensor: its file here (struct, equation, `linearize`, a specimen), its name in [`sensors!`](crate::sensors),
//! its parameters in the bindings, its dataclass in Python, its `h(x)` in the oracle of the tests.
use super::kinematics::Kinematics;
use super::linearization::Sink;
use crate::error::ModelError;
use crate::math::real::Real;

pub mod altimeter;
pub mod body_direction;
pub mod landmark_camera;
pub mod line_of_sight;
pub mod range;
pub mod range_bearing;
pub mod range_rate;
pub mod sun_direction;
mod target;
pub mod velocimeter;

pub use altimeter::Altimeter;
pub use body_direction::BodyDirection;
pub use landmark_camera::LandmarkCamera;
pub use line_of_sight::LineOfSight;
pub use range::Range;
pub use range_bearing::RangeBearing;
pub use range_rate::RangeRate;
pub use sun_direction::SunDirection;
pub use velocimeter::Velocimeter;

/// A measurement and its model: linearises `z ⊟ h(x)` at a state.
///
/// With a zero measurement the innovation is `−h(x)`: that is how a prediction is read from the one equation.
pub trait SensorModel<T: Real> {
    /// The public name.
    const NAME: &'static str;

    /// Rows [`linearize`](Self::linearize) hands over.
    fn rows(&self) -> usize;

    /// Hands the linearisation at `x` to `sink`. A lane where the measurement is undefined hands over NaN.
    ///
    /// # Errors
    /// Where the measurement is undefined at `x`, in every lane.
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError>;
}

/// What a law does with a sensor.
pub trait Law<T: Real> {
    /// Examines one.
    fn examine(&mut self, sensor: &impl SensorModel<T>);
}

/// A sensor that can produce an example of itself, for the laws every sensor must obey.
///
/// The example depends on `truth` only as a constant, so the scalar may carry derivatives with respect to `x`.
pub trait Specimen<T: Real> {
    /// Shows an example that measures `truth`, with some noise, to `law`.
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>);
}

/// THE list of sensors: calls `$then!{Name, Name, …}`. Every name is a type with one scalar parameter.
#[macro_export]
macro_rules! sensors {
    ($then:ident) => {
        $then! {
            LineOfSight,
            RangeBearing,
            Range,
            RangeRate,
            SunDirection,
            BodyDirection,
            LandmarkCamera,
            Velocimeter,
            Altimeter,
        }
    };
}
