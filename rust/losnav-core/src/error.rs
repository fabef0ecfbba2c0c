//! What can go wrong inside a model. Non-convergence is not here: it is a value of the solution.

/// Why a model could not be evaluated. Carries fields, not sentences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelError {
    /// The observer stands on the landmark: its direction is undefined.
    ZeroRange {
        /// Which landmark.
        index: usize,
    },
    /// The square of the range is beyond the largest number.
    RangeOverflow {
        /// Which landmark.
        index: usize,
    },
    /// The landmark is not in front of the camera (`z ≤ 0` in camera axes).
    BehindCamera {
        /// Which landmark.
        index: usize,
    },
    /// The observer stands on the target.
    AtTarget,
    /// The square of the range to the target is beyond the largest number.
    TargetTooFar,
    /// The target is straight along the body's z axis: its azimuth is undefined.
    PolarAxis,
    /// The beam of an altimeter does not point down, or starts below the ground.
    BeamMissesGround,
}

impl core::fmt::Display for ModelError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::ZeroRange { index } => write!(f, "landmark {index} coincides with the observer"),
            Self::RangeOverflow { index } => write!(f, "landmark {index} is too far away for its range"),
            Self::BehindCamera { index } => write!(f, "landmark {index} is behind the camera"),
            Self::AtTarget => write!(f, "the target coincides with the observer"),
            Self::TargetTooFar => write!(f, "the target is too far away for its range"),
            Self::PolarAxis => {
                write!(f, "the target is on the z axis of the body, where its azimuth is undefined")
            }
            Self::BeamMissesGround => write!(f, "the beam of the altimeter does not meet the ground"),
        }
    }
}

impl core::error::Error for ModelError {}
