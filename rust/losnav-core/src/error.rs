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
}

impl core::fmt::Display for ModelError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::ZeroRange { index } => write!(f, "landmark {index} coincides with the observer"),
            Self::RangeOverflow { index } => write!(f, "landmark {index} is too far away for its range"),
            Self::BehindCamera { index } => write!(f, "landmark {index} is behind the camera"),
        }
    }
}

impl core::error::Error for ModelError {}
