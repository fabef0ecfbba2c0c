//! Private engine of the Python package `losnav`: functions over arrays and a few result objects.
//!
//! Public names, docstrings and defaults live in Python; here every argument is taken.
mod attitude;
mod attitude_solution;
mod batch;
mod convert;
mod dispatch;
mod dynamics;
mod errors;
mod filter;
mod gravity;
mod inertial;
mod inputs;
#[cfg(target_arch = "x86_64")]
mod lanes;
mod lie;
mod lie_inertial;
mod lie_series;
mod los;
mod measured;
mod observability;
mod pose;
mod robust;
mod sensors;
mod solution;
mod strapdown;
mod threads;
mod values;
mod wahba;
mod wahba_inputs;
mod wahba_lanes;
mod wahba_robust;

/// The module `losnav._core`.
#[pyo3::pymodule(gil_used = false)]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::attitude::{
        dcm_from_mrp, dcm_from_quaternion, mrp_from_dcm, mrp_from_quaternion, mrp_shadow,
        quaternion_from_dcm, quaternion_from_mrp, rotation_error,
    };
    #[pymodule_export]
    use crate::attitude_solution::{AttitudeSolution, attitude_solution};
    #[pymodule_export]
    use crate::dynamics::{
        dynamics_process_noise, dynamics_propagate, dynamics_single, dynamics_trajectory, dynamics_transition,
    };
    #[pymodule_export]
    use crate::filter::{ArcRecord, Filter, Step};
    #[pymodule_export]
    use crate::gravity::GravityField;
    #[pymodule_export]
    use crate::inertial::InertialFilter;
    #[pymodule_export]
    use crate::lie::{LieStudy, lie_matrix};
    #[pymodule_export]
    use crate::lie_inertial::lie_inertial;
    #[pymodule_export]
    use crate::lie_series::{lie_path, lie_view};
    #[pymodule_export]
    use crate::los::{fisher_information, los_jacobian, predict_los};
    #[pymodule_export]
    use crate::observability::{pose_geometry, pose_singular};
    #[pymodule_export]
    use crate::pose::solve_pose;
    #[pymodule_export]
    use crate::robust::solve_pose_robust;
    #[pymodule_export]
    use crate::sensors::{sensor_linearize, sensor_single};
    #[pymodule_export]
    use crate::solution::PoseSolution;
    #[pymodule_export]
    use crate::strapdown::StrapdownModel;
    #[pymodule_export]
    use crate::wahba::solve_attitude;
    #[pymodule_export]
    use crate::wahba_robust::solve_attitude_robust;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("ISA", crate::dispatch::Isa::current().name())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
